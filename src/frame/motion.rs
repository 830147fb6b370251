//! How the camera came to where it is: `Motion` of `kernels/lib/motion.wgsl`.

use super::Block;
use crate::kernel::FieldKind::{F32, U32};

pub const BLOCK: Block = Block {
    name: "Motion",
    fields: &[("travelled_m", F32(1)), ("turned", F32(1)), ("is_cut", U32(1))],
    changes: true,
    fill: |frame, values| {
        values.add(frame.travelled_m as f32).add(frame.turned as f32).add(u32::from(frame.is_cut));
    },
};
