//!include lib/heights.wgsl
//!include lib/projector.wgsl
// Grid points to terrain vertices: ray to the base plane (Livny et al. 2008, Eq. 1), height from the mean
// pyramid at the level that fits the cell's extent (their Eq. 6; Loeffler et al. 2009, Eq. 1).

struct Params {
    terrain: Terrain,
    octaves: Octaves,
    /// Columns and rows of grid points.
    grid: vec2<u32>,
    projector: Projector,
    /// Coarsest level that is sampled.
    max_level: u32,
    /// Octaves less in the mesh than its vertices could hold.
    bias: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> grid_point: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> height_mean: array<f32>;
@group(0) @binding(3) var<storage, read_write> vertex: array<vec4<f32>>;

fn ground_of(at: vec2<u32>) -> vec2<f32> {
    return ground(params.projector, grid_point[at.y * params.grid.x + at.x]);
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
    var reach = 0.0;
    if !FINEST || OCTAVES {
        reach = extent(id.xy, here);
    }
    let cells = cells_from_world(params.terrain, here);
    let found = with_octaves(height_for(cells, reach), cells, reach);
    vertex[id.y * params.grid.x + id.x] = vec4(here, relative_height(params.terrain, found.x), found.y);
}
