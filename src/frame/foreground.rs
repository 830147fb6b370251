//! The surface in the cells next to the eye: `Foreground` of `kernels/ground/foreground.wgsl`.

use super::Block;
use crate::ground::foreground::cells;
use crate::kernel::FieldKind::{self, F32};

macro_rules! fields {
    ($($at:literal)*) => {
        &[$((concat!("north_west.", $at), F32(4)),)* $((concat!("south_east.", $at), F32(4)),)* ("range_m", F32(2))]
    };
}

const FIELDS: &[(&str, FieldKind)] = fields!(0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15);

/// By how much the range of heights is widened, as a part of the largest of them: more than f32 takes from any.
const WIDER: f64 = 1e-5;

pub const BLOCK: Block = Block {
    name: "Foreground",
    fields: FIELDS,
    changes: true,
    fill: |frame, values| {
        let surface = frame.data.scene.surface;
        let near = cells(frame.data.ground.as_ref(), frame.camera.eye_m);
        for is_north_west in [true, false] {
            for near in &near {
                let formula = near.map(|near| near.cell.formula(near.corner, surface, is_north_west));
                values.add(formula.map_or([0.0; 4], |formula| formula.as_vec4().to_array()));
            }
        }
        let ranges = || near.iter().flatten().map(|near| near.cell.range());
        let low = ranges().map(|(low, _)| low).fold(f64::from(f32::MAX), f64::min);
        let high = ranges().map(|(_, high)| high).fold(f64::from(f32::MIN), f64::max);
        let more = WIDER * low.abs().max(high.abs());
        values.add([low - more, high + more].map(|height_m| height_m as f32));
    },
};
