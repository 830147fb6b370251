use glam::DVec2;
use rayon::prelude::*;
use serde::Deserialize;

use super::ray_cast::{Traversed, first_hit};
use super::{Info, Stage, read_params};
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Kernel};
use crate::plan::Chain;
use crate::reference::{Buffers, Frame};

pub const INFO: Info = Info {
    name: "RayFill",
    summary: "exact first hit for the pixels of a list, in place of what the mesh drew there",
    formula: "as RayCast; from where the mesh was hit if the mesh is nowhere under the surface",
    source: "Loeffler et al. 2009, section 4 (rendering); the start at the mesh is ours",
    reads: &["height", "height_max", "height_min", "distance", "error", "pixels", "pixels_count"],
    writes: &["distance"],
    kernels: &["ray_fill.wgsl"],
    params: &[("pixels", "\"pixels\"", "the list, as `Compact` makes it")],
    read: |node, _| read_params::<RayFill>(node),
};

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RayFill {
    pixels: String,
}

impl Default for RayFill {
    fn default() -> Self {
        Self { pixels: "pixels".into() }
    }
}

impl Stage for RayFill {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let (width, tall) = chain.data.scene.viewport;
        let terrain = Traversed::read(chain)?;
        let pixels = chain.read_as(&self.pixels, Elem::U32, &[width * tall])?;
        let count = chain.read_as(&format!("{}_count", self.pixels), Elem::U32, &[4])?;
        let distance = chain.read_as("distance", Elem::F32, &[tall, width])?;
        let error = chain.read_as("error", Elem::F32, &[tall, width])?;
        let is_proven = |buffer| chain.promise_of(buffer).is_some_and(|promise| promise.proven);
        let from_mesh = is_proven(distance) && is_proven(error);
        let start = terrain.lead_tiles(chain)?;
        let kernel = Kernel::built_in("ray_fill.wgsl")?;
        terrain
            .step(chain, "fill", &kernel, "main")
            .constant("FROM_MESH", f64::from(from_mesh))
            .bind("height", terrain.height)
            .bind("height_min", terrain.lowest)
            .bind("clear_until", start)
            .bind("pixels", pixels)
            .bind("pixels_count", count)
            .bind("error", error)
            .bind("distance", distance)
            .over_indirect(count)
    }

    fn reference(&self, frame: &Frame, buffers: &mut Buffers) {
        let pixels = buffers.get(&self.pixels);
        let count = buffers.get(&format!("{}_count", self.pixels));
        let mut distance = (*buffers.get("distance")).clone();
        if count.bound[3].is_infinite() {
            // any pixel may be on the list
            distance.bound.fill(f64::INFINITY);
            return buffers.put("distance", distance);
        }
        let count = count.value[3] as usize;
        let (width, _) = frame.camera.viewport;
        let hits: Vec<(usize, f64, f64)> = pixels.value[..count.min(pixels.value.len())]
            .par_iter()
            .map(|&number| {
                let number = number as usize;
                let place = DVec2::new((number % width as usize) as f64, (number / width as usize) as f64) + 0.5;
                let (value, bound) = first_hit(frame, place);
                (number, value, bound)
            })
            .collect();
        hits.into_iter().for_each(|(number, value, bound)| distance.set(number, value, bound));
        buffers.put("distance", distance);
    }
}
