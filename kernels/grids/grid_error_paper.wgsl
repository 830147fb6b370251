//!include lib/terrain.wgsl
//!include ground
// The error of a projected grid as the paper estimates it: at each grid point, from the heights around (Loeffler et al. 2009, Eq. 2 to 4).

struct Params {
    terrain: Terrain,
    /// Columns and rows of grid points.
    grid: vec2<u32>,
    threshold_px: f32,
    /// Pixels a radian of the field of view (Eq. 3).
    lambda: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
/// x, y, z in metres from the eye; w: pyramid level.
@group(0) @binding(1) var<storage, read> vertex: array<vec4<f32>>;
/// x, y, z in metres from the eye; w: normalised error.
@group(0) @binding(2) var<storage, read_write> moved: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> grid_error: array<f32>;

/// What is over its threshold is raised to the maximum.
override RAISED: bool = true;
override WRITE_ERROR: bool = true;

fn low_and_high(level: u32, at: vec2<i32>) -> vec2<f32> {
    if level == 0u {
        return vec2(ground_height(vec2<u32>(at)));
    }
    let index = ground_node(level, vec2<u32>(at));
    return vec2(ground_lowest(index), ground_highest(index));
}

/// Minimum and maximum around a place, fetched like the mean: bilinear in a level.
fn range_at(level: u32, cells: vec2<f32>) -> vec2<f32> {
    let base = vec2<i32>(params.terrain.size) - 1;
    let last = select(vec2<i32>(level_size(vec2<u32>(base), level)) - 1, base, level == 0u);
    let whole = cell_of(params.terrain, cells);
    let fraction = cells - (vec2<f32>(whole - params.terrain.eye_cell) - params.terrain.eye_fraction);
    let middle = select(0.5 * f32(1u << level), 0.0, level == 0u);
    let nodes = around(level, whole, fraction, middle, last);
    let nw = low_and_high(level, nodes.low);
    let ne = low_and_high(level, vec2(nodes.high.x, nodes.low.y));
    let sw = low_and_high(level, vec2(nodes.low.x, nodes.high.y));
    let se = low_and_high(level, nodes.high);
    return mix(mix(nw, ne, nodes.w.x), mix(sw, se, nodes.w.x), nodes.w.y);
}

/// Loeffler et al. 2009, Eq. 2 to 4, and the displacement by the maximum.
@compute @workgroup_size(8, 8)
fn paper(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.grid) {
        return;
    }
    let index = id.y * params.grid.x + id.x;
    let point = vertex[index];
    let origin = vec2<f32>(params.terrain.eye_cell) + params.terrain.eye_fraction;
    let last = vec2<f32>(params.terrain.size - 1u);
    let cells = clamp(cells_from_world(params.terrain, point.xy), -origin, last - origin);
    let level = clamp(point.w, 0.0, f32(GROUND_CELLS_TOP));
    let finer = min(u32(level), GROUND_CELLS_TOP);
    var range_m = range_at(finer, cells);
    range_m = mix(range_m, range_at(min(finer + 1u, GROUND_CELLS_TOP), cells), level - f32(finer));
    let low = relative_height(params.terrain, range_m.x);
    let high = relative_height(params.terrain, range_m.y);
    let delta_m = max(max(high - point.z, point.z - low), 0.0);
    let rho_px = params.lambda * delta_m / max(length(point.xyz), 1e-6);
    let is_over = rho_px >= params.threshold_px;
    let error = select(0.0, 1.0 - params.threshold_px / rho_px, is_over);
    if RAISED {
        moved[index] = vec4(point.xy, select(point.z, high, rho_px > params.threshold_px), error);
    }
    if WRITE_ERROR {
        grid_error[index] = error;
    }
}
