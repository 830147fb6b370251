//! The cells of the ground next to an eye, where f32 has too few digits for the surface between samples.

use glam::{DVec2, DVec3, IVec2};

use super::Ground;
use super::cell::Cell;
use crate::experiment::scene::Surface;

/// Cells a side, around the sample nearest to the eye; `FOREGROUND` of `kernels/ground/foreground.wgsl`.
pub const SIDE: i32 = 4;

/// What is beyond these cells is at least so many cells away from the eye.
pub const BEYOND_CELLS: f64 = 1.5;

/// Kernels do without the formulas of these cells where rounding moves nothing by more than this, in pixels.
const LITTLE_PX: f64 = 0.002;

/// A cell with its heights above the eye.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    pub cell: Cell,
    /// Where its north-west corner is, in cells from the eye.
    pub corner: DVec2,
}

/// The cells by rows from the north-west; `None` beyond the border.
pub fn cells(ground: &dyn Ground, eye_m: DVec3) -> Vec<Option<Near>> {
    let lattice = ground.lattice();
    let eye = lattice.sample_from_world(eye_m.truncate());
    let (nearest, last) = (eye.round(), lattice.last().as_ivec2());
    let near = |at: i32| {
        let from_eye = IVec2::new(at % SIDE, at / SIDE) - SIDE / 2;
        let at = nearest.as_ivec2().checked_add(from_eye)?;
        if at.cmplt(IVec2::ZERO).any() || at.cmpge(last).any() {
            return None;
        }
        let height_m = |x, y| ground.height_m((at + IVec2::new(x, y)).as_uvec2()) - eye_m.z;
        let cell = Cell { nw: height_m(0, 0), ne: height_m(1, 0), sw: height_m(0, 1), se: height_m(1, 1) };
        Some(Near { cell, corner: from_eye.as_dvec2() + (nearest - eye) })
    };
    (0..SIDE * SIDE).map(near).collect()
}

/// No part of the surface in these cells is closer to an eye: its height above the surface over the length of the steepest slope there.
fn distance_m(ground: &dyn Ground, eye_m: DVec3) -> f64 {
    let cell_m = ground.lattice().cell_m;
    let steepest = |near: &Near| near.cell.steepest(cell_m, Surface::Bilinear);
    let steepest = cells(ground, eye_m).iter().flatten().map(steepest).fold(0.0, f64::max);
    let of_octaves = ground.detail().map_or(0.0, |detail| detail.octaves().steepest() / cell_m.min_element());
    let steepest = steepest + of_octaves;
    ground.above_m(eye_m).abs() / steepest.hypot(1.0)
}

/// No part of the surface is closer to an eye.
pub fn least_distance_m(ground: &dyn Ground, eye_m: DVec3) -> f64 {
    distance_m(ground, eye_m).min(BEYOND_CELLS * ground.lattice().cell_m.min_element())
}

/// Whether heights above the eye that are interpolated in f32 can move a hit next to the eye by more than a little.
///
/// A place in a cell is rounded to 2^-24 of a few cells and each of three products to 2^-24 of the largest height: all in all less than
/// 8 x 2^-24 of that. Seen from the eye it is that much over the distance of the surface.
pub fn is_needed(ground: &dyn Ground, eye_m: DVec3, focal_px: f64) -> bool {
    let near = cells(ground, eye_m);
    let largest_m = near.iter().flatten().map(|near| near.cell.largest()).fold(0.0, f64::max);
    let off_px = focal_px * 8.0 * 2f64.powi(-24) * largest_m / distance_m(ground, eye_m);
    largest_m > 0.0 && (off_px > LITTLE_PX || off_px.is_nan())
}
