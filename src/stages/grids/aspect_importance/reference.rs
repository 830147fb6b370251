use glam::DVec2;

use super::AspectImportance;
use crate::frame::projector::Projector;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::projected::ground_off_m;
use crate::stages::shared::rounding::EPSILON;

impl Reference for AspectImportance {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let (columns, rows) = self.size;
        let projector = Projector::new(frame.data, frame.camera);
        let corner = |x: u32, y: u32| {
            let uv = DVec2::new(f64::from(x) / f64::from(columns), f64::from(y) / f64::from(rows));
            ground_off_m(&projector, uv, 10.0 * EPSILON)
        };
        let mut importance = Values::missing(&[rows, columns], 1);
        for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
            let corners = [corner(x, y), corner(x + 1, y), corner(x, y + 1), corner(x + 1, y + 1)];
            let [nw, ne, sw, se] = corners.map(|(place, _)| place);
            let off_m = corners.iter().map(|(_, off)| *off).fold(0.0, f64::max);
            let width = ne.distance(nw) + se.distance(sw);
            let length = sw.distance(nw) + se.distance(ne);
            let value = (length / width.max(1e-30)).clamp(1e-6, 1e6);
            // each sum of two distances is off by what four corners are off by
            let share = 4.0 * off_m / width.max(1e-30);
            let bound = (share + value * share) / (1.0 - share).max(1e-9) + 16.0 * EPSILON * value;
            // where rounding is as large as a cell, nothing can be said
            importance.set((y * columns + x) as usize, value, if share < 0.5 { bound } else { f64::INFINITY });
        }
        buffers.put("importance", importance);
        Ok(())
    }
}
