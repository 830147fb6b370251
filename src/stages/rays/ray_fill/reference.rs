use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::RayFill;
use crate::experiment::scene::Surface;
use crate::ground::cell::is_north_west;
use crate::plan::product::{Drawn, Listing};
use crate::reference::{Absent, Buffers, Frame, Reference, ValuesId};
use crate::stages::shared::border::border_margin_m;
use crate::stages::shared::first_hit::first_hit;
use crate::stages::shared::rounding::EPSILON;

impl Reference for RayFill {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let drawn: Drawn<_> = buffers.latest()?;
        let mut distance = (*buffers.values(drawn.distance)).clone();
        let threshold_px = drawn.promise.filter(|promise| promise.proven).map(|promise| promise.told_px(frame.data));
        let Some(blocks) = self.blocks(frame, buffers, &drawn)? else {
            // any pixel may be on the list
            distance.bound.fill(f64::INFINITY);
            buffers.replace(drawn.distance, distance);
            return Ok(());
        };
        let steepest = if blocks.rows == 1 { 0.0 } else { frame.ground.steepest() };
        let shared = Shared { frame, bound_px: threshold_px, steepest };
        let show = |Block { x, rows, is_sure }: &Block| match (is_sure, blocks.rows) {
            (false, _) => rows.iter().map(|&y| (*x, y, (f64::NAN, f64::INFINITY))).collect(),
            (true, 1) => rows.iter().map(|&y| (*x, y, first_hit(frame, centre(*x, y)))).collect(),
            (true, _) => shared.block(*x, rows),
        };
        let shown: Vec<Vec<Shows>> = blocks.listed.par_iter().map(show).collect();
        let width = frame.camera.viewport.0 as usize;
        for (x, y, (value, bound)) in shown.into_iter().flatten() {
            distance.set(y * width + x, value, bound);
        }
        buffers.replace(drawn.distance, distance);
        Ok(())
    }
}

/// Column and row of a pixel, and the distance that it shows with its bound.
type Shows = (usize, usize, (f64, f64));

/// The blocks of pixels that are filled.
struct Blocks {
    /// The most rows of a block.
    rows: usize,
    listed: Vec<Block>,
}

struct Block {
    x: usize,
    /// The rows of its pixels that are over the bound.
    rows: Vec<usize>,
    /// Rounding cannot turn which ones they are.
    is_sure: bool,
}

impl RayFill {
    /// What is on the list. Where it was made of the picture's own error, that says it pixel by pixel, also if rounding decides a few; of
    /// another list that rounding decides, nothing is known.
    fn blocks(&self, frame: &Frame, buffers: &Buffers, drawn: &Drawn<ValuesId>) -> Result<Option<Blocks>, Absent> {
        let (pixels, count) = (buffers.get(&self.pixels)?, buffers.get(&format!("{}_count", self.pixels))?);
        let id = drawn.error.ok_or_else(|| Absent("the error of each pixel".into()))?;
        let error = buffers.values(id);
        let (width, height) = (frame.camera.viewport.0 as usize, frame.camera.viewport.1 as usize);
        let list = buffers.find(&self.pixels);
        let is_own = |listing: &Listing<_>| Some(listing.numbers) == list && listing.of == id && listing.above == 0.0;
        let Some(listing) = buffers.products().find(is_own) else {
            let pixel = |number: &f64| (*number as usize % width, vec![*number as usize / width]);
            let listed = pixels.value.iter().take(count.value[3] as usize).map(pixel);
            let listed = listed.map(|(x, rows)| Block { x, rows, is_sure: true }).collect();
            return Ok((!count.bound[3].is_infinite()).then_some(Blocks { rows: 1, listed }));
        };
        let rows = listing.rows as usize;
        let is_open = |at: usize| {
            let (value, bound) = (error.value[at], error.bound[at]);
            bound > f64::MIN_POSITIVE && (value.is_nan() || value.abs() <= bound)
        };
        let block = |(y, x): (usize, usize)| {
            let all = y..(y + rows).min(height);
            let open = all.clone().any(|y| is_open(y * width + x));
            let over = |y: &usize| open || error.value[y * width + x] > 0.0;
            Block { x, rows: all.filter(over).collect(), is_sure: !open }
        };
        let listed = (0..height).step_by(rows).flat_map(|y| (0..width).map(move |x| (y, x))).map(block).collect();
        Ok(Some(Blocks { rows, listed }))
    }
}

fn centre(x: usize, y: usize) -> DVec2 {
    DVec2::new(x as f64, y as f64) + 0.5
}

/// How much farther or nearer than on its own ray a pixel may show what another ray has hit.
const MOST_APART: f64 = 0.1;

/// One ray for several pixels, one under another.
struct Shared<'a> {
    frame: &'a Frame<'a>,
    /// None for a mesh that has no proven bound.
    bound_px: Option<f64>,
    steepest: f64,
}

impl Shared<'_> {
    /// The ray through a place in the picture, with length 1 along the view direction.
    fn ray(&self, place: DVec2) -> DVec3 {
        let [right, down, corner] = self.frame.camera.pixel_basis();
        corner + right * place.x + down * place.y
    }

    /// What the pixels of some rows of a column show, each with its bound.
    fn block(&self, x: usize, rows: &[usize]) -> Vec<Shows> {
        let each = || rows.iter().map(|&y| (x, y, first_hit(self.frame, centre(x, y)))).collect();
        let undecided = || rows.iter().map(|&y| (x, y, (f64::NAN, f64::INFINITY))).collect();
        let (Some(&first), Some(&last)) = (rows.first(), rows.last()) else { return Vec::new() };
        let Some(bound_px) = self.bound_px.filter(|_| first < last && !self.frame.sees_underside()) else {
            return each();
        };
        let place = 0.5 * (centre(x, first) + centre(x, last));
        let middle = self.ray(place);
        let serves = |y| self.serves(middle, self.ray(centre(x, y)), bound_px);
        match all_of(rows.iter().map(|&y| serves(y))) {
            None => return undecided(),
            Some(false) => return each(),
            Some(true) => {}
        }
        let (distance, bound) = first_hit(self.frame, place);
        if bound.is_infinite() {
            return undecided();
        }
        if distance.is_nan() {
            let serves = |y| self.serves_sky(middle, self.ray(centre(x, y)), bound_px);
            return match all_of(rows.iter().map(|&y| serves(y))) {
                None => undecided(),
                Some(false) => each(),
                Some(true) => rows.iter().map(|&y| (x, y, (distance, bound))).collect(),
            };
        }
        let hit = Hit { frame: self.frame, ray: middle, t: distance / middle.length(), bound_m: bound };
        let shown: Option<Vec<_>> = rows.iter().map(|&y| hit.shown_at(self.ray(centre(x, y)))).collect();
        match shown {
            None => undecided(),
            Some(shown) if shown.iter().any(|pixel| pixel.is_outside) => each(),
            Some(shown) => rows.iter().zip(shown).map(|(&y, pixel)| (x, y, pixel.distance)).collect(),
        }
    }

    /// Whether one ray serves another's pixel; `None` where rounding decides.
    fn serves(&self, shared: DVec3, own: DVec3, bound_px: f64) -> Option<bool> {
        let along = beside(shared, own);
        let slack = self.steepest * ((shared.truncate() - own.truncate() * along).length() + 1e-6);
        let off = (own.z * along - shared.z).abs().max(slack) + slack;
        let room = (1.0 - self.off_px(own, along, off) / bound_px).min(MOST_APART - (along - 1.0).abs());
        self.decide(room, bound_px)
    }

    /// Whether one ray serves another's pixel when it meets nothing.
    fn serves_sky(&self, shared: DVec3, own: DVec3, bound_px: f64) -> Option<bool> {
        let along = beside(shared, own);
        let (out, own_out) = (self.way_out(shared), self.way_out(own));
        let ground = own.truncate().length();
        let farther = ground * (own_out - along * out).max(0.0) + 1e-6 * ground * out;
        let slack = self.steepest * ((shared.truncate() - own.truncate() * along).length() + 1e-6) * out;
        let off = (own.z * along - shared.z).abs() * out + slack + farther * (self.steepest + own.z.abs() / ground);
        self.decide(1.0 - self.off_px(own, along * out, off) / bound_px, bound_px)
    }

    /// Pixels of a difference in height next to a place on a pixel's ray.
    fn off_px(&self, own: DVec3, t: f64, off_m: f64) -> f64 {
        let camera = self.frame.camera;
        let depth = t - off_m * camera.forward().z.abs();
        let px = camera.focal_px() * off_m * (own * camera.forward().z - DVec3::Z).length() / depth;
        if depth > 0.0 { px * 1.0001 + 0.02 } else { f64::INFINITY }
    }

    /// The sign of what is left of a bound, if rounding cannot turn it.
    fn decide(&self, room: f64, bound_px: f64) -> Option<bool> {
        let rounding = 1e-2 + 1e-5 * self.steepest * self.frame.camera.focal_px() / bound_px;
        (room.abs() > rounding).then_some(room > 0.0)
    }

    /// Parameter at which a ray leaves the terrain.
    fn way_out(&self, ray: DVec3) -> f64 {
        let (eye_m, extent_m) = (self.frame.camera.eye_m.truncate(), self.frame.lattice().extent_m());
        let border_m = DVec2::select(ray.truncate().cmpge(DVec2::ZERO), extent_m, DVec2::ZERO);
        ((border_m - eye_m) / ray.truncate()).min_element()
    }
}

/// Whether all decisions are yes; `None` if rounding decides one of them.
fn all_of(mut decisions: impl Iterator<Item = Option<bool>>) -> Option<bool> {
    decisions.try_fold(true, |all, one| one.map(|one| all && one))
}

/// Parameter of a ray where it passes closest to where another has 1, on the ground.
fn beside(shared: DVec3, own: DVec3) -> f64 {
    shared.truncate().dot(own.truncate()) / own.truncate().length_squared()
}

/// What a shared ray has hit.
struct Hit<'a> {
    frame: &'a Frame<'a>,
    ray: DVec3,
    t: f64,
    bound_m: f64,
}

/// What one of its pixels shows.
struct Shown {
    distance: (f64, f64),
    is_outside: bool,
}

impl Hit<'_> {
    /// `None` where rounding decides which triangle it is, or whether it is left.
    fn shown_at(&self, own: DVec3) -> Option<Shown> {
        let terrain = self.frame.lattice();
        let cells = |ray: DVec3| terrain.cells_from_world(ray.truncate());
        let origin = terrain.sample_from_world(self.frame.camera.eye_m.truncate());
        let at = origin + cells(self.ray * self.t);
        let cell = at.floor().clamp(DVec2::ZERO, terrain.size.as_dvec2() - 2.0);
        let rounding = 64.0 * EPSILON * cells(self.ray * self.t).abs().max_element()
            + self.bound_m / terrain.cell_m.min_element()
            + 1e-5;
        let mut t = self.t * beside(self.ray, own);
        let mut bound_m = (self.bound_m + 16.0 * EPSILON * t) * own.length();
        if self.frame.data.scene.surface == Surface::Triangles {
            let half = half_of(at - cell, rounding)?;
            let slope = self.frame.cell(cell.as_uvec2()).slope(half);
            let gap = own.z * t - self.ray.z * self.t - slope.dot(cells(own * t - self.ray * self.t));
            let steep = own.z - slope.dot(cells(own));
            let exact = t - gap / steep;
            let place = origin + cells(own * exact) - cell;
            let scale_m = self.frame.camera.eye_m.z.abs()
                + self.frame.ground.range_m().1.abs().max(self.frame.ground.range_m().0.abs());
            let off_m = 32.0 * EPSILON * (scale_m + exact * (1.0 + slope.dot(cells(own)).abs() + own.length()));
            let leaves =
                !(DVec2::splat(-rounding).cmplt(place).all() && place.cmplt(DVec2::splat(1.0 + rounding)).all());
            if steep < 0.0 && exact > 0.0 && !leaves {
                if half_of(place, rounding)? == half {
                    t = exact;
                    bound_m = (off_m / -steep + 16.0 * EPSILON * t) * own.length();
                }
            } else if steep.abs() < 1e-6 {
                return None;
            }
        }
        let margin = border_margin_m(self.frame, own * t) / terrain.cell_m.min_element();
        (margin.abs() > rounding).then_some(Shown { distance: (t * own.length(), bound_m), is_outside: margin < 0.0 })
    }
}

/// Whether a place in a cell is in its north-western half; `None` close to the border of either.
fn half_of(place: DVec2, rounding: f64) -> Option<bool> {
    let borders = [place.x, place.y, 1.0 - place.x, 1.0 - place.y, place.x + place.y - 1.0];
    borders.iter().all(|border| border.abs() > rounding).then_some(is_north_west(place))
}
