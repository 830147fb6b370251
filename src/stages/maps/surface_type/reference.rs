use glam::{DVec2, UVec2};

use super::{NO_WATER_M, SurfaceType};
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::rounding::EPSILON;

const WATER: f64 = 0.0;
const ROCK: f64 = 1.0;
const SNOW: f64 = 2.0;
const MEADOW: f64 = 3.0;

impl Reference for SurfaceType {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let height = buffers.get("height")?;
        let size = frame.lattice().size;
        let mut types = Values::missing(&height.dims, 1);
        let limits = self.limits(frame);
        for (y, x) in (0..size.y).flat_map(|y| (0..size.x).map(move |x| (y, x))) {
            let at = UVec2::new(x, y);
            let (slope, off_slope) = slope(frame, &height, at);
            let found = |sign: f64| {
                let index = (y * size.x + x) as usize;
                classify(height.value[index] + sign * height.bound[index], slope + sign * off_slope, limits)
            };
            // where rounding decides, it may be either
            let is_open = found(-1.0) != found(1.0) || found(0.0) != found(1.0);
            types.set((y * size.x + x) as usize, found(0.0), if is_open { f64::INFINITY } else { 0.0 });
        }
        buffers.put("surface_type", types);
        Ok(())
    }
}

/// Water, slope of rock and snow, as f32 has them.
type Limits = [f64; 3];

impl SurfaceType {
    fn limits(&self, frame: &Frame) -> Limits {
        let snow_m = self.snow_m(frame.data.ground.range_m());
        [self.water_m.unwrap_or(NO_WATER_M), self.rock_deg.to_radians().tan(), snow_m]
            .map(|number| f64::from(number as f32))
    }
}

fn classify(height_m: f64, slope: f64, [water_m, rock_slope, snow_m]: Limits) -> f64 {
    match () {
        _ if height_m <= water_m => WATER,
        _ if slope > rock_slope => ROCK,
        _ if height_m > snow_m => SNOW,
        _ => MEADOW,
    }
}

/// How steep the ground is at a sample, with its bound.
fn slope(frame: &Frame, height: &Values, at: UVec2) -> (f64, f64) {
    let lattice = frame.lattice();
    let (low, high) = (at.max(UVec2::ONE) - 1, (at + 1).min(lattice.last()));
    let sample = |x: u32, y: u32| {
        let index = (y * lattice.size.x + x) as usize;
        (height.value[index], height.bound[index])
    };
    let across = (sample(high.x, at.y), sample(low.x, at.y));
    let along = (sample(at.x, high.y), sample(at.x, low.y));
    let apart_m = (high - low).as_dvec2() * lattice.cell_m;
    let slope = (DVec2::new(across.0.0 - across.1.0, along.0.0 - along.1.0) / apart_m).length();
    let off = DVec2::new(across.0.1 + across.1.1, along.0.1 + along.1.1) / apart_m;
    // two differences, a product, a division, two squares, their sum and its root
    (slope, off.length() + 16.0 * EPSILON * slope)
}
