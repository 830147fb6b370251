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

/// By how much each triangle of a mesh with a bound is drawn larger, in pixels: more than any rasterizer moves its corners (Vulkan
/// allows it a sixteenth of a pixel as the grid that they are moved to, and SwiftShader has that: half of it), and as much for clipping.
const LARGER_PX: f32 = 0.0625;
/// A ray closer to a side than this part of the lengths that are multiplied is at the triangle's rim: it is beside it or not by rounding.
const RIM: f32 = 9.5e-7;
/// Sides that enclose a smaller angle, in radians, are taken to enclose this: their corner would move beyond what f32 can clip.
const THINNEST: f32 = 1.0e-5;
/// Of three planes' normals, each 1 long in the picture, the triple product that encloses a cone for sure; and what rounding may do to it,
/// as a part of how many pixels the planes are from the middle of the picture.
const LEAST_CONE: f32 = 0.01;
const CONE_ROUNDED: f32 = 1.0e-5;
/// What clipping may add to a corner that it makes, as a part of how far the triangle reaches; and the pixels that are left for it.
const CLIPPED: f32 = 4.0e-7;
const CLIPPED_PX: f32 = 0.03125;
/// No rim is narrower, so that its sign can say something.
const LEAST_RIM: f32 = 1.0e-30;

/// A sample relative to the eye.
fn sample_at(key: u32) -> vec3<f32> {
    let sample = vec2(key & 0xffffu, key >> 16u);
    let ground = world_from_cells(params.terrain, relative_cells(params.terrain, vec2<i32>(sample)));
    return vec3(ground, relative_height(params.terrain, ground_height(sample)));
}

/// A triangle of a list: a corner, and the other two from there. Three vectors, since a rasterizer pays for every one. In w is how wide the
/// rim is along the side opposite to each corner, as a part of the ray's length (see `meet`); negative if on which side of its plane the eye is
/// is not known.
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

/// How a triangle is drawn larger.
struct Larger {
    /// By how much a corner moves, as `pixels_of`.
    by: vec2<f32>,
    /// The eye is so close to the triangle's plane that a larger one would be all around it: it can be anywhere in the picture.
    is_around: bool,
    /// The nearest and the farthest corner along the view direction.
    nearest: f32,
    farthest: f32,
}

/// A corner moves so that both of its sides are further out by `LARGER_PX`. The sides are planes through the eye; the corner is where the
/// planes, moved, meet, in front of the eye or behind it.
fn enlarge(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, which: u32) -> Larger {
    let ab = cross(a, b - a);
    let bc = cross(b, c - b);
    let ca = cross(c, a - c);
    let lengths = vec3(length(ab.xy), length(bc.xy), length(ca.xy));
    let volume = dot(ab, c - a);
    // the moved planes still enclose a cone, which they always do if all of the triangle is in front of the eye
    let out = vec3(0.0, 0.0, sign(volume) * LARGER_PX);
    let p = ab / lengths.x + out;
    let q = bc / lengths.y + out;
    let r = ca / lengths.z + out;
    let is_cone = dot(p, cross(q, r)) > LEAST_CONE + CONE_ROUNDED * (abs(p.z) + abs(q.z) + abs(r.z));
    let nearest = min(a.z, min(b.z, c.z));
    let farthest = max(a.z, max(b.z, c.z));
    // of the corner: the sides to the next one and from the last one
    let is_b = which == 1u;
    let is_c = which == 2u;
    let next_side = select(select(ab, bc, is_b), ca, is_c).xy;
    let last_side = select(select(ca, ab, is_b), bc, is_c).xy;
    let next_length = select(select(lengths.x, lengths.y, is_b), lengths.z, is_c);
    let last_length = select(select(lengths.z, lengths.x, is_b), lengths.y, is_c);
    let shift = next_length * vec2(last_side.y, -last_side.x) - last_length * vec2(next_side.y, -next_side.x);
    let deepest = max(abs(a.z), max(abs(b.z), abs(c.z)));
    let thinnest = max(THINNEST * next_length * last_length / deepest, 1.0e-30);
    return Larger(LARGER_PX * shift / max(abs(volume), thinnest), nearest <= 0.0 && !is_cone, nearest, farthest);
}

@vertex
fn draw(@builtin(vertex_index) index: u32) -> Listed {
    let keys = triangle[index / 3u];
    let a = sample_at(keys.x);
    let b = sample_at(keys.y);
    let c = sample_at(keys.z);
    let which = index % 3u;
    // triangles that share a corner have the same bits there
    let world = select(select(a, b, which == 1u), c, which == 2u);
    let view = vec3(dot(params.view.right, world), dot(params.view.up, world), dot(params.view.forward, world));
    var position = vec4(view.xy / params.view.half_tan, params.near_m, view.z);
    var rim = vec3(0.0);
    if PROVEN {
        let larger = enlarge(pixels_of(a), pixels_of(b), pixels_of(c), which);
        let moved = vec4((view.xy + larger.by / params.view.focal_px) / params.view.half_tan, params.near_m, view.z);
        // on which side of the triangle an eye in its plane is, and with it what is inside, is not known
        let squares = vec3(dot(a, a), dot(b, b), dot(c, c));
        let normal = cross(b - a, c - a);
        let reach = sqrt(max(squares.x, max(squares.y, squares.z)));
        let beside_plane = abs(dot(normal, a)) / length(normal);
        let is_known = !larger.is_around && beside_plane > RIM * reach;
        let nearest = max(larger.nearest, beside_plane / params.view.ray_most);
        let is_anywhere = larger.is_around || params.view.focal_px * CLIPPED * reach > CLIPPED_PX * nearest;
        // all of the picture, where the ray decides
        let everywhere = vec4(select(-1.0, 3.0, which == 1u), select(-1.0, 3.0, which == 2u), 0.5, 1.0);
        position = select(moved, everywhere, is_anywhere && larger.farthest > 0.0);
        let sides = vec3(dot(c - b, c - b), dot(a - c, a - c), dot(b - a, b - a));
        rim = select(-1.0, 1.0, is_known) * max(RIM * sqrt(squares.yzx * sides), vec3(LEAST_RIM));
    }
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
    let weights = select(-1.0, 1.0, volume >= 0.0) * vec3(dot(ray, cross(a + to_b, to_c - to_b)), -dot(ray, cross(a, to_c)), dot(ray, cross(a, to_b)));
    let depth = dot(params.view.forward, a);
    let depths = vec3(depth, depth + dot(params.view.forward, to_b), depth + dot(params.view.forward, to_c));
    let nearest = max(min(depths.x, min(depths.y, depths.z)), 0.0);
    let farthest = max(depths.x, max(depths.y, depths.z));
    let met = volume / dot(normal, ray);
    if PROVEN {
        let is_known = drawn.a.w > 0.0;
        let rim = length(ray) * abs(vec3(drawn.a.w, drawn.to_b.w, drawn.to_c.w));
        let beside = !(is_known && all(weights > rim));
        // seen from the other side, everything has the other sign
        let outside = any(weights < -rim) && (is_known || any(weights > rim));
        return Met(clamp(select(met, nearest, beside), nearest, farthest), beside, outside);
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
