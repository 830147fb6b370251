//! Rays of pixels: `Camera` of `kernels/lib/camera.wgsl`.

use glam::DVec3;

use super::Block;
use crate::kernel::FieldKind::{F32, U32};

pub const BLOCK: Block = Block {
    name: "Camera",
    fields: &[
        ("corner_hi", F32(3)),
        ("corner_lo", F32(3)),
        ("right_hi", F32(3)),
        ("right_lo", F32(3)),
        ("down_hi", F32(3)),
        ("down_lo", F32(3)),
        ("viewport", U32(2)),
    ],
    changes: true,
    fill: |frame, values| {
        let [right, down, corner] = frame.camera.pixel_basis();
        for part in [corner, right, down] {
            let (high, low) = split(part);
            values.add(high).add(low);
        }
        let (width, height) = frame.camera.viewport;
        values.add([width, height]);
    },
};

/// Splits each component into a multiple of 2^-22 and what is missing; see `Camera` in `kernels/lib/camera.wgsl`.
fn split(vector: DVec3) -> ([f32; 3], [f32; 3]) {
    const QUANTUM: f64 = 1.0 / 4_194_304.0;
    let high = (vector / QUANTUM).round() * QUANTUM;
    (high.as_vec3().to_array(), (vector - high).as_vec3().to_array())
}
