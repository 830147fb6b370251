// Octaves of noise over the surface between samples (Dachsbacher, Stamminger 2004, section 4.1); what they are says the other half,
// `src/ground/octaves.rs`.
//
// A kernel that includes this has `octaves: Octaves` in its parameters. The lattice of an octave is counted in 64 bits, and a place in a cell
// has 64, so that far from the origin there is the same as near to it.

/// The scene's ground has octaves.
override OCTAVES: bool = false;

/// (Sized so that it can stand in front of anything in a uniform structure.)
struct Octaves {
    /// The eye's cell, counted from the octaves' origin,
    eye_cell: vec2<i32>,
    /// and its place in it from the north-west corner: 2^-32 and 2^-64 of a cell.
    eye_high: vec2<u32>,
    eye_low: vec2<u32>,
    count: u32,
    seed: u32,
    /// Of the first octave in metres, and of each further one as a part of the one before.
    amplitude_m: f32,
    persistence: f32,
    /// The most that all together add or take in metres; a little more than that.
    most_m: f32,
    /// A ray has met the surface where it is no farther over it than this, in metres for each metre along the view direction.
    near: f32,
    /// Octaves of which meshes are made in this frame: all others together are too low to be seen.
    for_meshes: u32,
    /// Octaves that light pixels in this frame: all others are nowhere in view longer than two of them.
    @size(12) for_light: u32,
}

/// A place on the ground as the octaves see it: its cell, counted from their origin, and the place in it as `eye_high` and `eye_low`.
struct OctavePlace {
    cell: vec2<i32>,
    high: vec2<u32>,
    low: vec2<u32>,
}

/// The largest of a wave is 1.
const OCTAVE_WAVE: f32 = 6.2625;
/// No octave is steeper than its amplitude times this, for each side of a cell of its lattice.
const OCTAVE_STEEPEST: f32 = 17.83;
/// Nor does its slope change faster than this times the amplitude.
const OCTAVE_CURVED: f32 = 317.0;

/// The place of relative sample coordinates. Nothing of them is lost.
fn octave_place(cells: vec2<f32>) -> OctavePlace {
    let whole = floor(cells + 0.5);
    // what is left is less than a cell: 30 bits of it, 2 more, and the last 32
    let left = (cells - whole) * 1073741824.0;
    let first = floor(left);
    let second = floor((left - first) * 4.0);
    let low = vec2<u32>(((left - first) * 4.0 - second) * 4294967296.0);
    let high = (vec2<u32>(vec2<i32>(first)) << vec2(2u)) + vec2<u32>(second);
    let eye = params.octaves;
    let low_sum = eye.eye_low + low;
    let carried = select(vec2(0u), vec2(1u), low_sum < low);
    let high_sum = eye.eye_high + high;
    let high_carried = high_sum + carried;
    let is_over = (high_sum < high) | (high_carried < carried);
    let cell = eye.eye_cell + vec2<i32>(whole) + select(vec2(0), vec2(-1), first < vec2(0.0)) + select(vec2(0), vec2(1), is_over);
    return OctavePlace(cell, high_carried, low_sum);
}

/// A permutation of 32 bits in which each bit hangs on all.
fn octave_mixed(bits: vec2<u32>) -> vec2<u32> {
    let first = (bits ^ (bits >> vec2(16u))) * 0x7feb352du;
    let second = (first ^ (first >> vec2(15u))) * 0x846ca68bu;
    return second ^ (second >> vec2(16u));
}

/// Seeds of an octave, for columns and for rows.
fn octave_seeds(k: u32) -> vec2<u32> {
    let seed = octave_mixed(vec2(params.octaves.seed + k * 0x9e3779b9u)).x;
    return vec2(seed, ~seed);
}

/// The mean of a node's two waves, two of each across a side of the lattice, and its slope.
fn octave_wave(hash: u32, from_node: vec2<f32>) -> vec3<f32> {
    let bits = vec2(hash, hash >> 16u);
    let t = vec2<f32>(2 * vec2<i32>(bits & vec2(63u)) - 63) / 64.0;
    let squared = t * t;
    let east = (1.0 - squared) / (1.0 + squared);
    let south = 2.0 * t / (1.0 + squared);
    let phase = vec2<f32>((bits >> vec2(6u)) & vec2(1023u)) / 1024.0;
    let place = 2.0 * (east * from_node.x + south * from_node.y) + phase;
    let x = place - round(place);
    let s = x * x;
    let value = x * (1.0 + s * (-6.5 + s * (12.0 - 8.0 * s)));
    let slope = 1.0 + s * (-19.5 + s * (60.0 - 56.0 * s));
    return OCTAVE_WAVE * vec3(0.5 * (value.x + value.y), dot(slope, east), dot(slope, south));
}

/// Octave k with the amplitude 1, and its slope for each side of a cell of its lattice, to the east and to the south.
fn octave_noise(place: OctavePlace, k: u32) -> vec3<f32> {
    // the node to the north-west: what is left of a shift by 32 would be everything
    let shift = vec2(max(k, 2u) - 2u);
    let back = vec2(31u) - shift;
    var number = (vec2<u32>(place.cell) << shift) | ((place.high >> vec2(1u)) >> back);
    var above = vec2<u32>((place.cell >> vec2(1u)) >> back);
    var rest = (place.high << shift) | ((place.low >> vec2(1u)) >> back);
    if k < 2u {
        number = vec2<u32>(place.cell >> vec2(1u));
        above = vec2<u32>(place.cell >> vec2(31u));
        rest = (vec2<u32>(place.cell) << vec2(31u)) | (place.high >> vec2(1u));
    }
    let w = vec2<f32>(rest >> vec2(8u)) / 16777216.0;
    let seeds = octave_seeds(k);
    let next = number + 1u;
    let next_above = above + select(vec2(0u), vec2(1u), next == vec2(0u));
    let first_of = octave_mixed(number ^ octave_mixed(above ^ seeds));
    let next_of = octave_mixed(next ^ octave_mixed(next_above ^ seeds));
    let rows = vec2(first_of.y, next_of.y) * 0x9e3779b9u;
    let north = octave_mixed(vec2(first_of.x, next_of.x) + rows.x);
    let south = octave_mixed(vec2(first_of.x, next_of.x) + rows.y);
    let nw = octave_wave(north.x, w);
    let ne = octave_wave(north.y, w - vec2(1.0, 0.0));
    let sw = octave_wave(south.x, w - vec2(0.0, 1.0));
    let se = octave_wave(south.y, w - 1.0);
    let fade = w * w * w * (w * (w * 6.0 - 15.0) + 10.0);
    let fade_slope = 30.0 * w * w * (w - 1.0) * (w - 1.0);
    let upper = mix(nw, ne, fade.x);
    let lower = mix(sw, se, fade.x);
    let along = mix(ne.x - nw.x, se.x - sw.x, fade.y);
    return mix(upper, lower, fade.y) + vec3(0.0, fade_slope * vec2(along, lower.x - upper.x));
}

/// Cells of octave k's lattice along a cell of the ground.
fn octave_cells(k: u32) -> f32 {
    return exp2(f32(i32(k) - 2));
}
