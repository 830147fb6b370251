//! Where the levels over the ground's cells are: `Pyramid` of `kernels/lib/pyramid.wgsl`.

use super::Block;
use crate::kernel::FieldKind::U32;

pub const BLOCK: Block = Block {
    name: "Pyramid",
    fields: &[("stride", U32(1)), ("tall_pow2", U32(1)), ("top", U32(1))],
    changes: false,
    fill: |frame, values| {
        let layout = frame.data.ground.lattice().cells();
        values.add(layout.stride).add(layout.tall_pow2).add(layout.top);
    },
};
