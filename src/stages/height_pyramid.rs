use std::sync::Arc;

use glam::UVec2;
use serde::Deserialize;

use super::{EPSILON, Info, Stage, read_params};
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Kernel};
use crate::plan::Chain;
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "HeightPyramid",
    summary: "mean, minimum and maximum pyramids of the height samples",
    formula: "max_k(node) = max of the surface over 2^k x 2^k cells; mean_k(node) = mean of 2^k x 2^k samples",
    source: "Livny et al. 2008, section 3.4 (mean); Loeffler et al. 2009, section 4 (minimum, maximum)",
    reads: &["height"],
    writes: &["height_max", "height_min", "height_mean"],
    kernels: &["height_pyramid.wgsl"],
    params: &[("max_level", "None", "coarsest level of the mean pyramid; None is up to a single node")],
    read: |node, _| read_params::<HeightPyramid>(node),
};

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HeightPyramid {
    max_level: Option<u32>,
}

/// Where the levels of a pyramid are; the layout of `kernels/lib/pyramid.wgsl`.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    pub base: UVec2,
    /// Row stride: the width of level 1.
    pub stride: u32,
    /// The power of two not below the height of the base.
    pub tall: u32,
    /// The coarsest level, the first with a single node.
    pub top: u32,
}

impl Layout {
    pub fn new(base: UVec2) -> Self {
        let base = base.max(UVec2::ONE);
        let top = base.max_element().next_power_of_two().trailing_zeros().max(1);
        Self { base, stride: base.x.div_ceil(2), tall: base.y.next_power_of_two(), top }
    }

    /// Nodes of a level.
    pub fn size(&self, level: u32) -> UVec2 {
        UVec2::new(self.base.x.div_ceil(1 << level), self.base.y.div_ceil(1 << level))
    }

    pub fn index(&self, level: u32, x: u32, y: u32) -> usize {
        ((self.tall - (self.tall >> (level - 1)) + level - 1 + y) * self.stride + x) as usize
    }

    /// Rows and columns of the buffer.
    pub fn dims(&self) -> [u32; 2] {
        let last = self.index(self.top, 0, 0) as u32 / self.stride;
        [last + self.size(self.top).y, self.stride]
    }
}

/// Layout of the minimum and maximum pyramids: their base is cells.
pub fn bounds_layout(samples: UVec2) -> Layout {
    Layout::new(samples - 1)
}

impl Stage for HeightPyramid {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let size = chain.data.terrain.size;
        let (bounds, mean) = (bounds_layout(size), Layout::new(size));
        let height = chain.read_as("height", Elem::F32, &[size.y, size.x])?;
        let highest = chain.make("height_max", Elem::F32, &bounds.dims(), "m", "maximum pyramid over cells");
        let lowest = chain.make("height_min", Elem::F32, &bounds.dims(), "m", "minimum pyramid over cells");
        let means = chain.make("height_mean", Elem::F32, &mean.dims(), "m", "mean pyramid over samples");
        let kernel = Kernel::built_in("height_pyramid.wgsl")?;
        let mean_top = self.max_level.unwrap_or(mean.top).min(mean.top);
        chain.set_top_level(means, mean_top);
        if mean_top < mean.top {
            let nodes = |level| u64::from(mean.size(level).element_product());
            let saved = (mean_top + 1..=mean.top).map(nodes).sum::<u64>();
            let what = format!("mean levels {} to {}", mean_top + 1, mean.top);
            chain.leave_out(&what, "`max_level` says nobody samples them", saved * 4, saved);
        }
        let top = bounds.top.max(mean_top);
        for level in (1..=top).step_by(3) {
            let levels = (top - level + 1).min(3);
            let label = format!("levels {level} to {}", level + levels - 1);
            let mut step = chain
                .step(&label, &kernel, "main")
                .bind("height", height)
                .constant("FROM_SAMPLES", f64::from(level == 1));
            // past its own top a pyramid has nothing to write
            if level <= bounds.top {
                step = step.bind_if_wanted("height_max", highest, "WRITE_MAX").bind_if_wanted(
                    "height_min",
                    lowest,
                    "WRITE_MIN",
                );
            } else {
                step = step.bind("height_max", highest).bind("height_min", lowest);
                step = step.constant("WRITE_MAX", 0.0).constant("WRITE_MIN", 0.0);
            }
            if level <= mean_top {
                step = step.bind_if_wanted("height_mean", means, "WRITE_MEAN");
            } else {
                step = step.bind("height_mean", means).constant("WRITE_MEAN", 0.0);
            }
            step.set("size", size.to_array())
                .set("level", level)
                .set("levels", levels)
                .set("bounds_stride", bounds.stride)
                .set("bounds_tall", bounds.tall)
                .set("mean_stride", mean.stride)
                .set("mean_tall", mean.tall)
                .over(Layout::new(size).size(level - 1).map(|side| side.div_ceil(8)).max(UVec2::ONE))?;
        }
        Ok(())
    }

    fn reference(&self, frame: &Frame, buffers: &mut Buffers) {
        let size = frame.data.terrain.size;
        let height = buffers.get("height").clone();
        let (bounds, mean) = (bounds_layout(size), Layout::new(size));
        let mut highest = Values::missing(&bounds.dims(), 1);
        let mut lowest = Values::missing(&bounds.dims(), 1);
        let mut means = Values::missing(&mean.dims(), 1);
        for level in 1..=bounds.top {
            for (x, y) in nodes(bounds.size(level)) {
                // the surface over cells [x 2^k, (x + 1) 2^k) touches one sample more than it has cells
                let over = covered(&height, size, level, x, y, 1);
                let at = bounds.index(level, x, y);
                highest.set(at, over.iter().copied().fold(f64::MIN, f64::max), 0.0);
                lowest.set(at, over.iter().copied().fold(f64::MAX, f64::min), 0.0);
            }
        }
        for level in 1..=self.max_level.unwrap_or(mean.top).min(mean.top) {
            for (x, y) in nodes(mean.size(level)) {
                let over = covered(&height, size, level, x, y, 0);
                let largest = over.iter().fold(0.0, |largest: f64, height| largest.max(height.abs()));
                let value = over.iter().sum::<f64>() / over.len() as f64;
                // four additions, a multiplication by the count and a division a level, all of them means of
                // values no larger than the largest
                means.set(mean.index(level, x, y), value, 6.0 * f64::from(level) * EPSILON * largest);
            }
        }
        buffers.put("height_max", highest);
        buffers.put("height_min", lowest);
        buffers.put("height_mean", means);
    }
}

fn nodes(size: UVec2) -> impl Iterator<Item = (u32, u32)> {
    (0..size.y).flat_map(move |y| (0..size.x).map(move |x| (x, y)))
}

/// The samples under node (x, y) of a level, `extra` more at the far sides.
fn covered(height: &Arc<Values>, size: UVec2, level: u32, x: u32, y: u32, extra: u32) -> Vec<f64> {
    let end = |at: u32, side: u32| (((at + 1) << level) + extra).min(side);
    let rows = (y << level)..end(y, size.y);
    rows.flat_map(|row| ((x << level)..end(x, size.x)).map(move |column| (row * size.x + column) as usize))
        .map(|at| height.value[at])
        .collect()
}
