use glam::DVec2;

use super::{Differences, Slope};
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::rounding::EPSILON;

/// WGSL lets `atan` and `atan2` be off by 4096 units in the last place.
const ATAN_OFF: f64 = 4096.0 * 2.0 * EPSILON;

impl Reference for Slope {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let height = buffers.get("height")?;
        let size = frame.lattice().size;
        let mut slope = Values::missing(&height.dims, 1);
        let mut aspect = Values::missing(&height.dims, 1);
        for (y, x) in (0..size.y).flat_map(|y| (0..size.x).map(move |x| (y, x))) {
            let sample = |dx: i64, dy: i64| {
                let inside = |at: u32, by: i64, side: u32| (i64::from(at) + by).clamp(0, i64::from(side) - 1) as u32;
                height.value[(inside(y, dy, size.y) * size.x + inside(x, dx, size.x)) as usize]
            };
            let (gradient, off) = self.gradient(frame, sample);
            let at = (y * size.x + x) as usize;
            let angle = gradient.length().atan();
            // an angle changes by no more than its tangent
            let rounded = off + 8.0 * EPSILON * gradient.length() + (ATAN_OFF + 8.0 * EPSILON) * angle;
            slope.set(at, angle.to_degrees(), rounded.to_degrees());
            let (value, bound) = falls_to(gradient, off);
            aspect.set(at, value, bound);
        }
        buffers.put("slope", slope);
        buffers.put("aspect", aspect);
        Ok(())
    }
}

impl Slope {
    /// Rise to the east and to the north, a metre each, and how far f32 may be from it.
    fn gradient(&self, frame: &Frame, sample: impl Fn(i64, i64) -> f64) -> (DVec2, f64) {
        let weights = match self.differences {
            Differences::Horn => [1.0, 2.0, 1.0],
            Differences::Central => [0.0, 1.0, 0.0],
        };
        let total = 2.0 * weights.iter().sum::<f64>();
        let (mut rise, mut terms) = (DVec2::ZERO, DVec2::ZERO);
        for (beside, weight) in (-1..=1).zip(weights) {
            let here = DVec2::new(sample(1, beside) - sample(-1, beside), sample(beside, -1) - sample(beside, 1));
            rise += here * (weight / total);
            terms += here.abs() * (weight / total);
        }
        let cell_m = frame.lattice().cell_m;
        // a difference, four sums and products, the cell's size and a division
        (rise / cell_m, (terms * 12.0 * EPSILON / cell_m).length())
    }
}

/// The way down in degrees clockwise from north, with its bound; nothing where the ground is level.
fn falls_to(gradient: DVec2, off: f64) -> (f64, f64) {
    if gradient == DVec2::ZERO && off == 0.0 {
        return (f64::NAN, f64::MIN_POSITIVE);
    }
    let clockwise = (-gradient.x).atan2(-gradient.y);
    let turned = off / gradient.length() + ATAN_OFF * clockwise.abs() + 32.0 * EPSILON;
    let degrees = clockwise.to_degrees().rem_euclid(360.0);
    // next to north the angle may be on either side of it, and all but level ground may fall anywhere
    let is_open = turned.is_nan() || turned >= 0.5 || degrees.min(360.0 - degrees) <= turned.to_degrees();
    (degrees, if is_open { f64::INFINITY } else { turned.to_degrees() })
}
