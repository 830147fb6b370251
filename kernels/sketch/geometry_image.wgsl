//!include lib/heights.wgsl
//!include lib/sketch.wgsl
// The geometry image (Dachsbacher, Stamminger 2004, sections 3.2 and 3.4): each grid point's place in the square of a sketch map is where it is
// on the ground, Phi(s, t); its height is that of the terrain there, from the pyramid level that fits the cell's extent.

struct Params {
    terrain: Terrain,
    octaves: Octaves,
    /// Columns and rows of grid points.
    grid: vec2<u32>,
    /// Texels along a side of the sketch map.
    texels: u32,
    /// Coarsest level that is sampled.
    max_level: u32,
    /// Octaves less in the mesh than its vertices could hold.
    bias: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> grid_point: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> height_mean: array<f32>;
@group(0) @binding(3) var<storage, read> sketch_square: array<i32>;
@group(0) @binding(4) var<storage, read> sketch_height: array<f32>;
@group(0) @binding(5) var<storage, read_write> vertex: array<vec4<f32>>;

/// Heights are those of the sketch map.
override SKETCH_HEIGHTS: bool = false;

fn place_of_point(at: vec2<u32>) -> vec2<f32> {
    return grid_point[at.y * params.grid.x + at.x];
}

/// Distance to the farthest grid neighbour, in cells.
fn extent(at: vec2<u32>, side: f32) -> f32 {
    let last = params.grid - 1u;
    let here = place_of_point(at);
    let west = place_of_point(vec2(max(at.x, 1u) - 1u, at.y)) - here;
    let east = place_of_point(vec2(min(at.x + 1u, last.x), at.y)) - here;
    let north = place_of_point(vec2(at.x, max(at.y, 1u) - 1u)) - here;
    let south = place_of_point(vec2(at.x, min(at.y + 1u, last.y))) - here;
    return side * max(max(length(west), length(east)), max(length(north), length(south)));
}

fn texel(at: vec2<u32>) -> f32 {
    return sketch_height[at.y * params.texels + at.x];
}

/// Bilinear between the texels of the sketch map; beyond the outermost ones the height stays as it is there.
fn sketch_at(place: vec2<f32>) -> f32 {
    let at = clamp(place * f32(params.texels) - 0.5, vec2(0.0), vec2(f32(params.texels - 1u)));
    let low = min(vec2<u32>(at), vec2(params.texels - 1u));
    let high = min(low + 1u, vec2(params.texels - 1u));
    let four = vec4(texel(low), texel(vec2(high.x, low.y)), texel(vec2(low.x, high.y)), texel(high));
    return ground_on_patch(four, at - vec2<f32>(low));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.grid) {
        return;
    }
    let square = square();
    let side = f32(square.side);
    let place = place_of_point(id.xy);
    let cells = square_start(params.terrain, square) + place * side;
    var reach = 0.0;
    if OCTAVES || !(FINEST || SKETCH_HEIGHTS) {
        reach = extent(id.xy, side);
    }
    var found: vec2<f32>;
    if SKETCH_HEIGHTS {
        found = vec2(sketch_at(place), texel_level(square));
    } else {
        found = height_for(cells, reach);
    }
    found = with_octaves(found, cells, reach);
    let here = world_from_cells(params.terrain, cells);
    vertex[id.y * params.grid.x + id.x] = vec4(here, relative_height(params.terrain, found.x), found.y);
}
