use glam::DVec2;
use rayon::prelude::*;
use serde::Deserialize;

use super::ray_cast::{TILE, Traversed, first_hit};
use super::{Info, Stage, read_params};
use crate::experiment::diagnostic::Diagnostic;
use crate::plan::Chain;
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "LeadRays",
    summary: "how far the rays of each tile of pixels can go at once before any of them can meet the surface",
    formula: "clear_until <= min over the tile's rays of the depth of their first hit; without end if a bundle meets nothing",
    source: "ours; the coarse pass of RayCast as a stage, so that sky is known before pixels are listed",
    reads: &["height_max"],
    writes: &["clear_until"],
    kernels: &[],
    params: &[],
    read: |node, _| read_params::<LeadRays>(node),
};

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LeadRays {}

impl Stage for LeadRays {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        Traversed::read(chain)?.lead_tiles(chain).map(|_| ())
    }

    fn reference(&self, frame: &Frame, buffers: &mut Buffers) {
        let (width, tall) = frame.camera.viewport;
        let (across, down) = (width.div_ceil(TILE), tall.div_ceil(TILE));
        let nearest = |tile: u32| {
            let (x, y) = (tile % across * TILE, tile / across * TILE);
            let pixels = (y..(y + TILE).min(tall)).flat_map(|y| (x..(x + TILE).min(width)).map(move |x| (x, y)));
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
    }
}
