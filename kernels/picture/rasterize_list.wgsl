//!include lib/camera.wgsl
//!include lib/terrain.wgsl
//!include lib/view.wgsl
//!include ground
//!include lib/beside.wgsl
// A list of triangles between samples to the pixels it covers. Each fragment intersects its pixel's ray with the plane of its triangle,
// which comes with the first vertex and is not interpolated, so distances do not depend on how a GPU interpolates.
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

/// A triangle of a list, as the planes that decide what a ray from the eye meets. Next to its side opposite to a corner, `ray . xyz` is the
/// weight of that corner, positive inside, and at the triangle's rim if it is not more than w times the ray's length.
struct Listed {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat, first) side_a: vec4<f32>,
    @location(1) @interpolate(flat, first) side_b: vec4<f32>,
    @location(2) @interpolate(flat, first) side_c: vec4<f32>,
    /// Its own plane: normal, and the normal times a corner.
    @location(3) @interpolate(flat, first) plane: vec4<f32>,
    /// Of its corners, along the view direction.
    @location(4) @interpolate(flat, first) depths: vec3<f32>,
}

/// Along the picture's axes, relative to the eye: pixels at a distance of 1, pixels at a distance of 1, and metres.
fn pixels_of(point: vec3<f32>) -> vec3<f32> {
    return vec3(params.view.focal_px * vec2(dot(params.view.right, point), dot(params.view.up, point)),
                dot(params.view.forward, point));
}

struct Larger {
    /// By how much a corner moves, as `pixels_of`.
    by: vec2<f32>,
    /// The eye is so close to the triangle's plane that a larger one would be all around it: then it stays as it is.
    is_around: bool,
}

/// A corner moves so that both of its sides are further out by `LARGER_PX`. The sides are planes through the eye; the corner is where the
/// planes, moved, meet, in front of the eye or behind it.
fn larger_by(corner: vec3<f32>, to_next: vec3<f32>, to_last: vec3<f32>) -> Larger {
    let next_side = cross(corner, to_next);
    let last_side = cross(to_last, corner);
    let next_length = length(next_side.xy);
    let last_length = length(last_side.xy);
    let volume = dot(next_side, to_last);
    let depths = vec3(corner.z, corner.z + to_next.z, corner.z + to_last.z);
    let deepest = max(abs(depths.x), max(abs(depths.y), abs(depths.z)));
    let shift = next_length * vec2(last_side.y, -last_side.x) - last_length * vec2(next_side.y, -next_side.x);
    let thinnest = max(THINNEST * next_length * last_length / deepest, 1.0e-30);
    // the moved planes still enclose a cone, which they always do if all of it is in front of the eye
    let far_side = cross(corner + to_next, to_last - to_next);
    let out = vec3(0.0, 0.0, sign(volume) * LARGER_PX);
    let next_out = next_side / next_length + out;
    let last_out = last_side / last_length + out;
    let far_out = far_side / length(far_side.xy) + out;
    let is_around = !all(depths > vec3(0.0)) && !(sign(volume) * dot(next_out, cross(far_out, last_out)) > LEAST_CONE);
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
    var is_around = false;
    if PROVEN {
        let next = select(select(a, c, which == vec3(1u)), b, which == vec3(0u));
        let last = select(select(b, a, which == vec3(1u)), c, which == vec3(0u));
        let larger = larger_by(pixels_of(world), pixels_of(next - world), pixels_of(last - world));
        view += vec3(larger.by / params.view.focal_px, 0.0);
        is_around = larger.is_around;
    }
    let plane = plane_of(a, b - a, c - a);
    let depths = vec3(dot(params.view.forward, a), dot(params.view.forward, b), dot(params.view.forward, c));
    // on which side of the triangle an eye in its plane is, and with it what is inside, is not known
    let reach = max(length(a), max(length(b), length(c)));
    let is_known = !is_around && abs(plane.w) > RIM * length(plane.xyz) * reach;
    return Listed(vec4(view.xy / params.view.half_tan, params.near_m, view.z), side_of(b, c - b, plane.w, is_known),
                  side_of(c, a - c, plane.w, is_known), side_of(a, b - a, plane.w, is_known), plane, depths);
}

fn plane_of(a: vec3<f32>, to_b: vec3<f32>, to_c: vec3<f32>) -> vec4<f32> {
    let normal = cross(to_b, to_c);
    return vec4(normal, dot(normal, a));
}

/// The plane through the eye and a side.
fn side_of(corner: vec3<f32>, to_next: vec3<f32>, volume: f32, is_known: bool) -> vec4<f32> {
    let rim = select(ALL, RIM * length(corner) * length(to_next), is_known);
    return vec4(sign(volume) * cross(corner, to_next), rim);
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
    let weights = vec3(dot(ray, drawn.side_a.xyz), dot(ray, drawn.side_b.xyz), dot(ray, drawn.side_c.xyz));
    let depths = drawn.depths;
    let nearest = max(min(depths.x, min(depths.y, depths.z)), 0.0);
    let farthest = max(depths.x, max(depths.y, depths.z));
    let met = drawn.plane.w / dot(drawn.plane.xyz, ray);
    if PROVEN {
        let rim = length(ray) * vec3(drawn.side_a.w, drawn.side_b.w, drawn.side_c.w);
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
