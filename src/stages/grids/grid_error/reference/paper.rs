//! Loeffler et al. 2009, Eq. 2 to 4, and the displacement by the maximum.

use glam::{DVec2, DVec3};

use crate::ground::Lattice;
use crate::plan::product::{Grid, Mesh, PointErrors, Promise};
use crate::reference::{Absent, Buffers, Frame, Values, ValuesId};
use crate::stages::shared::rounding::EPSILON;

pub fn reference(
    frame: &Frame,
    buffers: &mut Buffers,
    grid: Grid<ValuesId>,
    threshold_px: f64,
    is_raised: bool,
) -> Result<(), Absent> {
    let vertices = buffers.values(grid.vertex);
    let (height, lowest, highest) = (buffers.get("height")?, buffers.get("height_min")?, buffers.get("height_max")?);
    let (lattice, range_m) = (frame.lattice(), frame.ground.range_m());
    let known = Ranges { height: &height, lowest: &lowest, highest: &highest, lattice, range_m };
    let terrain = frame.lattice();
    let (eye_m, top) = (frame.camera.eye_m, terrain.cells().top);
    let lambda = f64::from(frame.data.scene.viewport.1) / frame.data.scene.fov_deg.to_radians();
    let last = (terrain.size - 1).as_dvec2();
    let mut moved = (*vertices).clone();
    let mut errors = Values::missing(&vertices.dims, 1);
    for at in 0..errors.value.len() {
        let (v, off) = (&vertices.value[4 * at..4 * at + 4], &vertices.bound[4 * at..4 * at + 4]);
        let point = DVec3::from_slice(v);
        let place = terrain.sample_from_world(point.truncate() + eye_m.truncate()).clamp(DVec2::ZERO, last);
        let off_cells = off[0].max(off[1]) / terrain.cell_m.min_element() + 8.0 * EPSILON * last.max_element();
        let level = v[3].clamp(0.0, top.into());
        let off_level = off[3] + 8.0 * EPSILON * level;
        let range = |level: u32| known.at(level.min(top), place, off_cells);
        let (fine, coarse, next) = (range(level as u32), range(level as u32 + 1), range(level as u32 + 2));
        let before = range((level as u32).saturating_sub(1));
        let blend = |pick: fn(&(f64, f64, f64)) -> f64| pick(&fine) + (pick(&coarse) - pick(&fine)) * level.fract();
        let (low, high) = (blend(|range| range.0) - eye_m.z, blend(|range| range.1) - eye_m.z);
        // past a whole level the blend goes on where the one before ended
        let jump = |a: &(f64, f64, f64), b: &(f64, f64, f64)| (a.0 - b.0).abs().max((a.1 - b.1).abs());
        let off_by_level = match off_level <= 1.0 {
            true => off_level * jump(&fine, &coarse).max(jump(&coarse, &next)).max(jump(&before, &fine)),
            false => known.range_m.1 - known.range_m.0,
        };
        let off_m = fine.2.max(coarse.2) + off_by_level + off[2] + 8.0 * EPSILON * (high - low).abs();
        let delta_m = (high - point.z).max(point.z - low).max(0.0);
        let distance_m = point.length().max(1e-6);
        let rho_px = lambda * delta_m / distance_m;
        let off_distance = DVec3::from_slice(off).length() / distance_m;
        let off_px = lambda * off_m / distance_m + rho_px * (8.0 * EPSILON + off_distance);
        let error = if rho_px < threshold_px { 0.0 } else { 1.0 - threshold_px / rho_px };
        let off_error = off_px / rho_px.max(threshold_px) + 4.0 * EPSILON;
        errors.set(at, error, off_error);
        moved.set(4 * at + 3, error, off_error);
        if (rho_px - threshold_px).abs() <= off_px {
            moved.set(4 * at + 2, point.z, f64::INFINITY);
        } else if rho_px > threshold_px {
            moved.set(4 * at + 2, high, off_m);
        }
    }
    if is_raised {
        let vertex = buffers.put("vertex", moved);
        let promise = Some(Promise { bound_px: threshold_px, proven: false });
        buffers.offer(Mesh::Grid(Grid { vertex, promise, ..grid }));
    }
    let errors = buffers.put("grid_error", errors);
    buffers.offer(PointErrors { errors });
    Ok(())
}

/// Bilinear sampling of the minimum and maximum pyramids.
struct Ranges<'a> {
    height: &'a Values,
    lowest: &'a Values,
    highest: &'a Values,
    lattice: Lattice,
    range_m: (f64, f64),
}

impl Ranges<'_> {
    fn node(&self, level: u32, x: f64, y: f64) -> (f64, f64) {
        let layout = self.lattice.cells();
        let last = if level == 0 { self.lattice.last() } else { layout.size(level) - 1 };
        let (x, y) = (x.clamp(0.0, last.x.into()) as u32, y.clamp(0.0, last.y.into()) as u32);
        if level == 0 {
            let height = self.height.value[(y * self.lattice.size.x + x) as usize];
            return (height, height);
        }
        let index = layout.index(level, x, y);
        (self.lowest.value[index], self.highest.value[index])
    }

    /// Minimum, maximum, and the bound of both for a place that is known to `off` cells.
    fn at(&self, level: u32, place: DVec2, off: f64) -> (f64, f64, f64) {
        let side = f64::from(1u32 << level);
        // a node over cells has its middle half a side from its corner
        let place = if level == 0 { place } else { place / side - 0.5 };
        let (low, w) = (place.floor(), place - place.floor());
        let node = |dx: f64, dy: f64| self.node(level, low.x + dx, low.y + dy);
        let mix = |pick: fn((f64, f64)) -> f64| {
            let north = pick(node(0.0, 0.0)) * (1.0 - w.x) + pick(node(1.0, 0.0)) * w.x;
            let south = pick(node(0.0, 1.0)) * (1.0 - w.x) + pick(node(1.0, 1.0)) * w.x;
            north * (1.0 - w.y) + south * w.y
        };
        let around: Vec<(f64, f64)> = (-1..=2)
            .flat_map(|dy| (-1..=2).map(move |dx| (f64::from(dx), f64::from(dy))))
            .map(|(x, y)| node(x, y))
            .collect();
        let spread = |pick: fn(&(f64, f64)) -> f64| {
            let (low, high) = around.iter().map(pick).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
            high - low
        };
        let largest = around.iter().fold(0.0, |most: f64, (low, high)| most.max(low.abs()).max(high.abs()));
        let steepest = spread(|range| range.0).max(spread(|range| range.1));
        // a place that may be among other cells can have any height
        let reach_m = if off <= side { 2.0 * steepest * off / side } else { self.range_m.1 - self.range_m.0 };
        (mix(|range| range.0), mix(|range| range.1), reach_m + 12.0 * EPSILON * largest)
    }
}
