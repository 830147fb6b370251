//!include lib/terrain.wgsl
//!include ground
//!include lib/projector.wgsl
// Grid points to terrain vertices: ray to the base plane (Livny et al. 2008, Eq. 1), height from the mean
// pyramid at the level that fits the cell's extent (their Eq. 6; Loeffler et al. 2009, Eq. 1).

struct Params {
    terrain: Terrain,
    /// Columns and rows of grid points.
    grid: vec2<u32>,
    projector: Projector,
    /// Coarsest level that is sampled.
    max_level: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> grid_point: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> height_mean: array<f32>;
@group(0) @binding(3) var<storage, read_write> vertex: array<vec4<f32>>;

/// Sample the finest level only.
override FINEST: bool = false;
/// Blend the two levels around the wanted one instead of taking the finer.
override BLEND: bool = true;

fn ground_of(at: vec2<u32>) -> vec2<f32> {
    return ground(params.projector, grid_point[at.y * params.grid.x + at.x]);
}

fn sample(level: u32, at: vec2<i32>) -> f32 {
    if level == 0u {
        return ground_height(vec2<u32>(at));
    }
    return height_mean[pyramid_index(ground_means(), level, vec2<u32>(at))];
}

/// The surface at level 0, bilinear between the nodes of the others; `cells` are relative sample coordinates. A node stands in the middle
/// of its samples; beyond the outermost nodes the height stays as it is there.
fn height_at(level: u32, cells: vec2<f32>) -> f32 {
    let last = vec2<i32>(level_size(params.terrain.size, level)) - 1;
    let whole = vec2<i32>(floor(cells + params.terrain.eye_fraction));
    let fraction = cells + params.terrain.eye_fraction - vec2<f32>(whole);
    let nodes = around(level, whole + params.terrain.eye_cell, fraction, 0.5 * (f32(1u << level) - 1.0), last);
    let w = nodes.w;
    let nw = sample(level, nodes.low);
    let ne = sample(level, vec2(nodes.high.x, nodes.low.y));
    let sw = sample(level, vec2(nodes.low.x, nodes.high.y));
    let se = sample(level, nodes.high);
    let four = vec4(nw, ne, sw, se);
    if level == 0u {
        return ground_surface(four, w);
    }
    return ground_on_patch(four, w);
}

/// Distance to the farthest grid neighbour on the base plane, in cells.
fn extent(at: vec2<u32>, here: vec2<f32>) -> f32 {
    let last = params.grid - 1u;
    var farthest = 0.0;
    let neighbours = array(
        vec2(at.x - min(at.x, 1u), at.y),
        vec2(min(at.x + 1u, last.x), at.y),
        vec2(at.x, at.y - min(at.y, 1u)),
        vec2(at.x, min(at.y + 1u, last.y)),
    );
    for (var i = 0; i < 4; i++) {
        let step = cells_from_world(params.terrain, ground_of(neighbours[i]) - here);
        farthest = max(farthest, length(step));
    }
    return farthest;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.grid) {
        return;
    }
    let here = ground_of(id.xy);
    // far outside the terrain the height of its border serves; the clamp keeps the integers in range
    let origin = vec2<f32>(params.terrain.eye_cell) + params.terrain.eye_fraction;
    let cells = clamp(cells_from_world(params.terrain, here), -origin, vec2<f32>(params.terrain.size - 1u) - origin);
    var level = 0.0;
    var height_m: f32;
    if FINEST {
        height_m = height_at(0u, cells);
    } else {
        level = clamp(log2(max(extent(id.xy, here), 1.0)), 0.0, f32(params.max_level));
        let finer = min(u32(level), params.max_level);
        height_m = height_at(finer, cells);
        if BLEND {
            let coarser = min(finer + 1u, params.max_level);
            height_m = mix(height_m, height_at(coarser, cells), level - f32(finer));
        }
    }
    vertex[id.y * params.grid.x + id.x] = vec4(here, relative_height(params.terrain, height_m), level);
}
