// What the errors of a geometry image ask for: a map over its square of how densely points would have to lie for the error to be as large as
// is allowed. The frame after this one can take it for importance.

struct Params {
    /// Columns and rows of grid points.
    grid: vec2<u32>,
    /// Texels along a side of the map.
    texels: u32,
    /// One over the power of a cell's side that the error falls with.
    per_order: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
/// Where grid points are in the square of the map.
@group(0) @binding(1) var<storage, read> grid_point: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> vertex: array<vec4<f32>>;
/// 0 up to the allowed error, and then 1 minus its share of the error.
@group(0) @binding(3) var<storage, read> grid_error: array<f32>;
/// The largest of a texel so far: positive floats are ordered like their bits.
@group(0) @binding(4) var<storage, read_write> painted: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> error_demand: array<f32>;
@group(0) @binding(6) var<storage, read> sketch_square: array<i32>;
@group(0) @binding(7) var<storage, read_write> error_square: array<i32>;

/// No density is larger.
const DENSEST: f32 = 1e30;

@compute @workgroup_size(64)
fn begin(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.texels * params.texels {
        atomicStore(&painted[id.x], 0u);
    }
}

/// Points a metre that the error of a cell asks for: as many times those that it has as the error's root is larger than that of what is
/// allowed. Of smaller errors nothing is known, and they ask for as many as there are.
fn asked_for(nw: u32, sw: u32) -> f32 {
    let north = vertex[nw + 1u].xy - vertex[nw].xy;
    let south = vertex[sw + 1u].xy - vertex[sw].xy;
    let west = vertex[sw].xy - vertex[nw].xy;
    let east = vertex[sw + 1u].xy - vertex[nw + 1u].xy;
    let side = max(max(length(north), length(south)), max(length(west), length(east)));
    let error = max(max(grid_error[nw], grid_error[nw + 1u]), max(grid_error[sw], grid_error[sw + 1u]));
    let times = pow(max(1.0 - error, 1e-6), -params.per_order);
    return min(times / max(side, 1.0 / DENSEST), DENSEST);
}

/// Each cell asks in all texels that it may touch.
@compute @workgroup_size(8, 8)
fn paint(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.grid - 1u) {
        return;
    }
    let nw = id.y * params.grid.x + id.x;
    let sw = nw + params.grid.x;
    let north = array(grid_point[nw], grid_point[nw + 1u]);
    let south = array(grid_point[sw], grid_point[sw + 1u]);
    let low = min(min(north[0], north[1]), min(south[0], south[1]));
    let high = max(max(north[0], north[1]), max(south[0], south[1]));
    let last = params.texels - 1u;
    let first = min(vec2<u32>(clamp(low, vec2(0.0), vec2(1.0)) * f32(params.texels)), vec2(last));
    let end = min(vec2<u32>(clamp(high, vec2(0.0), vec2(1.0)) * f32(params.texels)), vec2(last));
    let asked = bitcast<u32>(asked_for(nw, sw));
    for (var y = first.y; y <= end.y; y++) {
        for (var x = first.x; x <= end.x; x++) {
            atomicMax(&painted[y * params.texels + x], asked);
        }
    }
}

@compute @workgroup_size(64)
fn finish(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.texels * params.texels {
        error_demand[id.x] = bitcast<f32>(atomicLoad(&painted[id.x]));
    }
    if id.x == 0u {
        for (var i = 0; i < 4; i++) {
            error_square[i] = sketch_square[i];
        }
    }
}
