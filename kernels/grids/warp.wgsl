// Importance-driven warp of a grid, one axis after the other (Dachsbacher, Stamminger 2004, section 3.3): along every row of the
// importance map, then along every column of the map resampled with it, points gather where the importance is high.
//
// A row's warp is the inverse of the running sum of its importance, piecewise linear. Its ends are exact and it never runs
// backwards, whatever the importance is.

struct Params {
    /// Columns and rows of the importance map.
    size: vec2<u32>,
    /// Columns and rows of the grid.
    grid: vec2<u32>,
    /// Share of the points that importance does not move.
    uniform_share: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> importance: array<f32>;
@group(0) @binding(2) var<storage, read_write> resampled: array<f32>;
/// For every row of the map, where its column borders go.
@group(0) @binding(3) var<storage, read_write> rows_out: array<f32>;
@group(0) @binding(4) var<storage, read> warp_rows: array<f32>;
/// For every column of the map, where its row borders go.
@group(0) @binding(5) var<storage, read_write> columns_out: array<f32>;
@group(0) @binding(6) var<storage, read> warp_columns: array<f32>;
/// Where the corners of the importance map's cells go.
@group(0) @binding(7) var<storage, read> map_before: array<vec2<f32>>;
@group(0) @binding(8) var<storage, read_write> map_out: array<vec2<f32>>;
@group(0) @binding(9) var<storage, read> warp_map: array<vec2<f32>>;
/// How much of the warp keeps every cell convex, as the bits of an f32.
@group(0) @binding(10) var<storage, read_write> share_out: array<atomic<u32>>;
@group(0) @binding(11) var<storage, read> share: array<u32>;
@group(0) @binding(12) var<storage, read> uniform_point: array<vec2<f32>>;
@group(0) @binding(13) var<storage, read_write> grid_point: array<vec2<f32>>;

/// Running sums keep what an f32 rounds away; without, they are plain f32 sums.
override COMPENSATED: bool = true;
/// There is a warp from an earlier round.
override HAS_MAP: bool = false;

/// Importance as a weight: NaN, negative and denormal numbers are none, infinity is the largest number.
fn weight(value: f32) -> f32 {
    let bits = bitcast<u32>(value);
    let exponent = (bits >> 23u) & 255u;
    let is_nan = exponent == 255u && (bits & 0x7fffffu) != 0u;
    if is_nan || exponent == 0u || (bits >> 31u) == 1u {
        return 0.0;
    }
    return min(value, 3.0e38);
}

fn important(at: vec2<u32>) -> f32 {
    return weight(importance[at.y * params.size.x + at.x]);
}

/// The end of an interpolation is exact.
fn between(a: f32, b: f32, w: f32) -> f32 {
    return select(a + (b - a) * w, b, w >= 1.0);
}

/// Importance in the middle of a column of row `row` after the row's warp.
fn important_in_column(column: u32, row: u32) -> f32 {
    let first = row * (params.size.x + 1u) + column;
    let middle = 0.5 * (warp_rows[first] + warp_rows[first + 1u]);
    let place = clamp(middle * f32(params.size.x) - 0.5, 0.0, f32(params.size.x - 1u));
    let low = min(u32(place), params.size.x - 1u);
    let high = min(low + 1u, params.size.x - 1u);
    return between(important(vec2(low, row)), important(vec2(high, row)), place - f32(low));
}

/// Weight `at` of line `line`: along a row of the map, or down a column of the warped one.
fn weight_of(line: u32, at: u32, is_column: bool) -> f32 {
    if is_column {
        return important_in_column(line, at);
    }
    return important(vec2(at, line));
}

/// A sum and what its roundings took away (Neumaier 1974).
fn add(sum: vec2<f32>, value: f32) -> vec2<f32> {
    let next = sum.x + value;
    if !COMPENSATED {
        return vec2(next, 0.0);
    }
    let lost = select((value - next) + sum.x, (sum.x - next) + value, abs(sum.x) >= abs(value));
    return vec2(next, sum.y + lost);
}

/// Walks the running sum of a line of `count` weights along `count + 1` evenly spaced shares of its total; `place` says where
/// each share is reached.
fn walk(line: u32, count: u32, is_column: bool) {
    var largest = 0.0;
    for (var i = 0u; i < count; i++) {
        largest = max(largest, weight_of(line, i, is_column));
    }
    let first = line * (count + 1u);
    if largest == 0.0 {
        for (var i = 0u; i <= count; i++) {
            put(first + i, f32(i) / f32(count), is_column);
        }
        put(first + count, 1.0, is_column);
        return;
    }
    var sum = vec2(0.0);
    for (var i = 0u; i < count; i++) {
        sum = add(sum, weight_of(line, i, is_column) / largest);
    }
    let total = sum.x + sum.y;
    let mean = total / f32(count);
    var k = 0u;
    var before = vec2(0.0);
    var own = mix(weight_of(line, 0u, is_column) / largest, mean, params.uniform_share);
    var last = 0.0;
    put(first, 0.0, is_column);
    // one loop for both, not one in the other: an adapter may end the loops of a thread after some ten thousand turns in all, and
    // counts the longest way of several threads at every turn
    var i = 1u;
    while i < count {
        let wanted = total * (f32(i) / f32(count));
        let next = add(before, own);
        if k + 1u < count && next.x + next.y < wanted {
            before = next;
            k += 1u;
            own = mix(weight_of(line, k, is_column) / largest, mean, params.uniform_share);
        } else {
            let part = ((wanted - before.x) - before.y) / own;
            let place = (f32(k) + select(0.0, clamp(part, 0.0, 1.0), own > 0.0)) / f32(count);
            // rounding may not turn the order around
            last = max(last, min(place, 1.0));
            put(first + i, last, is_column);
            i += 1u;
        }
    }
    put(first + count, 1.0, is_column);
}

fn put(at: u32, place: f32, is_column: bool) {
    if is_column {
        columns_out[at] = place;
    } else {
        rows_out[at] = place;
    }
}

@compute @workgroup_size(64)
fn rows(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.size.y {
        walk(id.x, params.size.x, false);
    }
}

@compute @workgroup_size(64)
fn columns(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.size.x {
        walk(id.x, params.size.y, true);
    }
}

/// Bilinear in the map of the rounds before.
fn mapped_before(place: vec2<f32>) -> vec2<f32> {
    if !HAS_MAP {
        return place;
    }
    let at = clamp(place, vec2(0.0), vec2(1.0)) * vec2<f32>(params.size);
    let low = min(vec2<u32>(at), params.size - 1u);
    let w = at - vec2<f32>(low);
    let first = low.y * (params.size.x + 1u) + low.x;
    let south = first + params.size.x + 1u;
    return interpolate(map_before[first], map_before[first + 1u], map_before[south], map_before[south + 1u], w);
}

fn interpolate(nw: vec2<f32>, ne: vec2<f32>, sw: vec2<f32>, se: vec2<f32>, w: vec2<f32>) -> vec2<f32> {
    let north = vec2(between(nw.x, ne.x, w.x), between(nw.y, ne.y, w.x));
    let south = vec2(between(sw.x, se.x, w.x), between(sw.y, se.y, w.x));
    return vec2(between(north.x, south.x, w.y), between(north.y, south.y, w.y));
}

/// The importance where the rounds before have put each cell.
@compute @workgroup_size(8, 8)
fn resample(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let middle = mapped_before((vec2<f32>(id.xy) + 0.5) / vec2<f32>(params.size));
    let last = vec2<f32>(params.size - 1u);
    let place = clamp(middle * vec2<f32>(params.size) - 0.5, vec2(0.0), last);
    let low = min(vec2<u32>(place), params.size - 1u);
    let high = min(low + 1u, params.size - 1u);
    let w = place - vec2<f32>(low);
    let north = between(important(low), important(vec2(high.x, low.y)), w.x);
    let south = between(important(vec2(low.x, high.y)), important(high), w.x);
    resampled[id.y * params.size.x + id.x] = between(north, south, w.y);
}

/// A corner goes down its column's warp, then along the warp of the row it has come to.
@compute @workgroup_size(8, 8)
fn compose(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id.xy == vec2(0u)) {
        atomicStore(&share_out[0], bitcast<u32>(1.0));
    }
    if any(id.xy > params.size) {
        return;
    }
    let west = max(id.x, 1u) - 1u;
    let east = min(id.x, params.size.x - 1u);
    let points = params.size.y + 1u;
    let y = between(warp_columns[west * points + id.y], warp_columns[east * points + id.y], 0.5);
    let place = clamp(y * f32(params.size.y) - 0.5, 0.0, f32(params.size.y - 1u));
    let north = min(u32(place), params.size.y - 1u);
    let south = min(north + 1u, params.size.y - 1u);
    let wide = params.size.x + 1u;
    let x = between(warp_rows[north * wide + id.x], warp_rows[south * wide + id.x], place - f32(north));
    map_out[id.y * wide + id.x] = mapped_before(vec2(x, y));
}

/// Least area of a cell's corner, as a share of what it has without warp.
const LEAST: f32 = 0.01;

/// How far along the straight way from unwarped (0) to warped (1) a corner keeps its sense of rotation: `along` and `down` are
/// by how much its edges change, in cells. The corner's area is 1 + b t + a t^2.
fn convex_until(along: vec2<f32>, down: vec2<f32>) -> f32 {
    let a = along.x * down.y - along.y * down.x;
    let b = along.x + down.y;
    let c = 1.0 - LEAST;
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return 1.0;
    }
    let q = -0.5 * (b + select(-1.0, 1.0, b >= 0.0) * sqrt(discriminant));
    let first = select(c / q, 2.0, q == 0.0);
    let second = select(q / a, 2.0, a == 0.0);
    return min(select(2.0, first, first > 0.0), select(2.0, second, second > 0.0));
}

fn moved(at: vec2<u32>) -> vec2<f32> {
    return warp_map[at.y * (params.size.x + 1u) + at.x] * vec2<f32>(params.size) - vec2<f32>(at);
}

/// A warp along rows that differ can fold the cells between them: the whole of it goes only as far as none does.
@compute @workgroup_size(8, 8)
fn unfold(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let nw = moved(id.xy);
    let ne = moved(id.xy + vec2(1u, 0u));
    let sw = moved(id.xy + vec2(0u, 1u));
    let se = moved(id.xy + 1u);
    let north = min(convex_until(ne - nw, sw - nw), convex_until(ne - nw, se - ne));
    let south = min(convex_until(se - sw, sw - nw), convex_until(se - sw, se - ne));
    let until = min(north, south);
    if until < 1.0 {
        // positive floats are ordered like their bits
        atomicMin(&share_out[0], bitcast<u32>(0.999 * until));
    }
}

/// The coarse warp at every point of the grid.
@compute @workgroup_size(8, 8)
fn refine(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.grid) {
        return;
    }
    let index = id.y * params.grid.x + id.x;
    let place = uniform_point[index];
    let at = clamp(place, vec2(0.0), vec2(1.0)) * vec2<f32>(params.size);
    let low = min(vec2<u32>(at), params.size - 1u);
    let first = low.y * (params.size.x + 1u) + low.x;
    let south = first + params.size.x + 1u;
    let warped = interpolate(warp_map[first], warp_map[first + 1u], warp_map[south], warp_map[south + 1u], at - vec2<f32>(low));
    let far = bitcast<f32>(share[0]);
    grid_point[index] = clamp(vec2(between(place.x, warped.x, far), between(place.y, warped.y, far)), vec2(0.0), vec2(1.0));
}
