//! Procedural terrain: fractals of the `noise` crate over a lattice and a place that come from the seed.
//!
//! The same seed gives the same terrain everywhere and in every version: ChaCha with 12 rounds is a published stream, and the numbers are
//! taken from its bits here.

use noise::{Billow, Fbm, HybridMulti, MultiFractal, NoiseFn, Perlin, RidgedMulti};
use rand::rngs::ChaCha12Rng;
use rand::{Rng, SeedableRng};
use rayon::prelude::*;

use super::{HeightField, TerrainError};
use crate::experiment::scene::{Noise, NoiseKind};

type Field = Box<dyn Fn([f64; 2]) -> f64 + Sync + Send>;

/// Values of octaves that are summed up over a terrain: 16 octaves of the largest. Each takes some 20 ns.
const MOST_VALUES: u64 = 1 << 32;
/// Waves of the finest octave.
const LARGEST_LATTICE: f64 = 1e12;

pub fn generate(spec: &Noise) -> Result<HeightField, TerrainError> {
    let bad = |what: String| Err(TerrainError::Parameter(what));
    if !(1..=32).contains(&spec.octaves) {
        return bad(format!("{} octaves; 1 to 32 can be summed", spec.octaves));
    }
    if !(spec.wavelength_m > 0.0 && spec.wavelength_m.is_finite()) {
        return bad(format!("a wavelength of {} m", spec.wavelength_m));
    }
    let numbers = [spec.lacunarity, spec.persistence, spec.warp_m, spec.height_m.0, spec.height_m.1];
    if !numbers.iter().all(|number| number.is_finite()) || !(0.0..=4.0).contains(&spec.persistence) {
        return bad("lacunarity, warp and heights have to be numbers, and persistence one from 0 to 4".into());
    }
    let fractals = if spec.kind == NoiseKind::DomainWarped { 3 } else { 1 };
    let values = u64::from(spec.size.0) * u64::from(spec.size.1) * u64::from(spec.octaves) * fractals;
    if values > MOST_VALUES {
        let (columns, rows) = spec.size;
        return bad(format!(
            "{columns} x {rows} samples of {} octaves take too long; at most {MOST_VALUES} values are summed up",
            fractals * u64::from(spec.octaves)
        ));
    }
    // the lattice of the noise is counted in integers
    let (cell_x, cell_y) = spec.cell_m.xy();
    let extent_m = f64::from(spec.size.0) * cell_x + f64::from(spec.size.1) * cell_y + 4.0 * spec.warp_m.abs();
    let farthest = (256.0 + extent_m / spec.wavelength_m) * spec.lacunarity.abs().max(1.0).powi(spec.octaves as i32);
    if farthest.is_nan() || farthest > LARGEST_LATTICE {
        return bad(format!("the finest octave has {farthest:.1e} waves; {LARGEST_LATTICE:.0e} can be counted"));
    }
    let mut random = ChaCha12Rng::seed_from_u64(spec.seed);
    // a lattice repeats every 256 units, so a random place in it is as good as a random lattice
    let place = [256.0 * share(&mut random), 256.0 * share(&mut random)];
    let field = noise_field(spec, &mut random);
    let (columns, rows) = spec.size;
    let (cell_x, cell_y) = spec.cell_m.xy();
    let (low, high) = spec.height_m;
    let heights_m = (0..rows).into_par_iter().flat_map_iter(|row| {
        let field = &field;
        (0..columns).map(move |column| {
            let x_m = f64::from(column) * cell_x;
            let y_m = f64::from(rows - 1 - row) * cell_y;
            let value = field([place[0] + x_m / spec.wavelength_m, place[1] + y_m / spec.wavelength_m]);
            (low + (high - low) * (value * 0.5 + 0.5)) as f32
        })
    });
    Ok(HeightField { size: spec.size.into(), cell_m: spec.cell_m.xy().into(), heights_m: heights_m.collect() })
}

/// A number from 0 up to 1 of the 52 highest of the next 64 bits.
fn share(random: &mut ChaCha12Rng) -> f64 {
    (random.next_u64() >> 12) as f64 / (1u64 << 52) as f64
}

fn noise_field(spec: &Noise, random: &mut ChaCha12Rng) -> Field {
    // octaves without amplitude are left out: they cost time and add nothing
    let (octaves, persistence) =
        if spec.persistence == 0.0 { (1, 1.0) } else { (spec.octaves as usize, spec.persistence) };
    let seed = random.next_u32();
    macro_rules! fractal {
        ($kind:ident, $seed:expr) => {{
            let fractal = $kind::<Perlin>::new($seed)
                .set_octaves(octaves)
                .set_frequency(1.0)
                .set_lacunarity(spec.lacunarity)
                .set_persistence(persistence);
            move |place: [f64; 2]| fractal.get(place)
        }};
    }
    match spec.kind {
        NoiseKind::Fbm => Box::new(fractal!(Fbm, seed)),
        NoiseKind::Ridged => Box::new(fractal!(RidgedMulti, seed)),
        NoiseKind::Billow => Box::new(fractal!(Billow, seed)),
        NoiseKind::Hybrid => Box::new(fractal!(HybridMulti, seed)),
        NoiseKind::DomainWarped => {
            let (height, east, north) =
                (fractal!(Fbm, seed), fractal!(Fbm, random.next_u32()), fractal!(Fbm, random.next_u32()));
            let reach = spec.warp_m / spec.wavelength_m;
            Box::new(move |[x, y]| height([x + reach * east([x, y]), y + reach * north([x, y])]))
        }
    }
}
