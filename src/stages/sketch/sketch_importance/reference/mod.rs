mod errors;

use glam::{DVec2, DVec3, IVec2};

use super::{SketchImportance, slope, width};
use crate::frame::view::sides;
use crate::plan::product::Wanted;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::rounding::EPSILON;
use crate::stages::shared::sketch::Square;

/// Places along a texel that are asked for their surface type; `PLACES` of the kernel.
const PLACES: i32 = 4;

impl Reference for SketchImportance {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let in_square = buffers.find("sketch_square").ok_or_else(|| Absent("the buffer `sketch_square`".into()))?;
        let square = buffers.values(in_square);
        let heights = buffers.get("sketch_height")?;
        let texels = heights.dims[0];
        let types = self.densest_of_types.map(|_| buffers.get("surface_type")).transpose()?;
        let map = Map { frame, heights: &heights, types: types.as_deref(), square: Square::of(&square, texels) };
        let mut importance = Values::missing(&[texels; 2], 1);
        let mut factors = Values::missing(&[texels; 2], 4);
        let places = || (0..texels).flat_map(|y| (0..texels).map(move |x| IVec2::new(x as i32, y as i32)));
        let mut found: Vec<[(f64, f64); 4]> = places().map(|texel| self.factors(&map, texel)).collect();
        if let (true, Some(previous)) = (self.error_share > 0.0, frame.previous) {
            errors::follow(self.error_share, &mut found, &errors::asked(previous, map.square)?);
        }
        for (at, found) in found.into_iter().enumerate() {
            let of_view = product(product(found[0], found[1]), found[2]);
            let most = found[3];
            let least = |off: f64| (of_view.0 + off * of_view.1).min(most.0 + off * most.1);
            importance.set(at, least(0.0), (least(1.0) - least(0.0)).max(least(0.0) - least(-1.0)));
            found.into_iter().enumerate().for_each(|(part, (value, bound))| factors.set(4 * at + part, value, bound));
        }
        if self.floor > 0.0 {
            raise(&mut importance, self.floor);
        }
        let importance = buffers.put("importance", importance);
        buffers.put("importance_factors", factors);
        buffers.offer(Wanted { importance, square: in_square });
        Ok(())
    }
}

/// No importance is less than this share of the largest.
fn raise(importance: &mut Values, floor: f64) {
    let largest = importance.value.iter().copied().fold(0.0, f64::max);
    let values = importance.value.iter().zip(&importance.bound);
    let off = values.filter(|&(value, bound)| value + bound >= largest).map(|(_, bound)| *bound).fold(0.0, f64::max);
    for (value, bound) in importance.value.iter_mut().zip(&mut importance.bound) {
        *value = value.max(floor * largest);
        *bound = bound.max(floor * (off + 4.0 * EPSILON * largest));
    }
}

/// A product and its bound.
fn product((a, off_a): (f64, f64), (b, off_b): (f64, f64)) -> (f64, f64) {
    (a * b, a * off_b + b * off_a + off_a * off_b + 2.0 * EPSILON * a * b)
}

struct Map<'a> {
    frame: &'a Frame<'a>,
    heights: &'a Values,
    types: Option<&'a Values>,
    square: Square,
}

impl Map<'_> {
    /// Height of a texel, or of the nearest one, with its bound.
    fn height_m(&self, texel: IVec2) -> (f64, f64) {
        let texels = self.heights.dims[0] as i32;
        let texel = texel.clamp(IVec2::ZERO, IVec2::splat(texels - 1));
        let at = (texel.y * texels + texel.x) as usize;
        (self.heights.value[at], self.heights.bound[at])
    }

    /// Bilinear between texels, and its bound for a place that is off by `off` texels.
    fn height_between(&self, at: DVec2, off: f64) -> (f64, f64) {
        let low = at.floor();
        let w = at - low;
        let height = |x: f64, y: f64| self.height_m((low + DVec2::new(x, y)).as_ivec2());
        let four = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(x, y)| height(x, y));
        let between = |a: f64, b: f64, w: f64| a + (b - a) * w;
        let value = between(between(four[0].0, four[1].0, w.x), between(four[2].0, four[3].0, w.x), w.y);
        let around = (-1..=2).flat_map(|y| (-1..=2).map(move |x| height(f64::from(x), f64::from(y))));
        let (least, most, bound) = around.fold((f64::MAX, f64::MIN, 0.0f64), |(least, most, bound), (height, off)| {
            (least.min(height), most.max(height), bound.max(off))
        });
        // the steepest slope around
        (value, bound + 2.0 * (most - least) * off.min(1.0) + 8.0 * EPSILON * least.abs().max(most.abs()))
    }

    fn sides_m(&self) -> DVec2 {
        self.square.texel_samples() * self.frame.lattice().cell_m
    }

    /// The middle of a texel from the eye, and how far f32 can have it from there.
    fn place_m(&self, texel: IVec2) -> (DVec3, f64) {
        let lattice = self.frame.lattice();
        let eye_m = self.frame.camera.eye_m;
        let sample = self.square.middle(texel);
        let (height_m, off_m) = self.height_m(texel);
        let place_m = (lattice.world_from_sample(sample) - eye_m.truncate()).extend(height_m - eye_m.z);
        // the eye's fraction of a cell, its sum with whole cells, half a texel, their sum, a cell in metres, their product; a height, less
        // the eye's in two parts
        let texel_m = self.sides_m().max_element() + lattice.cell_m.max_element();
        let rounding_m = EPSILON * (6.0 * (place_m.truncate().length() + texel_m) + 3.0 * place_m.z.abs());
        (place_m, rounding_m + off_m)
    }
}

impl SketchImportance {
    /// Iv, Sf, Sb and Is of a texel, each with its bound.
    fn factors(&self, map: &Map, texel: IVec2) -> [(f64, f64); 4] {
        let camera = map.frame.camera;
        let (place_m, off_m) = map.place_m(texel);
        let sides_m = map.sides_m();
        // half a mean side
        let near_m = (sides_m.x + sides_m.y) / 4.0;
        let away_m = place_m.length().max(near_m);
        // a length's square root may cost what an inverse one does, and is that of a sum of squares
        let off_away = off_m / away_m + 8.0 * EPSILON;
        let is_terrain = map.square.is_terrain(texel, map.frame.lattice());
        let of_distance = match self.distance {
            true => camera.focal_px() / (self.quad_px * away_m),
            // a point for each texel
            false => 2.0 / (sides_m.x + sides_m.y),
        };
        let of_distance = match is_terrain {
            // three roundings of numbers, a division, and the distance
            true => (of_distance, of_distance * (off_away + 8.0 * EPSILON)),
            false => (0.0, 0.0),
        };
        let in_picture = match self.frustum {
            true => {
                let beside_m = sides(camera).map(|side| -side.dot(place_m)).into_iter().fold(f64::MIN, f64::max);
                let beside = (beside_m - 0.5 * sides_m.length()) / away_m;
                // a product with a rounded unit vector, half a diagonal, their difference, the distance
                let reach = (place_m.length() + sides_m.length()) / away_m;
                let off = off_m / away_m + 8.0 * EPSILON * reach + beside.abs() * off_away;
                fading((beside, off), width(self.safety_deg))
            }
            false => (1.0, 0.0),
        };
        let to_eye = match self.facing {
            true => self.facing(map, texel, (place_m, off_m), away_m),
            false => (1.0, 0.0),
        };
        let seen = match self.occlusion {
            true => product(to_eye, self.unhidden(map, texel, (place_m, off_m))),
            false => to_eye,
        };
        [of_distance, in_picture, seen, self.densest_at(map, texel)]
    }

    /// The most grid points a metre that a texel may have: the mean over places in it.
    fn densest_at(&self, map: &Map, texel: IVec2) -> (f64, f64) {
        let Some(types) = map.types else { return (self.densest(), EPSILON * self.densest()) };
        let (lattice, of_types) = (map.frame.lattice(), self.densest_of());
        let places = (0..PLACES * PLACES).map(|at| IVec2::new(at % PLACES, at / PLACES));
        let densest = |place: IVec2| {
            let sample = map.square.sample(texel, place, PLACES).clamp(IVec2::ZERO, lattice.last().as_ivec2());
            let at = (sample.y as u32 * lattice.size.x + sample.x as u32) as usize;
            let densest = of_types.get(types.value[at] as usize).copied().unwrap_or(self.densest());
            (densest, types.bound[at])
        };
        let (sum, off) = places.map(densest).fold((0.0, 0.0), |sum, (densest, off)| (sum.0 + densest, sum.1 + off));
        let mean = sum / f64::from(PLACES * PLACES);
        // what is no number of a type for sure may be of any
        (mean, if off > 0.0 { f64::INFINITY } else { 40.0 * EPSILON * mean })
    }

    /// How much is left of the importance of ground that other ground hides.
    fn unhidden(&self, map: &Map, texel: IVec2, (place_m, off_m): (DVec3, f64)) -> (f64, f64) {
        let (sides_m, eye_height_m) = (map.sides_m(), map.frame.camera.eye_m.z);
        let way = DVec2::new(place_m.x, -place_m.y) / sides_m;
        let texels = way.abs().max_element();
        let step = way / texels.max(1.0);
        // the way is as uncertain as the place, and its parts are products
        let off_texels = off_m / sides_m.min_element() + 8.0 * EPSILON * (texels + f64::from(map.heights.dims[0]));
        let (mut low, mut steepest, mut high) = (-1e30f64, -1e30f64, -1e30f64);
        let (first, last) = map.square.terrain(map.frame.lattice());
        // by how much a place is inside the terrain, in texels
        let inside = |at: DVec2| (at - first.as_dvec2()).min(last.as_dvec2() - at).min_element();
        for i in (1..map.heights.dims[0]).map(f64::from) {
            let at = texel.as_dvec2() - i * step;
            // whether this part of the way counts, from none to surely
            let counts = (texels - 1.0 - i).min(inside(at));
            if counts < -off_texels {
                break;
            }
            let (height_m, off_m) = map.height_between(at, off_texels);
            let share = 1.0 - i / texels;
            let at_texel = (height_m - eye_height_m) / share;
            let off = (off_m + 4.0 * EPSILON * (height_m - eye_height_m).abs()) / share
                + at_texel.abs() * (8.0 * EPSILON + off_texels / texels) / share;
            high = high.max(at_texel + off);
            if counts > off_texels {
                low = low.max(at_texel - off);
            }
            if counts > 0.0 {
                steepest = steepest.max(at_texel);
            }
        }
        let away_m = place_m.truncate().length().max(0.5 * sides_m.min_element());
        let clear = self.clear_deg.to_radians().tan();
        let excess = |steepest: f64| (steepest - place_m.z) / away_m - clear;
        let [low, at, high] = [low, steepest, high].map(excess);
        let off = (2.0 * off_m / away_m + 16.0 * EPSILON) * (1.0 + at.abs()) + EPSILON * clear;
        let off = off + (at - low).max(high - at);
        fading((at, if off.is_finite() { off } else { 1e30 }), slope(self.hidden_deg))
    }

    fn facing(&self, map: &Map, texel: IVec2, (place_m, off_m): (DVec3, f64), away_m: f64) -> (f64, f64) {
        let sides_m = map.sides_m();
        let (first, last) = map.square.terrain(map.frame.lattice());
        let (back, there) = ((texel - 1).max(first), (texel + 1).min(last));
        let slope = |step: IVec2, side_m: f64| {
            // the neighbours of a border texel are as far apart as they are
            let at = |other: IVec2| texel + step * (other - texel);
            let apart_m = f64::from((step * (there - back)).element_sum().max(1)) * side_m;
            let (there, back) = (map.height_m(at(there)), map.height_m(at(back)));
            let slope = (there.0 - back.0) / apart_m;
            (slope, (there.1 + back.1) / apart_m + 8.0 * EPSILON * slope.abs())
        };
        let (east, south) = (slope(IVec2::X, sides_m.x), slope(IVec2::Y, sides_m.y));
        let up = DVec3::new(-east.0, south.0, 1.0);
        let away = up.dot(place_m) / (up.length() * away_m);
        let sine = self.silhouette_deg.to_radians().sin();
        // of the normal, as a share of its length; of the place; of products, lengths and a division
        let off = (east.1 + south.1) / up.length() * 2.0 + 2.0 * off_m / away_m + 24.0 * EPSILON;
        fading((away - sine, off), width(self.fade_deg))
    }
}

/// From 1 at 0 and below to 0 at `width` and above.
fn fading((x, off): (f64, f64), width: f64) -> (f64, f64) {
    let at = |x: f64| {
        let t = (x / width).clamp(0.0, 1.0);
        1.0 - t * t * (3.0 - 2.0 * t)
    };
    let off = off + 8.0 * EPSILON * (x.abs() + width);
    // it only falls
    let (low, high) = (at(x + off), at(x - off));
    (at(x), (at(x) - low).max(high - at(x)) + 8.0 * EPSILON)
}
