// Noise that is bounded in frequency on both sides; what it is says its other half, `src/ground/octaves.rs`.
//
// The lattice of an octave is counted in 64 bits, and a place in a cell has 64, so that far from the origin there is the same as near to it.

/// A place on the ground as the octaves see it: its cell, counted from their origin, and the place in it in 2^-32 and 2^-64 of a cell.
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
const OCTAVE_CURVED: f32 = 317.1;

/// A permutation of 32 bits in which each bit hangs on all.
fn octave_mixed(bits: vec2<u32>) -> vec2<u32> {
    let first = (bits ^ (bits >> vec2(16u))) * 0x7feb352du;
    let second = (first ^ (first >> vec2(15u))) * 0x846ca68bu;
    return second ^ (second >> vec2(16u));
}

/// Seeds of an octave, for columns and for rows.
fn octave_seeds(seed_of_all: u32, k: u32) -> vec2<u32> {
    let seed = octave_mixed(vec2(seed_of_all + k * 0x9e3779b9u)).x;
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

/// The bits of a node's number that count: all of them, so that no node is there twice.
const EVERYWHERE: u32 = 0xffffffffu;

/// Octave k with the amplitude 1, and its slope for each side of a cell of its lattice, to the east and to the south. With fewer bits of a
/// node's number it is periodic.
fn octave_waves(place: OctavePlace, k: u32, seed: u32, bits: u32) -> vec3<f32> {
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
    let seeds = octave_seeds(seed, k);
    number &= vec2(bits);
    let next = (number + 1u) & vec2(bits);
    above = select(vec2(0u), above, bits == EVERYWHERE);
    let next_above = above + select(vec2(0u), vec2(1u), (next == vec2(0u)) & vec2(bits == EVERYWHERE));
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
