//!include ground
//!include lib/view.wgsl
// What becomes of a block of the quadtree: out of the picture, fine enough, or to be split (Lee, Shin 2011, Eq. 2).
//
// A kernel that includes this binds `roughness`, and has `terrain: Terrain`, `view: View` and `threshold_px` in its parameters.

/// The roughness is a bound, and the decision keeps it.
override PROVEN: bool = false;
override CULL: bool = true;

const CULLED: u32 = 0u;
const LEAF: u32 = 1u;
const SPLIT: u32 = 2u;

/// An error in pixels that rounding may add to a proven bound.
const SLACK_PX: f32 = 0.02;

fn last_sample() -> vec2<u32> {
    return params.terrain.size - 1u;
}

fn index_of(level: u32, at: vec2<u32>) -> u32 {
    return ground_node(level, at);
}

struct Box {
    low: vec3<f32>,
    high: vec3<f32>,
}

/// A block's extent relative to the eye.
fn box_of(level: u32, at: vec2<u32>, index: u32) -> Box {
    let block = block_of(level, at, last_sample());
    let a = world_from_cells(params.terrain, relative_cells(params.terrain, vec2<i32>(block.low)));
    let b = world_from_cells(params.terrain, relative_cells(params.terrain, vec2<i32>(block.high)));
    // rows run south
    return Box(vec3(a.x, b.y, relative_height(params.terrain, ground_lowest(index))),
               vec3(b.x, a.y, relative_height(params.terrain, ground_highest(index))));
}

/// The largest of `n . p` over a box, by a little more than rounding can take from it.
fn farthest_along(n: vec3<f32>, box: Box) -> f32 {
    let far = max(n * box.low, n * box.high);
    let reach = abs(far);
    return far.x + far.y + far.z + 1.0e-6 * (reach.x + reach.y + reach.z);
}

/// How far a box reaches into the picture, by the side that it reaches over least; negative outside.
fn reach_inside(box: Box) -> f32 {
    let sides = min(min(farthest_along(params.view.side_left, box), farthest_along(params.view.side_right, box)),
                    min(farthest_along(params.view.side_top, box), farthest_along(params.view.side_bottom, box)));
    return min(sides, farthest_along(params.view.forward, box));
}

fn is_visible(box: Box) -> bool {
    if !CULL {
        return true;
    }
    return reach_inside(box) >= 0.0;
}

/// What a proven bound allows when rounding has had its part.
fn allowed_px() -> f32 {
    return max(params.threshold_px - SLACK_PX, 0.5 * params.threshold_px);
}

/// Pixels between a point and the one `rise_m` above it. What is behind the eye counts as if it were in front.
fn error_px(point: vec3<f32>, rise_m: f32) -> f32 {
    let p = vec3(dot(params.view.right, point), dot(params.view.up, point), dot(params.view.forward, point));
    let up = vec3(params.view.right.z, params.view.up.z, params.view.forward.z);
    let moved = length(p.xy * up.z - up.xy * p.z) * rise_m;
    return params.view.focal_px * moved / abs(p.z * (p.z + rise_m * up.z));
}

fn point_at(sample: vec2<u32>) -> vec3<f32> {
    let ground = world_from_cells(params.terrain, relative_cells(params.terrain, vec2<i32>(sample)));
    return vec3(ground, relative_height(params.terrain, ground_height(sample)));
}

/// A block's five points: its centre and the middles of its edges.
fn five_points(level: u32, at: vec2<u32>) -> array<vec3<f32>, 5> {
    let block = block_of(level, at, last_sample());
    return array<vec3<f32>, 5>(point_at(block.middle), point_at(vec2(block.middle.x, block.low.y)),
                               point_at(vec2(block.middle.x, block.high.y)), point_at(vec2(block.low.x, block.middle.y)),
                               point_at(vec2(block.high.x, block.middle.y)));
}

fn most_error_px(points: array<vec3<f32>, 5>, rise_m: f32) -> f32 {
    let a = max(error_px(points[0], rise_m), error_px(points[1], rise_m));
    let b = max(error_px(points[2], rise_m), error_px(points[3], rise_m));
    return max(max(a, b), error_px(points[4], rise_m));
}

fn is_in_sphere(box: Box) -> bool {
    let centre = 0.5 * (box.low + box.high);
    let half = box.high - centre;
    return dot(centre, centre) < dot(half, half);
}

/// Eq. 2: inside the block's sphere, or with an error of at least the threshold at one of its five points.
fn is_rough(level: u32, at: vec2<u32>, box: Box, rise_m: f32) -> bool {
    return is_in_sphere(box) || most_error_px(five_points(level, at), rise_m) >= params.threshold_px;
}

/// Whether a point of the block that is in the picture can be off by the threshold: no such point is nearer, along the view
/// direction, than the nearest corner of the box, nor than the box is from the eye, seen along the longest ray.
fn may_break(box: Box, rise_m: f32) -> bool {
    let near = min(params.view.forward * box.low, params.view.forward * box.high);
    let beside = max(max(box.low, -box.high), vec3(0.0));
    let depth = max(near.x + near.y + near.z, length(beside) / params.view.ray_most) * (1.0 - 1.0e-5);
    let room = depth - rise_m * abs(params.view.forward.z);
    return room <= 0.0 || params.view.focal_px * params.view.tilt_most * rise_m >= allowed_px() * room;
}

/// What becomes of a vertex.
fn decide_on(level: u32, at: vec2<u32>) -> u32 {
    let index = index_of(level, at);
    let box = box_of(level, at, index);
    if !is_visible(box) {
        return CULLED;
    }
    let rise_m = roughness[index];
    if rise_m == 0.0 {
        return LEAF;
    }
    var split_it: bool;
    if PROVEN {
        split_it = may_break(box, rise_m);
    } else {
        split_it = is_rough(level, at, box, rise_m);
    }
    return select(LEAF, SPLIT, split_it);
}
