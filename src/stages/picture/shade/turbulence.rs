//! Turbulence that moves the places whose colour is looked up (`kernels/lib/turbulence.wgsl`).

use glam::{DVec2, I64Vec2, UVec2};

use crate::experiment::diagnostic::Diagnostic;
use crate::ground::octaves::{EVERYWHERE, Place, noise};
use crate::kernel::{Elem, Packing};
use crate::plan::{BufferId, Chain};
use crate::reference::Values;

const SEEDS: [u32; 2] = [0x51ed_270b, 0x2545_f491];
/// The finest octave that is made for each pixel.
const FINEST: u32 = 8;
/// Of the texture: texels along its side at its finest level, its levels, and the cells that it covers.
const TEXELS: u32 = 512;
const LEVELS: u32 = 4;
const PERIOD: u32 = 16;

/// Where a level begins; after the last one, how many texels there are.
fn start(level: u32) -> u32 {
    (0..level).map(|finer| (TEXELS >> finer).pow(2)).sum()
}

/// A step that makes the texture, once.
pub fn make_texture(chain: &mut Chain) -> Result<BufferId, Diagnostic> {
    let texels = start(LEVELS);
    let meaning = "periodic turbulence of 512 x 512 texels over 16 x 16 cells, then its levels; east in the lowest byte, south in the next";
    let texture = chain.make("turbulence", Elem::U32, &[texels], "", meaning);
    chain.set_packing(texture, Packing::Bytes);
    let kernel = chain.kernel("picture/shade_turbulence.wgsl")?;
    chain.step("turbulence", &kernel, "main").bind("turbulence_texture", texture).over(UVec2::new(texels, 1))?;
    Ok(texture)
}

/// Octaves below a split, as `turbulence` of the kernel has them.
fn turbulence(place: &Place, split: f64, finest: u32, period_cells: u32) -> DVec2 {
    let octave = |k: u32| {
        let nodes = if period_cells > 0 { i64::from((period_cells << k) >> 2) - 1 } else { EVERYWHERE };
        let weight = (split - f64::from(k)).clamp(0.0, 1.0) * 0.5f64.powi(k as i32);
        weight * DVec2::from(SEEDS.map(|seed| noise(place, k, seed, nodes).0))
    };
    (1..=finest).filter(|k| f64::from(*k) < split).map(octave).sum()
}

/// What the texture has to hold: values of bytes, which rounding may move by one.
pub fn texture() -> Values {
    let mut values = Values::missing(&[start(LEVELS)], 4);
    for level in 0..LEVELS {
        let side = TEXELS >> level;
        for at in 0..side * side {
            let cells =
                (DVec2::new((at % side).into(), (at / side).into()) + 0.5) * f64::from(PERIOD) / f64::from(side);
            let place = Place::new(cells, I64Vec2::ZERO);
            let moved = turbulence(&place, f64::from(LEVELS - level) + 1.0, LEVELS, PERIOD);
            let bytes = (0.5 + 0.5 * moved) * 255.0;
            let first = 4 * (start(level) + at) as usize;
            for (part, byte) in [bytes.x, bytes.y, 0.0, 0.0].into_iter().enumerate() {
                values.set(first + part, byte.round(), if part < 2 { 1.0 } else { 0.0 });
            }
        }
    }
    values
}

/// Turbulence at the places of pixels.
pub enum Turbulent<'a> {
    ByPixel,
    ByTexture(&'a Values),
}

impl Turbulent<'_> {
    /// How far a place is moved, as a part of the most; `split` is the octave with waves of two pixels.
    pub fn moved(&self, place: &Place, split: f64) -> DVec2 {
        let Turbulent::ByTexture(texture) = self else { return turbulence(place, split, FINEST, 0) };
        let level = (5.0 - split).clamp(0.0, LEVELS.into());
        let finer = level.floor().min(f64::from(LEVELS - 1));
        let of_level = |level: u32| if level < LEVELS { blended(texture, level, place) } else { DVec2::ZERO };
        of_level(finer as u32).lerp(of_level(finer as u32 + 1), level - finer)
    }

    /// How far off that can be, as a part of the most.
    pub fn off(&self) -> f64 {
        match self {
            Turbulent::ByPixel => 0.0,
            Turbulent::ByTexture(texture) => 2.0 * texture.bound.first().copied().unwrap_or_default() / 255.0,
        }
    }
}

fn blended(texture: &Values, level: u32, place: &Place) -> DVec2 {
    let side = i64::from(TEXELS >> level);
    let cells = (place.cell & i64::from(PERIOD - 1)).as_dvec2() + place.fraction;
    let at = cells * (side as f64 / f64::from(PERIOD)) - 0.5;
    let (low, w) = (at.floor(), at - at.floor());
    let texel = |x: i64, y: i64| {
        let (x, y) = ((low.x as i64 + x) & (side - 1), (low.y as i64 + y) & (side - 1));
        let first = 4 * (i64::from(start(level)) + y * side + x) as usize;
        2.0 * DVec2::new(texture.value[first], texture.value[first + 1]) / 255.0 - 1.0
    };
    texel(0, 0).lerp(texel(1, 0), w.x).lerp(texel(0, 1).lerp(texel(1, 1), w.x), w.y)
}
