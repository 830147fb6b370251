//! Octaves in meshes (`kernels/lib/heights.wgsl`), and how far octaves in f32 are from those in f64.

use glam::DVec2;

use super::rounding::EPSILON;
use crate::frame::octaves::for_meshes;
use crate::ground::octaves::{Octave, Octaves};
use crate::plan::Chain;
use crate::reference::Frame;

/// Roundings of an octave with the amplitude 1. A place on the lattice has 24 bits and is rounded twice more; a direction has three
/// roundings, two products with it and the phase three, and a wave rises by up to 2 x 6.3 on a side of the lattice: less than
/// 2 x 6.3 x 9. The polynomial, the fading and the sum of amplitudes are a few dozen more.
const ROUNDINGS: f64 = 160.0;

/// Says that a stage which knows octaves finds none.
pub fn note(chain: &mut Chain) {
    if chain.octaves().is_none() {
        chain.leave_out("octaves between samples", "the scene has no detail", 0, 0);
    }
}

/// The most that octaves with a weight each are off at a place that is off by so many cells, in metres.
pub fn octaves_off_m(octaves: &Octaves, weight: &dyn Fn(u32) -> f64, off_cells: f64) -> f64 {
    let off = |(k, octave): (u32, &Octave)| {
        let off_m = ROUNDINGS * EPSILON * octave.amplitude_m + octave.steepest * off_cells;
        weight(k) * off_m.min(2.0 * octave.amplitude_m)
    };
    octaves.each().map(off).sum()
}

/// Up to which octave a mesh holds the detail where the farthest neighbour is so many cells away; half of `kernels/lib/heights.wgsl`.
fn split_octave(seen: u32, bias: f64, extent: f64) -> f64 {
    (-extent.max(1e-12).log2() - bias).clamp(0.0, f64::from(seen + 1))
}

/// The level of a vertex, with its bound: that of the pyramid, or the split octave with a minus where it has octaves.
pub fn level((level, off_level): (f64, f64), (split, off_split): (f64, f64)) -> (f64, f64) {
    match split > 0.0 {
        true => (-split, off_split + if split <= off_split { level + off_level } else { 0.0 }),
        false => (level, off_level + if off_split > 0.0 { level + off_split } else { 0.0 }),
    }
}

/// How much of octave k is in a mesh.
fn weight(split: f64, k: u32) -> f64 {
    (split - f64::from(k)).clamp(0.0, 1.0)
}

/// What the octaves add to a vertex at a place that is off by so many cells, and its split octave, each with its bound. `extent` is how far
/// the farthest neighbour is away in cells, give or take.
pub fn in_mesh(
    frame: &Frame,
    bias: f64,
    (sample, off_cells): (DVec2, f64),
    (extent, off_extent): (f64, f64),
) -> [(f64, f64); 2] {
    let Some(detail) = frame.ground.detail() else { return [(0.0, 0.0); 2] };
    let octaves = detail.octaves();
    let seen = for_meshes(detail, frame.camera);
    let sample = sample.clamp(DVec2::ZERO, frame.lattice().last().as_dvec2());
    let split = split_octave(seen, bias, extent);
    // Vulkan allows log2 an absolute error of 2^-21 near 1 and 3 ulp elsewhere
    let off_log = 5e-7 + 16.0 * EPSILON * (split + bias);
    let least = split_octave(seen, bias + off_log, extent + off_extent);
    let most = split_octave(seen, bias - off_log, (extent - off_extent).max(0.0));
    let (height_m, _) = octaves.weighted(&octaves.place(sample), |k| weight(split, k));
    let off_weight = |(k, octave): (u32, &Octave)| (weight(most, k) - weight(least, k)) * octave.amplitude_m;
    let off_weights: f64 = octaves.each().map(off_weight).sum();
    let off_m = octaves_off_m(octaves, &|k| weight(most, k), off_cells) + off_weights;
    [(height_m, off_m), (split, most - least)]
}
