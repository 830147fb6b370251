//! Importance that follows what the errors of the frame before ask for.

use glam::{DVec2, IVec2};

use super::product;
use crate::reference::{Absent, Buffers, Values};
use crate::stages::shared::rounding::{EPSILON, power};
use crate::stages::shared::sketch::Square;

/// Errors ask for at most so many times as many points as distance does; `FARTHEST` of the kernel.
const FARTHEST: f64 = 1024.0;

/// A value and its bound.
type Off = (f64, f64);

/// Points a metre that errors asked for in a texel.
pub struct Asked {
    value: Off,
    /// The texel's middle is so near to the border of the square before that it may be beyond it, where nothing is known.
    is_open: bool,
}

/// What errors asked for in the middle of each texel; nothing where the square of the frame before was not.
pub fn asked(previous: &Buffers, square: Square) -> Result<Vec<Option<Asked>>, Absent> {
    let demand = previous.get("error_demand")?;
    let before = Square::of(&*previous.get("error_square")?, square.texels);
    let texels = square.texels as i32;
    let places = (0..texels).flat_map(|y| (0..texels).map(move |x| IVec2::new(x, y)));
    Ok(places.map(|texel| asked_at(&demand, before, (square.middle(texel), square.texel_samples()))).collect())
}

/// Bilinear between the texels of the map of what was asked for.
fn asked_at(demand: &Values, before: Square, (sample, texel_samples): (DVec2, f64)) -> Option<Asked> {
    let cells = sample - before.first.as_dvec2() + 0.5;
    let side = f64::from(before.side);
    // half a texel by two operations and a division, and a sum
    let off_cells = EPSILON * (8.0 * texel_samples + 2.0 * cells.abs().max_element());
    let inside = cells.min(DVec2::splat(side) - cells).min_element();
    if inside < -off_cells {
        return None;
    }
    let texels = f64::from(demand.dims[0]);
    let last = demand.dims[0] - 1;
    let at = (cells / side * texels - 0.5).clamp(DVec2::ZERO, DVec2::splat(last.into()));
    let off = off_cells / side * texels + 8.0 * EPSILON * texels;
    let (low, w) = (at.floor().as_uvec2(), at - at.floor());
    let texel = |x: u32, y: u32| {
        let at = (y.min(last) * (last + 1) + x.min(last)) as usize;
        (demand.value[at], demand.bound[at])
    };
    let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| texel(low.x + x, low.y + y).0);
    let between = |a: f64, b: f64, w: f64| a + (b - a) * w;
    let value = between(between(four[0], four[1], w.x), between(four[2], four[3], w.x), w.y);
    // within `off` it meets the steepest slope around
    let around = (low.y.saturating_sub(1)..=low.y + 2)
        .flat_map(|y| (low.x.saturating_sub(1)..=low.x + 2).map(move |x| (x, y)))
        .map(|(x, y)| texel(x, y));
    let (least, most, bound) = around.fold((f64::MAX, 0.0f64, 0.0f64), |(least, most, bound), (value, off)| {
        (least.min(value), most.max(value), bound.max(off))
    });
    let bound = bound + 2.0 * (most - least) * off.min(1.0) + 8.0 * EPSILON * most;
    (value > 0.0 || bound > 0.0).then_some(Asked { value: (value, bound), is_open: inside < off_cells })
}

/// Lets the first of each texel's factors follow errors by a share; in all, they ask for as much importance as distance does.
pub fn follow(share: f64, factors: &mut [[Off; 4]], asked: &[Option<Asked>]) {
    let Some(scale) = scale(factors, asked) else { return };
    for (factors, asked) in factors.iter_mut().zip(asked) {
        let (Some(asked), (distance, off_distance)) = (asked, factors[0]) else { continue };
        if distance <= 0.0 {
            continue;
        }
        let (by_errors, off_errors) = product(scale, asked.value);
        let times = |by_errors: f64, distance: f64| (by_errors / distance).clamp(1.0 / FARTHEST, FARTHEST).powf(share);
        let at = times(by_errors, distance) * distance;
        // more is asked for where errors ask for more, and where distance does
        let (low, high) = ((distance - off_distance).max(f64::MIN_POSITIVE), distance + off_distance);
        let mut least = times((by_errors - off_errors).max(0.0), high) * low;
        let mut most = times(by_errors + off_errors, low) * high;
        // what may be unknown, or nothing, leaves it to distance
        if asked.is_open || by_errors <= off_errors {
            (least, most) = (least.min(low), most.max(high));
        }
        let rounding = power(FARTHEST, share) + 12.0 * EPSILON;
        let off = (most - at).max(at - least) + rounding * most;
        factors[0] = (at, if off.is_finite() { off } else { f64::INFINITY });
    }
}

/// All importance by distance over all importance by errors, where both are known.
fn scale(factors: &[[Off; 4]], asked: &[Option<Asked>]) -> Option<Off> {
    let (mut distance, mut errors) = ((0.0, 0.0), (0.0, 0.0));
    for (factors, asked) in factors.iter().zip(asked) {
        let Some(asked) = asked else { continue };
        if factors[0].0 > 0.0 {
            let seen = product(factors[1], factors[2]);
            // what may not count at all is off by all of it
            let add = |sum: &mut Off, (value, off): Off| {
                *sum = (sum.0 + value, sum.1 + if asked.is_open { value + off } else { off });
            };
            add(&mut distance, product(factors[0], seen));
            add(&mut errors, product(asked.value, seen));
        }
    }
    if errors.0 <= 0.0 {
        return None;
    }
    // each sum of a row and of rows is rounded as often as there are texels along a side, twice
    let rounding = 4.0 * EPSILON * (factors.len() as f64).sqrt() + 8.0 * EPSILON;
    let value = distance.0 / errors.0;
    let most = (distance.0 + distance.1) / (errors.0 - errors.1);
    let least = (distance.0 - distance.1).max(0.0) / (errors.0 + errors.1);
    let off = (most - value).max(value - least) + 2.0 * rounding * most;
    // where all errors may be nothing, anything is possible
    Some((value, if errors.1 < errors.0 { off } else { f64::INFINITY }))
}
