//!include ground
// For each node of a pyramid over cells: a plane and the largest distance between it and the surface. Levels up to
// EXACT_LEVELS are fitted to the samples themselves, the ones above to the planes below them.

struct Params {
    level: u32,
    /// Largest height without its sign, for what rounding may add.
    largest_m: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
/// Height in the node's middle and largest distance of the surface from the plane, metres.
@group(0) @binding(1) var<storage, read_write> height_plane: array<vec2<f32>>;
/// Slope to the east and to the south in metres a cell, as two halves.
@group(0) @binding(2) var<storage, read_write> plane_slope: array<u32>;

/// Least squares over the samples of a node. The surface between samples is nowhere farther from a plane than at them.
@compute @workgroup_size(8, 8)
fn from_samples(@builtin(global_invocation_id) id: vec3<u32>) {
    let cells = ground_size() - 1u;
    if any(id.xy >= level_size(cells, params.level)) {
        return;
    }
    let low = id.xy << vec2(params.level);
    let high = min(low + (1u << params.level), cells);
    let middle = vec2<f32>(low) + 0.5 * f32(1u << params.level);
    let mean = 0.5 * vec2<f32>(low + high);
    let first = ground_height(low);
    // heights as differences from one of them: they keep their digits far above sea level
    var sum = 0.0;
    var products = vec2(0.0);
    var squares = vec2(0.0);
    var count = 0.0;
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let offset = vec2(f32(x), f32(y)) - mean;
            let h = ground_height(vec2(x, y)) - first;
            sum += h;
            products += h * offset;
            squares += offset * offset;
            count += 1.0;
        }
    }
    let slope = stored(products / squares);
    let mean_m = sum / count;
    var lowest = 3.0e38;
    var highest = -3.0e38;
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let off = ground_height(vec2(x, y)) - first - mean_m - dot(slope, vec2(f32(x), f32(y)) - mean);
            lowest = min(lowest, off);
            highest = max(highest, off);
        }
    }
    store(id.xy, slope, first + mean_m + dot(slope, middle - mean), lowest, highest);
}

@compute @workgroup_size(8, 8)
fn from_planes(@builtin(global_invocation_id) id: vec3<u32>) {
    let cells = ground_size() - 1u;
    if any(id.xy >= level_size(cells, params.level)) {
        return;
    }
    let below = level_size(cells, params.level - 1u);
    let side = f32(1u << (params.level - 1u));
    let first = id.xy * 2u;
    let last = min(first + 1u, below - 1u);
    var sum = vec3(0.0);
    var count = 0.0;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let plane = plane_of(vec2(x, y));
            let offset = (vec2(f32(x), f32(y)) - vec2<f32>(first) - 0.5) * side;
            sum += vec3(plane.yz, plane.x - dot(plane.yz, offset));
            count += 1.0;
        }
    }
    let slope = stored(sum.xy / count);
    let middle_m = sum.z / count;
    var lowest = 3.0e38;
    var highest = -3.0e38;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let plane = plane_of(vec2(x, y));
            let offset = (vec2(f32(x), f32(y)) - vec2<f32>(first) - 0.5) * side;
            let middle = plane.x - middle_m - dot(slope, offset);
            let turn = abs(plane.yz - slope) * 0.5 * side;
            lowest = min(lowest, middle - turn.x - turn.y - plane.w);
            highest = max(highest, middle + turn.x + turn.y + plane.w);
        }
    }
    store(id.xy, slope, middle_m, lowest, highest);
}

/// Height in the middle, slopes, largest distance.
fn plane_of(node: vec2<u32>) -> vec4<f32> {
    let index = ground_node(params.level - 1u, node);
    let plane = height_plane[index];
    return vec4(plane.x, unpack2x16float(plane_slope[index]), plane.y);
}

/// A slope as it will be read: the distances are taken from the plane that has it.
fn stored(slope: vec2<f32>) -> vec2<f32> {
    return unpack2x16float(pack2x16float(clamp(slope, vec2(-6e4), vec2(6e4))));
}

/// The plane in the middle between lowest and highest, with room for a dozen roundings of its terms.
fn store(node: vec2<u32>, slope: vec2<f32>, middle_m: f32, lowest: f32, highest: f32) {
    let side = f32(1u << params.level);
    let rounding = 1.0e-6 * (params.largest_m + (abs(slope.x) + abs(slope.y)) * side + highest - lowest);
    let index = ground_node(params.level, node);
    height_plane[index] = vec2(middle_m + 0.5 * (lowest + highest), 0.5 * (highest - lowest) + rounding);
    plane_slope[index] = pack2x16float(slope);
}
