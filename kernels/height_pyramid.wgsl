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

/// Extremes of a row of four nodes: maxima and minima.
struct Row {
    high: vec4<f32>,
    low: vec4<f32>,
}

/// Samples `first .. first + 9` of a row of samples, as the four pairs of cells they bound. Samples beyond the
/// border repeat the last one, which belongs to the same cells.
fn sample_row(first: u32, row: u32) -> Row {
    let last = params.size - 1u;
    let start = min(row, last.y) * params.size.x;
    let end = start + last.x;
    let i = start + first;
    let a = height[min(i, end)];
    let b = height[min(i + 1u, end)];
    let c = height[min(i + 2u, end)];
    let d = height[min(i + 3u, end)];
    let e = height[min(i + 4u, end)];
    let f = height[min(i + 5u, end)];
    let g = height[min(i + 6u, end)];
    let h = height[min(i + 7u, end)];
    let j = height[min(i + 8u, end)];
    let even = vec4(a, c, e, g);
    let odd = vec4(b, d, f, h);
    let next = vec4(c, e, g, j);
    return Row(max(max(even, odd), next), min(min(even, odd), next));
}

/// Nodes `first .. first + 8` of a row of the level below, in pairs. Nodes beyond the border repeat the last.
fn node_row(first: u32, row: u32) -> Row {
    let below = params.level - 1u;
    let last = level_size(params.size - 1u, below) - 1u;
    let start = pyramid_index(params.bounds_stride, params.bounds_tall, below, vec2(0u, min(row, last.y)));
    let end = start + last.x;
    let i = start + first;
    var out = Row(vec4(LOWEST), vec4(HIGHEST));
    for (var k = 0u; k < 2u; k++) {
        let p = min(i + k, end);
        let q = min(i + k + 2u, end);
        let r = min(i + k + 4u, end);
        let s = min(i + k + 6u, end);
        if WRITE_MAX {
            out.high = max(out.high, vec4(height_max[p], height_max[q], height_max[r], height_max[s]));
        }
        if WRITE_MIN {
            out.low = min(out.low, vec4(height_min[p], height_min[q], height_min[r], height_min[s]));
        }
    }
    return out;
}

fn merge_rows(a: Row, b: Row) -> Row {
    return Row(max(a.high, b.high), min(a.low, b.low));
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

/// One row of four nodes of the first level that this dispatch writes.
fn first_level_row(node: vec2<u32>, row: u32) -> Row {
    let first = node * 8u + vec2(0u, 2u * row);
    if params.level == 1u {
        let border = merge_rows(sample_row(first.x, first.y), sample_row(first.x, first.y + 2u));
        return merge_rows(border, sample_row(first.x, first.y + 1u));
    }
    return merge_rows(node_row(first.x, first.y), node_row(first.x, first.y + 1u));
}

fn build_bounds(node: vec2<u32>) {
    var third = vec2(LOWEST, HIGHEST);
    for (var j = 0u; j < 2u; j++) {
        let north = first_level_row(node, 2u * j);
        let south = first_level_row(node, 2u * j + 1u);
        let at = node * 4u + vec2(0u, 2u * j);
        for (var i = 0u; i < 4u; i++) {
            write_bounds(params.level, at + vec2(i, 0u), vec2(north.high[i], north.low[i]));
            write_bounds(params.level, at + vec2(i, 1u), vec2(south.high[i], south.low[i]));
        }
        let both = merge_rows(north, south);
        let west = vec2(max(both.high.x, both.high.y), min(both.low.x, both.low.y));
        let east = vec2(max(both.high.z, both.high.w), min(both.low.z, both.low.w));
        if params.levels > 1u {
            write_bounds(params.level + 1u, node * 2u + vec2(0u, j), west);
            write_bounds(params.level + 1u, node * 2u + vec2(1u, j), east);
        }
        third = merge(third, merge(west, east));
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
    // the last column or row of samples can start a node of the means where there are no cells any more
    let has_cells = all((node << vec2(3u)) < level_size(params.size - 1u, params.level - 1u));
    if (WRITE_MAX || WRITE_MIN) && has_cells {
        build_bounds(node);
    }
    if WRITE_MEAN {
        build_mean(node);
    }
}
