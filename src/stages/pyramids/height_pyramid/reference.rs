use std::sync::Arc;

use glam::UVec2;

use super::HeightPyramid;
use crate::plan::product::NodeRanges;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::rounding::EPSILON;

impl Reference for HeightPyramid {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let size = frame.lattice().size;
        let height = buffers.get("height")?;
        let (bounds, mean) = (frame.lattice().cells(), frame.lattice().means());
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
        let highest = buffers.put("height_max", highest);
        let lowest = buffers.put("height_min", lowest);
        buffers.offer(NodeRanges { lowest, highest });
        buffers.put("height_mean", means);
        Ok(())
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
