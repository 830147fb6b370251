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

/// By how much each triangle of a mesh with a bound is drawn larger, in pixels: more than any rasterizer moves its corners
/// (Vulkan allows it a sixteenth of a pixel as the grid that they are moved to, and SwiftShader has that).
const LARGER_PX: f32 = 0.0625;
/// A ray closer to a side than this part of the lengths that are multiplied is at the triangle's rim: it is beside it or not by rounding.
const RIM: f32 = 9.5e-7;
/// Sides that enclose a smaller angle, in radians, are taken to enclose this: their corner would move beyond what f32 can clip.
const THINNEST: f32 = 1.0e-5;
/// Of three planes' normals, each 1 long in the picture, the triple product that encloses a cone for sure.
const LEAST_CONE: f32 = 0.01;
/// The rim of a triangle in whose plane the eye is, as far as rounding can tell: all of its pixels are at it.
const ALL: f32 = 1.0e30;

/// A sample relative to the eye.
fn sample_at(key: u32) -> vec3<f32> {
    let sample = vec2(key & 0xffffu, key >> 16u);
    let ground = world_from_cells(params.terrain, relative_cells(params.terrain, vec2<i32>(sample)));
    return vec3(ground, relative_height(params.terrain, ground_height(sample)));
}

/// A triangle of a list: a corner, and the other two from there. Three vectors, since a rasterizer pays for every one. In w is how wide the
/// rim is along the side opposite to each corner, as a part of the ray's length; see `meet`.
struct Listed {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat, first) a: vec4<f32>,
    @location(1) @interpolate(flat, first) to_b: vec4<f32>,
    @location(2) @interpolate(flat, first) to_c: vec4<f32>,
}

/// Along the picture's axes, relative to the eye: pixels at a distance of 1, pixels at a distance of 1, and metres.
fn pixels_of(point: vec3<f32>) -> vec3<f32> {
    return vec3(params.view.focal_px * vec2(dot(params.view.right, point), dot(params.view.up, point)),
                dot(params.view.forward, point));
}

/// How a triangle is drawn larger, seen from one of its corners.
struct Larger {
    /// By how much the corner moves, as `pixels_of`.
    by: vec2<f32>,
    /// The eye is so close to the triangle's plane that a larger one would be all around it: then it stays as it is.
    is_around: bool,
}

/// A corner moves so that both of its sides are further out by `LARGER_PX`. The sides are planes through the eye; the corner is where the
/// planes, moved, meet, in front of the eye or behind it.
fn larger_from(corner: vec3<f32>, to_next: vec3<f32>, to_last: vec3<f32>) -> Larger {
    let next_side = cross(corner, to_next);
    let last_side = cross(to_last, corner);
    let far_side = cross(corner + to_next, to_last - to_next);
    let next_length = length(next_side.xy);
    let last_length = length(last_side.xy);
    let volume = dot(next_side, to_last);
    let depths = vec3(corner.z, corner.z + to_next.z, corner.z + to_last.z);
    let deepest = max(abs(depths.x), max(abs(depths.y), abs(depths.z)));
    let shift = next_length * vec2(last_side.y, -last_side.x) - last_length * vec2(next_side.y, -next_side.x);
    let thinnest = max(THINNEST * next_length * last_length / deepest, 1.0e-30);
    // the moved planes still enclose a cone, which they always do if all of it is in front of the eye
    let out = vec3(0.0, 0.0, sign(volume) * LARGER_PX);
    let cone = dot(next_side / next_length + out, cross(far_side / length(far_side.xy) + out, last_side / last_length + out));
    let is_around = min(depths.x, min(depths.y, depths.z)) <= 0.0 && !(sign(volume) * cone > LEAST_CONE);
    return Larger(select(LARGER_PX * shift / max(abs(volume), thinnest), vec2(0.0), is_around), is_around);
}

@vertex
fn draw(@builtin(vertex_index) index: u32) -> Listed {
    let keys = triangle[index / 3u];
    let a = sample_at(keys.x);
    let b = sample_at(keys.y);
    let c = sample_at(keys.z);
    let which = vec3(index % 3u);
    // triangles that share a corner have the same bits there
    let world = select(select(c, b, which == vec3(1u)), a, which == vec3(0u));
    var view = vec3(dot(params.view.right, world), dot(params.view.up, world), dot(params.view.forward, world));
    var rim = vec3(0.0);
    if PROVEN {
        let next = select(select(a, c, which == vec3(1u)), b, which == vec3(0u)) - world;
        let last = select(select(b, a, which == vec3(1u)), c, which == vec3(0u)) - world;
        let larger = larger_from(pixels_of(world), pixels_of(next), pixels_of(last));
        view += vec3(larger.by / params.view.focal_px, 0.0);
        // on which side of the triangle an eye in its plane is, and with it what is inside, is not known
        let squares = vec3(dot(a, a), dot(b, b), dot(c, c));
        let normal = cross(next, last);
        let reach = sqrt(max(squares.x, max(squares.y, squares.z)));
        let is_known = !larger.is_around && abs(dot(normal, world)) > RIM * length(normal) * reach;
        let sides = vec3(dot(c - b, c - b), dot(a - c, a - c), dot(b - a, b - a));
        rim = select(vec3(ALL), RIM * sqrt(squares.yzx * sides), is_known);
    }
    let position = vec4(view.xy / params.view.half_tan, params.near_m, view.z);
    return Listed(position, vec4(a, rim.x), vec4(b - a, rim.y), vec4(c - a, rim.z));
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
    let a = drawn.a.xyz;
    let to_b = drawn.to_b.xyz;
    let to_c = drawn.to_c.xyz;
    let normal = cross(to_b, to_c);
    let volume = dot(normal, a);
    // which side of the planes through the eye and an edge the ray is on: weights of the corners a, b, c
    let weights = sign(volume) * vec3(dot(ray, cross(a + to_b, to_c - to_b)), -dot(ray, cross(a, to_c)), dot(ray, cross(a, to_b)));
    let depth = dot(params.view.forward, a);
    let depths = vec3(depth, depth + dot(params.view.forward, to_b), depth + dot(params.view.forward, to_c));
    let nearest = max(min(depths.x, min(depths.y, depths.z)), 0.0);
    let farthest = max(depths.x, max(depths.y, depths.z));
    let met = volume / dot(normal, ray);
    if PROVEN {
        let rim = length(ray) * vec3(drawn.a.w, drawn.to_b.w, drawn.to_c.w);
        let beside = !all(weights > rim);
        return Met(clamp(select(met, nearest, beside), nearest, farthest), beside, any(weights < -rim));
    }
    let inside = max(weights, vec3(0.0));
    let sum = inside.x + inside.y + inside.z;
    let rim = select(nearest, dot(inside, depths) / sum, sum > 0.0);
    let beside = !all(weights > vec3(0.0));
    return Met(clamp(select(met, rim, beside), nearest, farthest), beside, false);
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
    // nothing is farther than the depth 0, so that what is there stays there
    let depth = select(min(params.near_m / met.t, 1.0), 0.0, met.outside);
    return Fragment(bitcast<u32>(met.t * length(ray)) | beside, depth);
}
