//!include lib/camera.wgsl
//!include lib/terrain.wgsl
//!include lib/view.wgsl
//!include ground
//!include lib/beside.wgsl
// A list of triangles between samples to the pixels it covers. Each fragment intersects its pixel's ray with the plane of its triangle,
// whose corners come with the first vertex and are not interpolated, so distances do not depend on how a GPU interpolates.

struct Params {
    camera: Camera,
    terrain: Terrain,
    view: View,
    near_m: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
/// Three samples, column and row in 16 bits each, counterclockwise from above.
@group(0) @binding(1) var<storage, read> triangle: array<vec4<u32>>;

/// A sample relative to the eye.
fn sample_at(key: u32) -> vec3<f32> {
    let sample = vec2(key & 0xffffu, key >> 16u);
    let ground = world_from_cells(params.terrain, relative_cells(params.terrain, vec2<i32>(sample)));
    return vec3(ground, relative_height(params.terrain, ground_height(sample)));
}

/// A triangle of a list: a corner, and the other two from there.
struct Listed {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat, first) a: vec3<f32>,
    @location(1) @interpolate(flat, first) to_b: vec3<f32>,
    @location(2) @interpolate(flat, first) to_c: vec3<f32>,
}

@vertex
fn draw(@builtin(vertex_index) index: u32) -> Listed {
    let keys = triangle[index / 3u];
    // the same computation for each corner, so that triangles that share one have the same bits there
    let world = sample_at(keys[index % 3u]);
    let view = vec3(dot(params.view.right, world), dot(params.view.up, world), dot(params.view.forward, world));
    let a = sample_at(keys.x);
    return Listed(vec4(view.xy / params.view.half_tan, params.near_m, view.z), a, sample_at(keys.y) - a, sample_at(keys.z) - a);
}

/// Where a pixel's ray meets a triangle that was drawn there.
struct Met {
    t: f32,
    /// A rasterizer moves corners to a grid, so the ray can pass just beside. The triangle's plane, seen edge-on, is met anywhere
    /// then, and what counts is the nearest point of the rim.
    beside: bool,
}

fn meet(ray: vec3<f32>, drawn: Listed) -> Met {
    let normal = cross(drawn.to_b, drawn.to_c);
    let volume = dot(normal, drawn.a);
    // which side of the planes through the eye and an edge the ray is on: weights of the corners a, b, c
    let weights = sign(volume) * vec3(dot(ray, cross(drawn.a + drawn.to_b, drawn.to_c - drawn.to_b)),
                                      -dot(ray, cross(drawn.a, drawn.to_c)), dot(ray, cross(drawn.a, drawn.to_b)));
    let a = dot(params.view.forward, drawn.a);
    let depths = vec3(a, a + dot(params.view.forward, drawn.to_b), a + dot(params.view.forward, drawn.to_c));
    let nearest = max(min(depths.x, min(depths.y, depths.z)), 0.0);
    let inside = max(weights, vec3(0.0));
    let sum = inside.x + inside.y + inside.z;
    let rim = select(nearest, dot(inside, depths) / sum, sum > 0.0);
    let beside = !all(weights > vec3(0.0));
    let t = select(volume / dot(normal, ray), rim, beside);
    return Met(clamp(t, nearest, max(depths.x, max(depths.y, depths.z))), beside);
}

struct Fragment {
    @location(0) distance: u32,
    @builtin(frag_depth) depth: f32,
}

/// The mesh ends at the terrain's border by itself. Triangles that are seen edge-on are thinner than the grid that corners are moved
/// to: a rasterizer's own depth can be far behind all of their corners there, and what is behind the triangle would be seen.
@fragment
fn keep(drawn: Listed) -> Fragment {
    let ray = view_ray_of_pixel(params.camera, vec2<u32>(drawn.position.xy));
    let met = meet(ray, drawn);
    let beside = select(0u, BESIDE, met.beside);
    return Fragment(bitcast<u32>(met.t * length(ray)) | beside, min(params.near_m / met.t, 1.0));
}
