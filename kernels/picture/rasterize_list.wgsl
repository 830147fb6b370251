//!include lib/camera.wgsl
//!include lib/terrain.wgsl
//!include lib/view.wgsl
//!include ground
//!include lib/beside.wgsl
// A list of triangles between samples to the pixels it covers. Each fragment intersects its pixel's ray with the plane of its triangle,
// whose corners come with the first vertex and are not interpolated, so distances do not depend on how a GPU interpolates.
//
// A rasterizer moves corners to a grid of its own, and a near triangle can lose a pixel at its silhouette by that. What is behind it can be
// anything. A mesh with a bound is therefore drawn a little larger than it is, and the ray decides which pixels are a triangle's.

struct Params {
    camera: Camera,
    terrain: Terrain,
    view: View,
    near_m: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
/// Three samples, column and row in 16 bits each, counterclockwise from above.
@group(0) @binding(1) var<storage, read> triangle: array<vec4<u32>>;

/// The mesh has a proven bound.
override PROVEN: bool = false;

/// By how much each triangle of a mesh with a bound is drawn larger, in pixels: more than a rasterizer moves its corners.
const LARGER_PX: f32 = 0.015625;
/// A ray closer to a side than this part of the lengths that are multiplied is at the triangle's rim: it is beside it or not by rounding.
const RIM: f32 = 9.5e-7;
/// A triangle whose sides enclose a smaller angle, in radians, has no inside that a ray could tell.
const THINNEST: f32 = 1.0e-6;

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

/// Along the picture's axes, relative to the eye: pixels at a distance of 1, pixels at a distance of 1, and metres.
fn pixels_of(point: vec3<f32>) -> vec3<f32> {
    return vec3(params.view.focal_px * vec2(dot(params.view.right, point), dot(params.view.up, point)),
                dot(params.view.forward, point));
}

/// By how much a corner has to move so that both of its sides are further out by `LARGER_PX`, as `pixels_of`. Its sides are planes through
/// the eye; the corner is where the planes, moved, meet, in front of the eye or behind it.
fn larger_by(corner: vec3<f32>, to_next: vec3<f32>, to_last: vec3<f32>) -> vec2<f32> {
    let next_side = cross(corner, to_next);
    let last_side = cross(to_last, corner);
    let next_length = length(next_side.xy);
    let last_length = length(last_side.xy);
    let volume = abs(dot(next_side, to_last));
    let depth = max(abs(corner.z), max(abs(corner.z + to_next.z), abs(corner.z + to_last.z)));
    let shift = next_length * vec2(last_side.y, -last_side.x) - last_length * vec2(next_side.y, -next_side.x);
    let is_thin = volume * depth <= THINNEST * next_length * last_length;
    return select(LARGER_PX * shift / volume, vec2(0.0), is_thin);
}

@vertex
fn draw(@builtin(vertex_index) index: u32) -> Listed {
    let keys = triangle[index / 3u];
    // the same computation for each corner, so that triangles that share one have the same bits there
    let world = sample_at(keys[index % 3u]);
    var view = vec3(dot(params.view.right, world), dot(params.view.up, world), dot(params.view.forward, world));
    let a = sample_at(keys.x);
    if PROVEN {
        let next = sample_at(keys[(index + 1u) % 3u]) - world;
        let last = sample_at(keys[(index + 2u) % 3u]) - world;
        let larger = larger_by(pixels_of(world), pixels_of(next), pixels_of(last)) / params.view.focal_px;
        view += vec3(larger, 0.0);
    }
    return Listed(vec4(view.xy / params.view.half_tan, params.near_m, view.z), a, sample_at(keys.y) - a, sample_at(keys.z) - a);
}

/// Where a pixel's ray meets a triangle that was drawn there.
struct Met {
    t: f32,
    /// The ray passes beside it, or so close to its rim that rounding decides. The triangle's plane, seen edge-on, is met anywhere
    /// then, and what counts is the nearest point of the rim; of a mesh with a bound its nearest corner, since such a pixel is cast.
    beside: bool,
    /// It passes beside it whatever is rounded.
    outside: bool,
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
    var rim = select(nearest, dot(inside, depths) / sum, sum > 0.0);
    var slack = vec3(0.0);
    if PROVEN {
        rim = nearest;
        let b = drawn.a + drawn.to_b;
        let c = drawn.a + drawn.to_c;
        slack = RIM * length(ray) * vec3(length(b) * length(drawn.to_c - drawn.to_b), length(c) * length(drawn.to_c),
                                              length(drawn.a) * length(drawn.to_b));
    }
    let beside = !all(weights > slack);
    let t = select(volume / dot(normal, ray), rim, beside);
    return Met(clamp(t, nearest, max(depths.x, max(depths.y, depths.z))), beside, any(weights < -slack));
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
    if PROVEN && met.outside {
        discard;
    }
    let beside = select(0u, BESIDE, met.beside);
    return Fragment(bitcast<u32>(met.t * length(ray)) | beside, min(params.near_m / met.t, 1.0));
}
