//! How high the ground is, seen from the eye: `Relief` of `kernels/lib/relief.wgsl`.

use super::Block;
use crate::kernel::FieldKind::F32;

pub const BLOCK: Block = Block {
    name: "Relief",
    fields: &[("low_m", F32(1)), ("range_m", F32(1))],
    changes: true,
    fill: |frame, values| {
        let (low, high) = frame.data.ground.range_m();
        values.add((low - frame.camera.eye_m.z) as f32).add(height_range_m(low, high) as f32);
    },
};

/// The range that heights are shares of; on a flat terrain all of them are at its lower end.
pub fn height_range_m(low: f64, high: f64) -> f64 {
    if high > low { high - low } else { 1.0 }
}
