use glam::DVec2;
use rayon::prelude::*;

use super::RayCast;
use crate::plan::product::Drawn;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::first_hit::first_hit;

impl Reference for RayCast {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let (width_px, height_px) = frame.camera.viewport;
        let pixels: Vec<(f64, f64)> = (0..height_px)
            .into_par_iter()
            .flat_map_iter(|y| (0..width_px).map(move |x| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)))
            .map(|pixel| first_hit(frame, pixel))
            .collect();
        let mut distance = Values::missing(&[height_px, width_px], 1);
        for (at, (value, bound)) in pixels.into_iter().enumerate() {
            distance.set(at, value, bound);
        }
        let distance = buffers.put("distance", distance);
        buffers.offer(Drawn { distance, error: None, mesh: None, promise: None });
        Ok(())
    }
}
