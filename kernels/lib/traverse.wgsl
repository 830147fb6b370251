//!include ground as image
//!include ground/foreground.wgsl
//!include ground/octaves.wgsl
// First hit of a ray with the full-resolution surface, by traversal of the maximum pyramid (Tevs, Ihrke, Seidel 2008) and a
// sign test at cell borders that leaves no gap between cells.
//
// A kernel that includes this has `terrain: Terrain`, `foreground: Foreground` and `octaves: Octaves` in its parameters. A ray's parameter t is its distance along the view direction.

/// A ray may be under the surface (the eye is under it or outside the terrain): the minimum pyramid is needed.
override UNDERSIDE: bool = false;

/// The ground is the scene's, which `Foreground` knows.
override HAS_FOREGROUND: bool = false;

const FAR: f32 = 3.0e38;
/// Level a ray starts at: it starts close to the surface.
const START_LEVEL: u32 = 1u;

/// The ray in cell units horizontally and metres vertically, eye at the origin: position = direction * t.
struct Ray {
    direction: vec3<f32>,
    inverse: vec2<f32>,
    forward: vec2<bool>,
}

/// Heights of the corners of a cell, above the eye in metres. What is between them is not rounded to what the eye's own height allows.
fn relative_corners(cell: vec2<i32>) -> vec4<f32> {
    return (ground_corners(cell) - params.terrain.eye_height_m.x) - params.terrain.eye_height_m.y;
}

/// Ray minus surface over a place in a cell, in metres.
fn above(ray: Ray, t: f32, cell: vec2<i32>) -> f32 {
    if HAS_FOREGROUND {
        let number = foreground_number(cell - params.terrain.eye_cell);
        if number >= 0 {
            return above_foreground(ray, t, number);
        }
    }
    return ray.direction.z * t - ground_surface(relative_corners(cell), in_cell(ray, t, cell));
}

/// How much a ray rises over a plane of the foreground with t.
fn rise(ray: Ray, plane: vec4<f32>) -> f32 {
    return ray.direction.z - (plane.y * ray.direction.x + plane.z * ray.direction.y);
}

/// The same next to the eye.
fn above_foreground(ray: Ray, t: f32, number: i32) -> f32 {
    let first = params.foreground.north_west[number];
    if BILINEAR {
        return (rise(ray, first) - first.w * ray.direction.x * ray.direction.y * t) * t - first.x;
    }
    let is_north_west = (ray.direction.x + ray.direction.y) * t <= first.w;
    let plane = select(params.foreground.south_east[number], first, vec4(is_north_west));
    return rise(ray, plane) * t - plane.x;
}

/// Whether a ray comes to the heights of the foreground before it leaves it.
fn may_hit_foreground(ray: Ray, t: f32, side: f32) -> bool {
    let far = params.terrain.eye_cell + select(vec2(-FOREGROUND), vec2(FOREGROUND), ray.forward) / 2;
    let tx = crossing(ray.inverse.x, far.x, params.terrain.eye_cell.x, params.terrain.eye_fraction.x);
    let ty = crossing(ray.inverse.y, far.y, params.terrain.eye_cell.y, params.terrain.eye_fraction.y);
    let ends = ray.direction.z * vec2(t, min(min(tx, ty), vertical_end(ray)));
    let range = params.foreground.range_m + vec2(-1.0, 1.0) * octaves_most_m();
    return select(max(ends.x, ends.y) >= range.x, min(ends.x, ends.y) <= range.y, side > 0.0);
}

/// First t in [t0, t1] at which a ray comes to the other side of a plane of the foreground, or FAR.
fn hit_plane(ray: Ray, plane: vec4<f32>, t0: f32, t1: f32, side: f32) -> f32 {
    let speed = side * rise(ray, plane);
    let height = side * plane.x;
    if speed * t0 <= height {
        return t0;
    }
    return select(FAR, clamp(height / speed, t0, t1), speed * t1 <= height);
}

/// `hit_in_cell` in a cell next to the eye.
fn hit_in_foreground(ray: Ray, number: i32, t0: f32, t1: f32, side: f32) -> f32 {
    let first = params.foreground.north_west[number];
    if BILINEAR {
        let f0 = side * above_foreground(ray, t0, number);
        let f1 = side * above_foreground(ray, t1, number);
        // from the eye on, and not from where the ray comes in: the hit can be much closer to the eye than the cell is large
        let root = first_root(-side * first.w * ray.direction.x * ray.direction.y, side * rise(ray, first), -side * first.x, t0, t1);
        return select(select(root, select(FAR, t1, f1 <= 0.0), root == FAR), t0, f0 <= 0.0);
    }
    let second = params.foreground.south_east[number];
    // to the south-east of the diagonal is what goes beyond its place
    let along = ray.direction.x + ray.direction.y;
    let meets = first.w / along;
    let crosses = meets > t0 && meets < t1;
    let tm = select(t1, meets, crosses);
    // a ray that comes in at a corner is on the diagonal as far as f32 can tell: where it goes says what it leaves
    let begins_north_west = select(along * (0.5 * (t0 + t1)) <= first.w, along > 0.0, crosses);
    let hit = hit_plane(ray, select(second, first, vec4(begins_north_west)), t0, tm, side);
    if hit < FAR || tm == t1 {
        return hit;
    }
    return hit_plane(ray, select(first, second, vec4(begins_north_west)), tm, t1, side);
}

/// `t` at which the ray crosses column or row `line`; FAR if it never does.
fn crossing(inverse: f32, line: i32, eye_cell: i32, eye_fraction: f32) -> f32 {
    let t = (f32(line - eye_cell) - eye_fraction) * inverse;
    return select(t, FAR, abs(inverse) >= FAR);
}

/// Position of the ray inside `cell`, in [0, 1]^2 from its north-west corner.
fn in_cell(ray: Ray, t: f32, cell: vec2<i32>) -> vec2<f32> {
    let corner = vec2<f32>(cell - params.terrain.eye_cell) - params.terrain.eye_fraction;
    return clamp(ray.direction.xy * t - corner, vec2(0.0), vec2(1.0));
}

/// First t in [t0, t1] at which the sign of ray minus surface changes inside the cell, or FAR.
/// `f0` is the value at t0; `side` is +1 above the surface and -1 under it.
fn hit_in_cell(ray: Ray, cell: vec2<i32>, t0: f32, t1: f32, side: f32) -> f32 {
    let h = relative_corners(cell);
    let p0 = in_cell(ray, t0, cell);
    let p1 = in_cell(ray, t1, cell);
    let f0 = side * (ray.direction.z * t0 - ground_surface(h, p0));
    let f1 = side * (ray.direction.z * t1 - ground_surface(h, p1));
    if f0 <= 0.0 {
        return t0;
    }
    if BILINEAR {
        let d = p1 - p0;
        return hit_in_patch(-side * ground_twist(h) * d.x * d.y, t0, t1, f0, f1);
    }
    // the diagonal cuts the way through the cell in two straight pieces
    let s0 = ground_past_diagonal(p0);
    let s1 = ground_past_diagonal(p1);
    var tm = t1;
    var fm = f1;
    if s0 * s1 < 0.0 {
        let share = s0 / (s0 - s1);
        tm = t0 + (t1 - t0) * share;
        let pm = clamp(p0 + (p1 - p0) * share, vec2(0.0), vec2(1.0));
        fm = side * (ray.direction.z * tm - ground_on_diagonal(h, pm));
    }
    if fm <= 0.0 {
        return t0 + (tm - t0) * (f0 / (f0 - fm));
    }
    if f1 <= 0.0 {
        return tm + (t1 - tm) * (fm / (fm - f1));
    }
    return FAR;
}

/// Along the ray, ray minus patch is a parabola a s^2 + b s + f0 that ends in f1 at s = 1; its smallest root in [0, 1] is the hit.
fn hit_in_patch(a: f32, t0: f32, t1: f32, f0: f32, f1: f32) -> f32 {
    let root = first_root(a, f1 - f0 - a, f0, 0.0, 1.0);
    return select(t0 + (t1 - t0) * root, select(FAR, t1, f1 <= 0.0), root == FAR);
}

/// Below this, a bend is none: what is made of it could be too small for f32, and two such numbers have any quotient.
const STRAIGHT: f32 = 1e-30;

/// The smallest root of a s^2 + b s + c in a range, in the form that does not cancel; FAR if there is none.
fn first_root(a: f32, b: f32, c: f32, low: f32, high: f32) -> f32 {
    let discriminant = b * b - 4.0 * a * c;
    let q = -0.5 * (b + select(-1.0, 1.0, b >= 0.0) * sqrt(max(discriminant, 0.0)));
    let r0 = select(c / q, FAR, q == 0.0);
    let r1 = select(q / a, FAR, abs(a) < STRAIGHT);
    let root = min(select(FAR, r0, r0 >= low && r0 <= high), select(FAR, r1, r1 >= low && r1 <= high));
    return select(root, FAR, discriminant < 0.0);
}

fn bound(level: u32, node: vec2<i32>, side: f32) -> f32 {
    let index = ground_node(level, vec2<u32>(node));
    if UNDERSIDE {
        if side < 0.0 {
            return ground_lowest(index) - octaves_most_m();
        }
    }
    return ground_highest(index) + octaves_most_m();
}

/// The most that octaves add to the surface between samples, or take from it.
fn octaves_most_m() -> f32 {
    if OCTAVES {
        return params.octaves.most_m;
    }
    return 0.0;
}

/// What octaves add at relative sample coordinates.
fn octaves_m(cells: vec2<f32>) -> f32 {
    var sum = 0.0;
    if OCTAVES {
        let place = octave_place(cells);
        var amplitude_m = params.octaves.amplitude_m;
        for (var k = 1u; k <= params.octaves.count; k++) {
            sum += amplitude_m * octave_noise(place, k).x;
            amplitude_m *= params.octaves.persistence;
        }
    }
    return sum;
}

/// The most steps of a ray over the octaves of one cell.
const MOST_STEPS: u32 = 4096u;

/// What is known of the height over some octaves, ahead on a ray.
struct OverOctaves {
    over_m: f32,
    /// How fast it falls here, and anywhere.
    falls: f32,
    fastest: f32,
    /// How fast that changes at most.
    bends: f32,
}

/// How far it is at least until so much is left; a little less than that.
fn way_over(over: OverOctaves, rest_m: f32) -> f32 {
    let left_m = max(over.over_m - rest_m, 0.0);
    // a parabola that falls as fast as it is allowed to, or a line
    let root = sqrt(over.falls * over.falls + 2.0 * over.bends * left_m);
    let parabola = select((root - over.falls) / max(over.bends, 1e-30), 2.0 * left_m / max(over.falls + root, 1e-30), over.falls > 0.0);
    return select(0.99999 * max(parabola, left_m / over.fastest), 0.0, left_m == 0.0);
}

/// The first t in [t0, t1] at which a ray is all but at the surface with its octaves inside the cell, or FAR. No step is longer than the
/// surface needs to come to the ray at its steepest, and octaves that cannot matter are not asked. Who runs out of steps is close to the
/// surface, and has met it.
fn hit_in_octaves(ray: Ray, cell: vec2<i32>, t0: f32, t1: f32, side: f32) -> f32 {
    let h = relative_corners(cell);
    // how fast the surface between samples comes to the ray, on either side of the diagonal
    let along = vec2(max(side * ray.direction.x * (h.y - h.x), side * ray.direction.x * (h.w - h.z)),
                     max(side * ray.direction.y * (h.z - h.x), side * ray.direction.y * (h.w - h.y)));
    let falls = max(along.x + along.y - side * ray.direction.z, 0.0) * 1.00001 + 1e-20;
    let ground = length(ray.direction.xy);
    var t = t0;
    for (var tries = 0u; tries < MOST_STEPS; tries++) {
        let place = octave_place(ray.direction.xy * t);
        var over = OverOctaves(side * above(ray, t, cell), falls, falls, 0.0);
        var amplitude_m = params.octaves.amplitude_m;
        var rest_m = params.octaves.most_m;
        var step = way_over(over, rest_m);
        // half of what is near enough is for octaves that are too low to matter here
        let near_m = 0.5 * params.octaves.near * t;
        var k = 1u;
        while k <= params.octaves.count && step <= t1 - t && rest_m > near_m {
            let octave = side * amplitude_m * octave_noise(place, k);
            let waves = octave_cells(k) * ground;
            over.over_m -= octave.x;
            over.falls += octave_cells(k) * dot(octave.yz, ray.direction.xy);
            over.fastest += amplitude_m * waves * OCTAVE_STEEPEST;
            over.bends += amplitude_m * waves * waves * OCTAVE_CURVED;
            rest_m = max(rest_m - amplitude_m, 0.0);
            rest_m = select(rest_m, 0.0, k == params.octaves.count);
            step = max(step, way_over(over, rest_m));
            amplitude_m *= params.octaves.persistence;
            k += 1u;
        }
        if step <= t1 - t && over.over_m <= near_m {
            return t;
        }
        t = max(t + step, t * 1.0000003);
        if t >= t1 {
            return FAR;
        }
    }
    return t;
}

/// Whether a ray comes so close to the surface in the cells next to the eye that it may meet it there.
fn may_meet_foreground(direction_m: vec3<f32>) -> bool {
    if !HAS_FOREGROUND {
        return false;
    }
    let ray = ray_towards(direction_m);
    return may_hit_foreground(ray, 0.0, 1.0) || (UNDERSIDE && may_hit_foreground(ray, 0.0, -1.0));
}

/// Below this, in cells for each metre along the view direction, a ray never leaves its column or row on any terrain.
const LEVEL: f32 = 1e-30;

fn ray_towards(direction_m: vec3<f32>) -> Ray {
    let direction = vec3(cells_from_world(params.terrain, direction_m.xy), direction_m.z);
    let inverse = select(1.0 / direction.xy, vec2(FAR), abs(direction.xy) < vec2(LEVEL));
    return Ray(direction, inverse, direction.xy >= vec2(0.0));
}

fn first_hit(direction_m: vec3<f32>, clear: f32) -> f32 {
    let terrain = params.terrain;
    let ray = ray_towards(direction_m);
    let level_ray = abs(ray.direction.xy) < vec2(LEVEL);

    // the part of the ray over the terrain
    let last = vec2<i32>(terrain.size) - 1;
    let nearest = select(last, vec2(0), ray.forward);
    let farthest = select(vec2(0), last, ray.forward);
    var t_in = clear;
    var t_out = FAR;
    for (var axis = 0; axis < 2; axis++) {
        let eye_cell = terrain.eye_cell[axis];
        let fraction = terrain.eye_fraction[axis];
        if level_ray[axis] {
            let at = f32(eye_cell) + fraction;
            if at < 0.0 || at > f32(last[axis]) {
                return FAR;
            }
        } else {
            t_in = max(t_in, crossing(ray.inverse[axis], nearest[axis], eye_cell, fraction));
            t_out = min(t_out, crossing(ray.inverse[axis], farthest[axis], eye_cell, fraction));
        }
    }
    if t_in > t_out {
        return FAR;
    }

    let start = ray.direction.xy * t_in + terrain.eye_fraction;
    var cell = clamp(terrain.eye_cell + vec2<i32>(floor(start)), vec2(0), last - 1);
    var t = t_in;
    var side = 1.0;
    if UNDERSIDE {
        side = select(-1.0, 1.0, above(ray, t, cell) >= octaves_m(ray.direction.xy * t));
    }
    if HAS_FOREGROUND {
        // a loop of its own and no branch in the next one: software adapters go through what they skip, but for loops
        var number = foreground_number(cell - terrain.eye_cell);
        if !may_hit_foreground(ray, t, side) {
            number = -1;
        }
        while number >= 0 {
            let line = min(cell + select(vec2(0), vec2(1), ray.forward), last);
            let tx = crossing(ray.inverse.x, line.x, terrain.eye_cell.x, terrain.eye_fraction.x);
            let ty = crossing(ray.inverse.y, line.y, terrain.eye_cell.y, terrain.eye_fraction.y);
            let t_exit = max(t, min(tx, ty));
            var hit: f32;
            if OCTAVES {
                hit = hit_in_octaves(ray, cell, t, min(t_exit, vertical_end(ray)), side);
            } else {
                hit = hit_in_foreground(ray, number, t, min(t_exit, vertical_end(ray)), side);
            }
            if hit < FAR {
                return hit;
            }
            let ahead = select(vec2(-1), vec2(1), ray.forward);
            cell += select(vec2(0, ahead.y), vec2(ahead.x, 0), tx <= ty);
            if t_exit >= t_out || any(cell < vec2(0)) || any(cell >= last) {
                return FAR;
            }
            t = t_exit;
            number = foreground_number(cell - terrain.eye_cell);
        }
    }
    var level = min(START_LEVEL, GROUND_CELLS_TOP);
    loop {
        let node = cell >> vec2(level);
        let far_line = min((node + select(vec2(0), vec2(1), ray.forward)) << vec2(level), last);
        let tx = crossing(ray.inverse.x, far_line.x, terrain.eye_cell.x, terrain.eye_fraction.x);
        let ty = crossing(ray.inverse.y, far_line.y, terrain.eye_cell.y, terrain.eye_fraction.y);
        let t_exit = max(t, min(tx, ty));
        if level == 0u {
            // straight down, no line is ever crossed: the cell is left at the end of the world
            var hit: f32;
            if OCTAVES {
                hit = hit_in_octaves(ray, cell, t, min(t_exit, vertical_end(ray)), side);
            } else {
                hit = hit_in_cell(ray, cell, t, min(t_exit, vertical_end(ray)), side);
            }
            if hit < FAR {
                return hit;
            }
        } else {
            let z = select(min(ray.direction.z * t, ray.direction.z * t_exit),
                           max(ray.direction.z * t, ray.direction.z * t_exit), side < 0.0);
            let clearance = side * (z - relative_height(terrain, bound(level, node, side)));
            if clearance <= 0.0 || t_exit >= FAR {
                level -= 1u;
                continue;
            }
        }
        // to the next node: across one line exactly, along it wherever the ray is, but never out of this node
        if t_exit >= t_out {
            return FAR;
        }
        let low = node << vec2(level);
        let high = min(low + (vec2(1) << vec2(level)), last) - 1;
        let at = terrain.eye_cell + vec2<i32>(floor(ray.direction.xy * t_exit + terrain.eye_fraction));
        let along = clamp(at, low, high);
        let across = select(far_line - 1, far_line, ray.forward);
        cell = select(vec2(along.x, across.y), vec2(across.x, along.y), tx <= ty);
        if any(cell < vec2(0)) || any(cell >= last) {
            return FAR;
        }
        t = t_exit;
        // up if the line that was crossed bounds the parent, too
        let line = select(far_line.y, far_line.x, tx <= ty) >> level;
        level += select(0u, 1u, (line & 1) == 0 && level < GROUND_CELLS_TOP);
    }
    return FAR;
}

/// A t beyond the lowest and highest point that a ray without horizontal direction can reach.
fn vertical_end(ray: Ray) -> f32 {
    return 1e10 / max(abs(ray.direction.z), 1e-30);
}
