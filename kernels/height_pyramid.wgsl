//!include lib/pyramid.wgsl
// Mean, minimum and maximum pyramids, three levels a dispatch, in one pass over the data.
//
// Minimum and maximum are over the *surface* of 2^k x 2^k cells, samples on the shared borders included;
// the mean is over 2^k x 2^k samples (Livny et al. 2008, section 3.4), weighted at the border by how many
// samples a node really has.

struct Params {
    /// Columns and rows of samples.
    size: vec2<u32>,
    /// First level this dispatch writes: 1, 4, 7, ...
    level: u32,
    /// Levels to write, 1 to 3.
    levels: u32,
    bounds_stride: u32,
    bounds_tall: u32,
    mean_stride: u32,
    mean_tall: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> height: array<f32>;
@group(0) @binding(2) var<storage, read_write> height_max: array<f32>;
@group(0) @binding(3) var<storage, read_write> height_min: array<f32>;
@group(0) @binding(4) var<storage, read_write> height_mean: array<f32>;

override WRITE_MAX: bool = true;
override WRITE_MIN: bool = true;
override WRITE_MEAN: bool = true;

const LOWEST: f32 = -3.4e38;
const HIGHEST: f32 = 3.4e38;

/// Maximum, minimum over the surface of one node of `level - 1`; `at` may be outside, which adds nothing.
fn bounds_below(at: vec2<u32>) -> vec2<f32> {
    let cells = params.size - 1u;
    if params.level == 1u {
        if any(at >= cells) {
            return vec2(LOWEST, HIGHEST);
        }
        let north = at.y * params.size.x + at.x;
        let south = north + params.size.x;
        let nw = height[north];
        let ne = height[north + 1u];
        let sw = height[south];
        let se = height[south + 1u];
        return vec2(max(max(nw, ne), max(sw, se)), min(min(nw, ne), min(sw, se)));
    }
    if any(at >= level_size(cells, params.level - 1u)) {
        return vec2(LOWEST, HIGHEST);
    }
    let index = pyramid_index(params.bounds_stride, params.bounds_tall, params.level - 1u, at);
    var bounds = vec2(LOWEST, HIGHEST);
    if WRITE_MAX {
        bounds.x = height_max[index];
    }
    if WRITE_MIN {
        bounds.y = height_min[index];
    }
    return bounds;
}

fn write_bounds(level: u32, at: vec2<u32>, bounds: vec2<f32>) {
    if all(at < level_size(params.size - 1u, level)) {
        let index = pyramid_index(params.bounds_stride, params.bounds_tall, level, at);
        if WRITE_MAX {
            height_max[index] = bounds.x;
        }
        if WRITE_MIN {
            height_min[index] = bounds.y;
        }
    }
}

/// Sum of the means of the children times their samples, and the samples.
fn mean_below(at: vec2<u32>) -> vec2<f32> {
    let below = params.level - 1u;
    if any(at >= level_size(params.size, below)) {
        return vec2(0.0, 0.0);
    }
    let first = at << vec2(below);
    let samples = vec2<f32>(min(params.size - first, vec2(1u << below)));
    let count = samples.x * samples.y;
    if below == 0u {
        return vec2(height[at.y * params.size.x + at.x], 1.0);
    }
    let index = pyramid_index(params.mean_stride, params.mean_tall, below, at);
    return vec2(height_mean[index] * count, count);
}

fn write_mean(level: u32, at: vec2<u32>, sum: vec2<f32>) {
    if all(at < level_size(params.size, level)) {
        height_mean[pyramid_index(params.mean_stride, params.mean_tall, level, at)] = sum.x / sum.y;
    }
}

fn merge(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2(max(a.x, b.x), min(a.y, b.y));
}

fn build_bounds(node: vec2<u32>) {
    var third = vec2(LOWEST, HIGHEST);
    for (var j = 0u; j < 2u; j++) {
        for (var i = 0u; i < 2u; i++) {
            let at_second = node * 2u + vec2(i, j);
            var second = vec2(LOWEST, HIGHEST);
            for (var l = 0u; l < 4u; l++) {
                let at_first = at_second * 2u + vec2(l & 1u, l >> 1u);
                let base = at_first * 2u;
                var first = merge(bounds_below(base), bounds_below(base + vec2(1u, 0u)));
                first = merge(first, merge(bounds_below(base + vec2(0u, 1u)), bounds_below(base + vec2(1u, 1u))));
                write_bounds(params.level, at_first, first);
                second = merge(second, first);
            }
            if params.levels > 1u {
                write_bounds(params.level + 1u, at_second, second);
            }
            third = merge(third, second);
        }
    }
    if params.levels > 2u {
        write_bounds(params.level + 2u, node, third);
    }
}

fn build_mean(node: vec2<u32>) {
    var third = vec2(0.0, 0.0);
    for (var j = 0u; j < 2u; j++) {
        for (var i = 0u; i < 2u; i++) {
            let at_second = node * 2u + vec2(i, j);
            var second = vec2(0.0, 0.0);
            for (var l = 0u; l < 4u; l++) {
                let at_first = at_second * 2u + vec2(l & 1u, l >> 1u);
                let base = at_first * 2u;
                let first = mean_below(base) + mean_below(base + vec2(1u, 0u))
                    + mean_below(base + vec2(0u, 1u)) + mean_below(base + vec2(1u, 1u));
                write_mean(params.level, at_first, first);
                second += first;
            }
            if params.levels > 1u {
                write_mean(params.level + 1u, at_second, second);
            }
            third += second;
        }
    }
    if params.levels > 2u {
        write_mean(params.level + 2u, node, third);
    }
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let node = id.xy;
    // written or not, a node outside costs nothing more than the comparison
    if any((node << vec2(3u)) >= level_size(params.size, params.level - 1u)) {
        return;
    }
    if WRITE_MAX || WRITE_MIN {
        build_bounds(node);
    }
    if WRITE_MEAN {
        build_mean(node);
    }
}
