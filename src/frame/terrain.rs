//! Where the ground's samples are, seen from the eye: `Terrain` of `kernels/lib/terrain.wgsl`.

use super::Block;
use crate::kernel::FieldKind::{F32, I32, U32};

pub const BLOCK: Block = Block {
    name: "Terrain",
    fields: &[
        ("size", U32(2)),
        ("eye_cell", I32(2)),
        ("eye_fraction", F32(2)),
        ("cell_m", F32(2)),
        ("eye_height_m", F32(2)),
    ],
    changes: true,
    fill: |frame, values| {
        let lattice = frame.data.ground.lattice();
        let eye_m = frame.camera.eye_m;
        let sample = lattice.sample_from_world(eye_m.truncate());
        let high = eye_m.z as f32;
        let nearest = sample.round();
        values
            .add(lattice.size.to_array())
            .add(nearest.as_ivec2().to_array())
            .add((sample - nearest).as_vec2().to_array())
            .add(lattice.cell_m.as_vec2().to_array())
            .add([high, (eye_m.z - f64::from(high)) as f32]);
    },
};
