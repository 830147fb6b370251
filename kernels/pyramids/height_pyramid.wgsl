//!include ground as image
// Mean, minimum and maximum pyramids, three levels a dispatch, in one pass over the data.
//
// Minimum and maximum are over the *surface* of 2^k x 2^k cells, samples on the shared borders included;
// the mean is over 2^k x 2^k samples (Livny et al. 2008, section 3.4), weighted at the border by how many
// samples a node really has.

struct Params {
    /// First level this dispatch writes: 1, 4, 7, ...
    level: u32,
    /// Levels to write, 1 to 3.
    levels: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> height_max: array<f32>;
@group(0) @binding(2) var<storage, read_write> height_min: array<f32>;
@group(0) @binding(3) var<storage, read_write> height_mean: array<f32>;

override WRITE_MAX: bool = true;
override WRITE_MIN: bool = true;
override WRITE_MEAN: bool = true;
/// The first dispatch reads samples, the others the level below.
override FROM_SAMPLES: bool = true;

const LOWEST: f32 = -3.4e38;
const HIGHEST: f32 = 3.4e38;

fn merge(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2(max(a.x, b.x), min(a.y, b.y));
}

/// Extremes of a row of four nodes: maxima and minima.
struct Row {
    high: vec4<f32>,
    low: vec4<f32>,
}

/// Two rows of samples from `first` on, as the pairs of cells between columns: the upper row, and both.
struct Pair {
    upper: Row,
    both: Row,
}

fn sample_rows(x: u32, y: u32) -> Pair {
    let a = ground_four(vec2<i32>(vec2(x, y)));
    let b = ground_four(vec2<i32>(vec2(x + 2u, y)));
    let c = ground_four(vec2<i32>(vec2(x + 4u, y)));
    let d = ground_four(vec2<i32>(vec2(x + 6u, y)));
    let e = ground_four(vec2<i32>(vec2(x + 8u, y)));
    let upper = widen(vec4(a.x, b.x, c.x, d.x), vec4(a.y, b.y, c.y, d.y), vec4(b.x, c.x, d.x, e.x));
    let lower = widen(vec4(a.z, b.z, c.z, d.z), vec4(a.w, b.w, c.w, d.w), vec4(b.z, c.z, d.z, e.z));
    return Pair(upper, merge_rows(upper, lower));
}

/// Extremes of the three columns of samples that bound each pair of cells.
fn widen(left: vec4<f32>, middle: vec4<f32>, right: vec4<f32>) -> Row {
    return Row(max(max(left, middle), right), min(min(left, middle), right));
}

/// Nodes `first .. first + 8` of a row of the level below, in pairs. Nodes beyond the border repeat the last.
fn node_row(first: u32, row: u32) -> Row {
    let below = params.level - 1u;
    let last = level_size(ground_size() - 1u, below) - 1u;
    let start = pyramid_index(ground_cells(), below, vec2(0u, min(row, last.y)));
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
    if all(at < level_size(ground_size() - 1u, level)) {
        let index = pyramid_index(ground_cells(), level, at);
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
    if any(at >= level_size(ground_size(), below)) {
        return vec2(0.0, 0.0);
    }
    let first = at << vec2(below);
    let samples = vec2<f32>(min(ground_size() - first, vec2(1u << below)));
    let count = samples.x * samples.y;
    if below == 0u {
        return vec2(ground_height(at), 1.0);
    }
    let index = pyramid_index(ground_means(), below, at);
    return vec2(height_mean[index] * count, count);
}

fn write_mean(level: u32, at: vec2<u32>, sum: vec2<f32>) {
    if all(at < level_size(ground_size(), level)) {
        height_mean[pyramid_index(ground_means(), level, at)] = sum.x / sum.y;
    }
}

/// Writes two rows of the first level and the row of the second above them; returns the extremes of all.
fn write_rows(node: vec2<u32>, j: u32, north: Row, south: Row) -> vec2<f32> {
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
    return merge(west, east);
}

/// Levels 1 to 3 from the samples: the row of samples between two nodes belongs to both.
fn build_from_samples(node: vec2<u32>) {
    let first = node * 8u;
    var third = vec2(LOWEST, HIGHEST);
    var rows = sample_rows(first.x, first.y);
    for (var j = 0u; j < 2u; j++) {
        let middle = sample_rows(first.x, first.y + 4u * j + 2u);
        let north = merge_rows(rows.both, middle.upper);
        rows = sample_rows(first.x, first.y + 4u * j + 4u);
        let south = merge_rows(middle.both, rows.upper);
        third = merge(third, write_rows(node, j, north, south));
    }
    if params.levels > 2u {
        write_bounds(params.level + 2u, node, third);
    }
}

/// Three levels from the one below.
fn build_from_nodes(node: vec2<u32>) {
    let first = node * 8u;
    var third = vec2(LOWEST, HIGHEST);
    for (var j = 0u; j < 2u; j++) {
        let y = first.y + 4u * j;
        let north = merge_rows(node_row(first.x, y), node_row(first.x, y + 1u));
        let south = merge_rows(node_row(first.x, y + 2u), node_row(first.x, y + 3u));
        third = merge(third, write_rows(node, j, north, south));
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
    if any((node << vec2(3u)) >= level_size(ground_size(), params.level - 1u)) {
        return;
    }
    // the last column or row of samples can start a node of the means where there are no cells any more
    let has_cells = all((node << vec2(3u)) < level_size(ground_size() - 1u, params.level - 1u));
    if (WRITE_MAX || WRITE_MIN) && has_cells {
        if FROM_SAMPLES {
            build_from_samples(node);
        } else {
            build_from_nodes(node);
        }
    }
    if WRITE_MEAN {
        build_mean(node);
    }
}
