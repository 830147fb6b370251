//!include lib/warp.wgsl
// Importance-driven warp of a grid, one axis after the other (Dachsbacher, Stamminger 2004, section 3.3): along every row of the
// importance map, then along every column of the map resampled with it, points gather where the importance is high.
//
// A row's warp is the inverse of the running sum of its importance, piecewise linear. Its ends are exact and it never runs
// backwards, whatever the importance is. Rows, and then columns, are led by the more important ones beside them: what differs too much from
// one row to the next folds the cells between them. What is done about folds that are left is in `warp_folds.wgsl`.

struct Params {
    /// Columns and rows of the importance map.
    size: vec2<u32>,
    /// Columns and rows of the grid.
    grid: vec2<u32>,
    /// Share of the points that importance does not move.
    uniform_share: f32,
    /// How much less a row counts for the next one than for itself, and a column.
    decay: vec2<f32>,
    /// Rounds before this one.
    round: u32,
    /// A third round begins only if the second has lowered the spread of what is missing by this share, and so on.
    least_gain: f32,
    /// 0, which no compiler knows.
    nothing: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> importance: array<f32>;
/// Weights of a further round along rows, and down columns.
@group(0) @binding(2) var<storage, read_write> along_out: array<f32>;
@group(0) @binding(3) var<storage, read_write> down_out: array<f32>;
/// For every row of the map, where its column borders go.
@group(0) @binding(4) var<storage, read_write> rows_out: array<f32>;
@group(0) @binding(5) var<storage, read> warp_rows: array<f32>;
/// For every column of the map, where its row borders go.
@group(0) @binding(6) var<storage, read_write> columns_out: array<f32>;
@group(0) @binding(7) var<storage, read> warp_columns: array<f32>;
/// Where the corners of the importance map's cells go.
@group(0) @binding(8) var<storage, read> map_before: array<vec2<f32>>;
@group(0) @binding(9) var<storage, read_write> map_out: array<vec2<f32>>;
@group(0) @binding(10) var<storage, read> warp_map: array<vec2<f32>>;
/// How often each of these corners gave way, in the rounds before, and with this one.
@group(0) @binding(11) var<storage, read> gave_way_before: array<u32>;
@group(0) @binding(12) var<storage, read_write> gave_way: array<u32>;
/// The fourth number is how much of the warp keeps every cell convex, as the bits of an f32.
@group(0) @binding(13) var<storage, read> share: array<u32>;
/// For each line that was walked, its largest weight, and the sum of the squares of all as shares of that.
@group(0) @binding(14) var<storage, read_write> masses_out: array<vec2<f32>>;
@group(0) @binding(15) var<storage, read> line_masses: array<vec2<f32>>;
/// For each line, how much it leads, and one over how much it is led in all.
@group(0) @binding(16) var<storage, read_write> leads_out: array<vec2<f32>>;
@group(0) @binding(17) var<storage, read> line_leads: array<vec2<f32>>;
/// Where the borders of lines go before and after they are led.
@group(0) @binding(18) var<storage, read> unled: array<f32>;
@group(0) @binding(19) var<storage, read_write> led: array<f32>;
/// What earlier rounds have left missing, along rows and down columns; and what `survey` finds in each row of it.
@group(0) @binding(20) var<storage, read> missing_along: array<f32>;
@group(0) @binding(21) var<storage, read> missing_down: array<f32>;
@group(0) @binding(22) var<storage, read_write> survey_out: array<f32>;
@group(0) @binding(23) var<storage, read> surveys: array<f32>;
/// Workgroups along x, y and z that walk lines; none along x if this round is not needed.
@group(0) @binding(24) var<storage, read_write> round_work: array<u32>;
@group(0) @binding(25) var<storage, read> round_needed: array<u32>;
/// After each round but the last, by how much what is missing is spread.
@group(0) @binding(26) var<storage, read_write> residual: array<f32>;
@group(0) @binding(27) var<storage, read> uniform_point: array<vec2<f32>>;
@group(0) @binding(28) var<storage, read_write> grid_point: array<vec2<f32>>;

/// Running sums keep what an f32 rounds away; without, they are plain f32 sums.
override COMPENSATED: bool = true;
/// There is a warp from an earlier round.
override HAS_MAP: bool = false;
/// Lines are led by those beside them.
override LED: bool = false;
/// This round may not be needed.
override MAY_END: bool = false;

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
    // a compiler may take what is lost for the nothing that it is in real numbers (NVIDIA's does) unless it cannot know the sum
    let next = bitcast<f32>(bitcast<u32>(sum.x + value) | params.nothing);
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
    if LED {
        var squares = 0.0;
        for (var i = 0u; i < count; i++) {
            let share = weight_of(line, i, is_column) / max(largest, 1e-37);
            squares += share * share;
        }
        masses_out[line] = vec2(largest, squares);
    }
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

/// The least that a line leads, as a share of what one with a single weight as large as any does.
const LEAST_LEAD: f32 = 1e-12;

/// How much a line leads: the points that are asked for in it go as the squares of its weights.
fn lead_of(line: u32, largest: f32) -> f32 {
    let mass = line_masses[line];
    let share = mass.x / largest;
    return max(share * share * mass.y, LEAST_LEAD);
}

/// How much a line leads, and by how much it is led: by itself and, the less the farther they are, by all others.
fn weigh_lines(line: u32, lines: u32, decay: f32) {
    var largest = 1e-37;
    for (var i = 0u; i < lines; i++) {
        largest = max(largest, line_masses[i].x);
    }
    let own = lead_of(line, largest);
    var sum = own;
    var share = 1.0;
    for (var away = 1u; away < lines; away++) {
        share *= decay;
        // beyond the ends there is none
        if away <= line {
            sum += share * lead_of(line - away, largest);
        }
        if line + away < lines {
            sum += share * lead_of(line + away, largest);
        }
    }
    leads_out[line] = vec2(own, 1.0 / sum);
}

@compute @workgroup_size(64)
fn weigh_rows(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.size.y {
        weigh_lines(id.x, params.size.y, params.decay.x);
    }
}

@compute @workgroup_size(64)
fn weigh_columns(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.size.x {
        weigh_lines(id.x, params.size.x, params.decay.y);
    }
}

/// Border `at` of all lines, each in the middle of where the lines that lead it have theirs: once down the lines, and once back.
fn lead_lines(at: u32, lines: u32, count: u32, decay: f32) {
    let stride = count + 1u;
    var sum = 0.0;
    for (var line = 0u; line < lines; line++) {
        sum = line_leads[line].x * unled[line * stride + at] + decay * sum;
        led[line * stride + at] = sum;
    }
    sum = 0.0;
    for (var i = 1u; i <= lines; i++) {
        let line = lines - i;
        let index = line * stride + at;
        let lead = line_leads[line];
        // the ends are exact
        let middle = select(select(clamp((led[index] + decay * sum) * lead.y, 0.0, 1.0), 1.0, at == count), 0.0, at == 0u);
        sum = lead.x * unled[index] + decay * sum;
        led[index] = middle;
    }
}

@compute @workgroup_size(64)
fn lead_rows(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x <= params.size.x {
        lead_lines(id.x, params.size.y, params.size.x, params.decay.x);
    }
}

@compute @workgroup_size(64)
fn lead_columns(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x <= params.size.y {
        lead_lines(id.x, params.size.x, params.size.y, params.decay.y);
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

/// The importance where the rounds before have put each cell, times the size that they have left it: what they have given is divided out, so
/// that a round only gives what is missing. (The importance alone would be applied once more in each round.)
@compute @workgroup_size(8, 8)
fn resample(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let cells = vec2<f32>(params.size);
    let middle = mapped_before((vec2<f32>(id.xy) + 0.5) / cells);
    let place = clamp(middle * cells - 0.5, vec2(0.0), cells - 1.0);
    let low = min(vec2<u32>(place), params.size - 1u);
    let high = min(low + 1u, params.size - 1u);
    let w = place - vec2<f32>(low);
    let north = between(important(low), important(vec2(high.x, low.y)), w.x);
    let south = between(important(vec2(low.x, high.y)), important(high), w.x);
    let wanted = between(north, south, w.y);
    let first = id.y * (params.size.x + 1u) + id.x;
    let below = first + params.size.x + 1u;
    let along = (map_before[first + 1u] - map_before[first]) + (map_before[below + 1u] - map_before[below]);
    let down = (map_before[below] - map_before[first]) + (map_before[below + 1u] - map_before[first + 1u]);
    let index = id.y * params.size.x + id.x;
    // half the sum of two sides of the cell; 1 is a cell that has not been moved
    along_out[index] = min(wanted, 1.0e30) * (0.5 * length(along * cells));
    down_out[index] = min(wanted, 1.0e30) * (0.5 * length(down * cells));
}

/// Numbers that `survey` leaves for each row.
const SURVEYED: u32 = 5u;

/// What is missing in a cell, along and down, as shares of `largest`.
fn missing_shares(at: u32, largest: f32) -> vec2<f32> {
    return vec2(weight(missing_along[at]), weight(missing_down[at])) / largest;
}

/// Logarithms of shares; what nothing is asked for in has none.
fn octaves(shares: vec2<f32>) -> vec2<f32> {
    return log2(max(shares, vec2(1e-37)));
}

/// Of the cells of a row: the largest weight that is missing; as shares of that, their demand, which is what is missing along them times what is
/// missing down them, the means of both logarithms by demand, and the squares around these means.
@compute @workgroup_size(64)
fn survey(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.size.y {
        return;
    }
    let first = id.x * params.size.x;
    var largest = 1e-37;
    for (var i = 0u; i < params.size.x; i++) {
        largest = max(largest, max(weight(missing_along[first + i]), weight(missing_down[first + i])));
    }
    var demand = 0.0;
    var means = vec2(0.0);
    for (var i = 0u; i < params.size.x; i++) {
        let shares = missing_shares(first + i, largest);
        demand += shares.x * shares.y;
        means += shares.x * shares.y * octaves(shares);
    }
    means /= max(demand, 1e-37);
    var squares = 0.0;
    for (var i = 0u; i < params.size.x; i++) {
        let shares = missing_shares(first + i, largest);
        let off = octaves(shares) - means;
        squares += shares.x * shares.y * dot(off, off);
    }
    let at = id.x * SURVEYED;
    survey_out[at] = largest;
    survey_out[at + 1u] = demand;
    survey_out[at + 2u] = means.x;
    survey_out[at + 3u] = means.y;
    survey_out[at + 4u] = squares;
}

/// What is spread by less than this, in octaves, is left as it is.
const LEAST_SPREAD: f32 = 0.1;

/// The spread of what is missing: root of the variances of its logarithms, along rows and down columns, by demand. Nothing is spread if
/// every cell has what is asked for, up to one factor. Rows are put together as Chan, Golub and LeVeque (1983) do, so that no digits are lost
/// to the size of the logarithms.
@compute @workgroup_size(1)
fn judge() {
    var largest = 1e-37;
    for (var i = 0u; i < params.size.y; i++) {
        largest = max(largest, surveys[i * SURVEYED]);
    }
    var demand = 0.0;
    var means = vec2(0.0);
    var squares = 0.0;
    for (var i = 0u; i < params.size.y; i++) {
        let at = i * SURVEYED;
        let share = surveys[at] / largest;
        let own = share * share * surveys[at + 1u];
        let off = vec2(surveys[at + 2u], surveys[at + 3u]) + log2(max(share, 1e-37)) - means;
        let all = demand + own;
        let part = own / max(all, 1e-37);
        squares += share * share * surveys[at + 4u] + dot(off, off) * demand * part;
        means += off * part;
        demand = all;
    }
    let spread = sqrt(squares / max(demand, 1e-37));
    residual[params.round - 1u] = spread;
    var is_needed = spread >= LEAST_SPREAD;
    if params.round > 1u {
        is_needed = is_needed && spread <= (1.0 - params.least_gain) * residual[params.round - 2u];
    }
    round_work[0] = select(0u, (max(params.size.x, params.size.y) + 64u) / 64u, is_needed);
    round_work[1] = 1u;
    round_work[2] = 1u;
}

/// A corner goes down its column's warp, then along the warp of the row it has come to.
@compute @workgroup_size(8, 8)
fn compose(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy > params.size) {
        return;
    }
    let index = id.y * (params.size.x + 1u) + id.x;
    gave_way[index] = 0u;
    if HAS_MAP {
        gave_way[index] = gave_way_before[index];
    }
    if MAY_END && round_needed[0] == 0u {
        map_out[index] = map_before[index];
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

/// The coarse warp at every point of the grid.
@compute @workgroup_size(8, 8)
fn refine(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.grid) {
        return;
    }
    let index = id.y * params.grid.x + id.x;
    let place = uniform_point[index];
    let warped = warped_place(place);
    let far = bitcast<f32>(share[SHARE]);
    grid_point[index] = clamp(vec2(between(place.x, warped.x, far), between(place.y, warped.y, far)), vec2(0.0), vec2(1.0));
}
