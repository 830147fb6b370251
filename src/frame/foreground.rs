//! The surface in the cells next to the eye: `Foreground` of `kernels/ground/foreground.wgsl`.

use glam::{DVec2, IVec2};

use super::{Block, FrameInput};
use crate::ground::cell::{Cell, Formula};
use crate::kernel::FieldKind::{self, F32};

/// Cells a side.
const SIDE: i32 = 4;

macro_rules! fields {
    ($($at:literal)*) => {
        &[$((concat!("north_west.", $at), F32(4)),)* $((concat!("south_east.", $at), F32(4)),)*]
    };
}

const FIELDS: &[(&str, FieldKind)] = fields!(0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15);

pub const BLOCK: Block = Block {
    name: "Foreground",
    fields: FIELDS,
    changes: true,
    fill: |frame, values| {
        for is_north_west in [true, false] {
            for at in 0..SIDE * SIDE {
                let formula = formula(frame, IVec2::new(at % SIDE, at / SIDE) - SIDE / 2, is_north_west);
                values.add(formula.map_or([0.0; 4], |formula| formula.as_vec4().to_array()));
            }
        }
    },
};

/// The surface of a cell, counted from the sample nearest to the eye; `None` beyond the border.
fn formula(frame: &FrameInput, from_eye: IVec2, is_north_west: bool) -> Option<Formula> {
    let ground = frame.data.ground.as_ref();
    let (lattice, eye_m) = (ground.lattice(), frame.camera.eye_m);
    let eye = lattice.sample_from_world(eye_m.truncate());
    let nearest = eye.round();
    let at = nearest.as_ivec2().checked_add(from_eye)?;
    let last = lattice.last().as_ivec2();
    if at.cmplt(IVec2::ZERO).any() || at.cmpge(last).any() {
        return None;
    }
    let height_m = |x, y| ground.height_m((at + IVec2::new(x, y)).as_uvec2()) - eye_m.z;
    let cell = Cell { nw: height_m(0, 0), ne: height_m(1, 0), sw: height_m(0, 1), se: height_m(1, 1) };
    let corner: DVec2 = from_eye.as_dvec2() + (nearest - eye);
    Some(cell.formula(corner, frame.data.scene.surface, is_north_west))
}
