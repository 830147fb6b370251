//!include lib/motion.wgsl
// How long what becomes of a block (lib/decision.wgsl) holds while the camera moves. A kernel that includes this has
// `motion: Motion` in its parameters.

/// What becomes of a block, and for how long. Motion is the angle that the camera turns plus the angle under which its way is seen
/// from the nearest of the block: by no more than that does the direction to any point of the block change.
struct Outlook {
    fate: u32,
    distance_m: f32,
    motion: f32,
}

/// The largest motion that is tried; if that is not certain, a block is looked at again in the next frame.
const MOST_MOTION: f32 = 0.05;
/// What rounding may do to a decision, as a part of both of its sides.
const CERTAIN: f32 = 1.0e-3;

/// The largest and the smallest error that a point can get by some motion: its direction, the way up and its distance all change.
fn errors_by(motion: f32, point: vec3<f32>, rise_m: f32) -> vec2<f32> {
    let p = vec3(dot(params.view.right, point), dot(params.view.up, point), dot(params.view.forward, point));
    let up = vec3(params.view.right.z, params.view.up.z, params.view.forward.z);
    let q = p + rise_m * up;
    let far = length(q);
    let aside = length(p.xy * up.z - up.xy * p.z) / length(p);
    let ahead = vec2(abs(p.z) / length(p), abs(q.z) / far);
    let scale = params.view.focal_px * rise_m / far;
    let least = ahead - motion;
    let most_px = scale * (aside + 3.0 * motion) / (least.x * least.y * (1.0 - motion));
    let most = ahead + motion;
    let least_px = scale * max(aside - 3.0 * motion, 0.0) / (most.x * most.y * (1.0 + motion));
    return vec2(select(most_px, 3.0e38, min(least.x, least.y) <= motion), least_px);
}

/// How near a block's points, and those that its roughness moves them to, come to the eye.
fn nearest_of(points: array<vec3<f32>, 5>, rise_m: f32) -> f32 {
    var nearest = 3.0e38;
    for (var k = 0u; k < 5u; k++) {
        nearest = min(nearest, min(length(points[k]), length(points[k] + vec3(0.0, 0.0, rise_m))));
    }
    return nearest;
}

/// A motion to try, from how near two numbers are that have been compared.
fn motion_for(a: f32, b: f32) -> f32 {
    return min(0.07 * (1.0 - min(a, b) / max(a, b)), MOST_MOTION);
}

/// Whether Eq. 2 says the same after some motion.
fn keeps_rough(motion: f32, points: array<vec3<f32>, 5>, rise_m: f32, splits: bool) -> bool {
    var most = 0.0;
    var least = 0.0;
    for (var k = 0u; k < 5u; k++) {
        let errors = errors_by(motion, points[k], rise_m);
        most = max(most, errors.x);
        least = max(least, errors.y);
    }
    let stays_leaf = most < params.threshold_px * (1.0 - CERTAIN);
    let stays_split = least > params.threshold_px * (1.0 + CERTAIN);
    return select(stays_leaf, stays_split, splits);
}

/// Whether `may_break` says the same after some motion; nothing of the block is farther than `farthest`.
fn keeps_bound(motion: f32, box: Box, rise_m: f32, farthest: f32, splits: bool) -> bool {
    let near = min(params.view.forward * box.low, params.view.forward * box.high);
    let beside = max(max(box.low, -box.high), vec3(0.0));
    let room = max(near.x + near.y + near.z, length(beside) / params.view.ray_most) - rise_m * abs(params.view.forward.z);
    let moves = (farthest + rise_m) * (motion + CERTAIN * 0.1);
    let tilts = (params.view.ray_most + 1.0) * motion;
    let most = params.view.focal_px * (params.view.tilt_most + tilts) * rise_m;
    let least = params.view.focal_px * max(params.view.tilt_most - tilts, 0.0) * rise_m;
    let stays_leaf = room > moves && most < allowed_px() * (room - moves) * (1.0 - CERTAIN);
    let stays_split = room + moves < 0.0 || least > allowed_px() * (room + moves) * (1.0 + CERTAIN);
    return select(stays_leaf, stays_split, splits);
}

/// `decide_on` with how long it holds.
fn outlook_on(level: u32, at: vec2<u32>) -> Outlook {
    let index = index_of(level, at);
    let box = box_of(level, at, index);
    let rise_m = roughness[index];
    let farthest = length(max(abs(box.low), abs(box.high)));
    var outlook = Outlook(decide_on(level, at), length(max(max(box.low, -box.high), vec3(0.0))), 1.0);
    if CULL {
        // in the picture as long as no side is passed, out of it as long as the same one is
        outlook.motion = max(abs(reach_inside(box)) / farthest - CERTAIN * 0.1, 0.0);
    }
    if outlook.fate == CULLED || rise_m == 0.0 {
        return outlook;
    }
    let splits = outlook.fate == SPLIT;
    var kept = 0.0;
    if PROVEN {
        let strain = params.view.focal_px * params.view.tilt_most * rise_m / max(allowed_px(), 1.0e-6);
        let motion = motion_for(strain, outlook.distance_m) * outlook.distance_m / farthest;
        kept = select(0.0, motion, keeps_bound(motion, box, rise_m, farthest, splits));
    } else {
        let points = five_points(level, at);
        outlook.distance_m = min(outlook.distance_m, nearest_of(points, rise_m));
        let motion = motion_for(most_error_px(points, rise_m), params.threshold_px);
        let centre = length(0.5 * (box.low + box.high));
        let radius = length(0.5 * (box.high - box.low));
        let apart = abs(centre - radius) - 1.0e-5 * (centre + radius);
        let sphere = max(apart / max(outlook.distance_m, 1.0e-3) - CERTAIN, 0.0);
        kept = select(0.0, motion, keeps_rough(motion, points, rise_m, splits));
        // inside the sphere the errors do not count
        kept = min(select(kept, 1.0, centre < radius), sphere);
    }
    outlook.motion = min(outlook.motion, kept);
    return outlook;
}

/// Whether what was found about a node still holds.
fn is_settled(known: vec4<f32>) -> bool {
    // what rounding leaves of a long way
    let way_m = abs(params.motion.travelled_m - known.z) + 1.0e-6 * params.motion.travelled_m;
    let turn = abs(params.motion.turned - known.w) + 1.0e-6 * (1.0 + params.motion.turned);
    return way_m < 0.25 * known.x && turn + 1.05 * way_m / known.x < known.y;
}
