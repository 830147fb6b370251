use glam::DVec2;
use rayon::prelude::*;

use super::LeadRays;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::first_hit::first_hit;
use crate::stages::shared::traversal::TILE;

impl Reference for LeadRays {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let (width_px, height_px) = frame.camera.viewport;
        let (across, down) = (width_px.div_ceil(TILE), height_px.div_ceil(TILE));
        let nearest = |tile: u32| {
            let (x, y) = (tile % across * TILE, tile / across * TILE);
            let pixels =
                (y..(y + TILE).min(height_px)).flat_map(|y| (x..(x + TILE).min(width_px)).map(move |x| (x, y)));
            let depth = |(x, y): (u32, u32)| {
                let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let (distance, bound) = first_hit(frame, pixel);
                // a ray whose hit hangs on rounding may meet nothing
                let nearest = if bound.is_infinite() { f64::INFINITY } else { distance + bound };
                nearest * frame.camera.ray(pixel).dot(frame.camera.forward())
            };
            pixels.map(depth).filter(|depth| !depth.is_nan()).fold(f64::INFINITY, f64::min)
        };
        let nearest: Vec<f64> = (0..across * down).into_par_iter().map(nearest).collect();
        let mut clear = Values::missing(&[down, across], 1);
        for (at, depth) in nearest.into_iter().enumerate() {
            // anything between the eye and the nearest hit is right; over sky, any f32 at all
            let bound = if depth.is_finite() { 0.5 * depth * (1.0 + 1e-5) } else { 4e38 };
            let value = if depth.is_finite() { 0.5 * depth } else { 0.0 };
            clear.set(at, value, bound);
        }
        buffers.put("clear_until", clear);
        Ok(())
    }
}
