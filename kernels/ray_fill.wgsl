//!include lib/camera.wgsl
//!include lib/terrain.wgsl
//!include lib/pyramid.wgsl
//!include lib/traverse.wgsl
// Exact first hit for the pixels of a list, which replaces what the mesh drew there.

struct Params {
    camera: Camera,
    terrain: Terrain,
    stride: u32,
    tall: u32,
    top: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var height: texture_2d<f32>;
@group(0) @binding(2) var<storage, read> height_max: array<f32>;
@group(0) @binding(3) var<storage, read> height_min: array<f32>;
@group(0) @binding(4) var<storage, read_write> distance: array<f32>;
/// For each tile of pixels, a t that all its rays reach without a hit; FAR if none of them hits anything.
@group(0) @binding(5) var<storage, read> clear_until: array<f32>;
@group(0) @binding(6) var nearest: sampler;
/// Numbers of the pixels.
@group(0) @binding(7) var<storage, read> pixels: array<u32>;
/// Workgroups along x, y, z, and how many pixels there are.
@group(0) @binding(8) var<storage, read> pixels_count: array<u32>;
/// Normalised error of what the mesh drew.
@group(0) @binding(9) var<storage, read> error: array<f32>;

/// The mesh is nowhere under the surface: what it drew in front of a ray, the ray reaches.
override FROM_MESH: bool = false;

/// Pixels a side of a tile.
const TILE: u32 = 8u;

/// Column and row of a pixel. (A division of integers is slow where there are no vectors of them, and what this one in floats may
/// be off by one row is put right.)
fn place_of(index: u32) -> vec2<u32> {
    let width = i32(params.camera.viewport.x);
    var row = i32((f32(index) + 0.5) / f32(width));
    row -= select(0, 1, i32(index) < row * width);
    row += select(0, 1, i32(index) >= (row + 1) * width);
    return vec2<u32>(vec2(i32(index) - row * width, row));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    let every = params.camera.viewport.x * params.camera.viewport.y;
    if at >= min(pixels_count[3], every) {
        return;
    }
    // anybody can make a list
    let index = pixels[at];
    if index >= every {
        return;
    }
    let pixel = place_of(index);
    let direction_m = view_ray_of_pixel(params.camera, pixel);
    let per_t = length(direction_m);
    var clear = 0.0;
    if !UNDERSIDE {
        let tiles = (params.camera.viewport.x + TILE - 1u) / TILE;
        clear = clear_until[(pixel.y / TILE) * tiles + pixel.x / TILE];
        if FROM_MESH {
            if error[index] < 1.0 {
                clear = max(clear, distance[index] / per_t * 0.999998);
            }
        }
    }
    var t = FAR;
    if clear < FAR {
        t = first_hit(direction_m, clear);
    }
    distance[index] = select(t * per_t, NO_SURFACE, t >= FAR);
}
