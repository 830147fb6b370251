//!include lib/waves.wgsl
// Octaves of noise over the surface between samples (Dachsbacher, Stamminger 2004, section 4.1); what they are says the other half,
// `src/ground/octaves.rs`.
//
// A kernel that includes this has `octaves: Octaves` in its parameters.

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

/// The place of relative sample coordinates, good to 2^-54 of a cell.
fn octave_place(cells: vec2<f32>) -> OctavePlace {
    let whole = floor(cells + 0.5);
    // what is left is less than a cell: 30 bits of it, 2 more, and the last 32
    let left = (cells - whole) * 1073741824.0;
    let first = floor(left);
    // (a place a hair's breadth to the west or north must not become the next one)
    let rest = 4.0 * min(left - first, vec2(0.99999994));
    let second = floor(rest);
    let low = vec2<u32>((rest - second) * 4294967296.0);
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

/// Octave k with the amplitude 1, and its slope for each side of a cell of its lattice, to the east and to the south.
fn octave_noise(place: OctavePlace, k: u32) -> vec3<f32> {
    return octave_waves(place, k, params.octaves.seed, EVERYWHERE);
}
