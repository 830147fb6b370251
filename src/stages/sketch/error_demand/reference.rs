use glam::{DVec2, UVec2};

use super::ErrorDemand;
use crate::plan::product::{Demand, PointErrors};
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::rounding::{EPSILON, power};

/// No density is larger; `DENSEST` of the kernel.
const DENSEST: f64 = 1e30;

impl Reference for ErrorDemand {
    fn reference(&self, _frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let Demand { places, vertex, square, .. } = buffers.latest()?;
        let PointErrors { errors } = buffers.latest()?;
        let image = Image {
            places: &buffers.values(places),
            vertices: &buffers.values(vertex),
            errors: &buffers.values(errors),
            per_order: 1.0 / self.order,
        };
        let mut demand = [0.0, 1.0, -1.0].map(|sign| Painted::new(self.texels, sign));
        let cells = UVec2::new(image.places.dims[1], image.places.dims[0]) - 1;
        for (y, x) in (0..cells.y).flat_map(|y| (0..cells.x).map(move |x| (y, x))) {
            let corners =
                [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| (y * (cells.x + 1) + x) as usize);
            let (asked, around) = (image.asked_for(corners), image.around(corners));
            demand.iter_mut().for_each(|painted| painted.paint(asked, around));
        }
        let [at, most, least] = demand.map(|painted| painted.texels);
        let mut values = Values::missing(&[self.texels; 2], 1);
        for (index, at) in at.into_iter().enumerate() {
            values.set(index, at, (most[index] - at).max(at - least[index]));
        }
        buffers.put("error_demand", values);
        buffers.put("error_square", (*buffers.values(square)).clone());
        Ok(())
    }
}

/// A map with all cells as they are, or as large and as small as f32 may have them.
struct Painted {
    texels: Vec<f64>,
    side: u32,
    sign: f64,
}

impl Painted {
    fn new(side: u32, sign: f64) -> Self {
        Self { texels: vec![0.0; (side * side) as usize], side, sign }
    }

    fn paint(&mut self, (asked, off): (f64, f64), (low, high, off_place): (DVec2, DVec2, f64)) {
        let asked = match self.sign {
            0.0 => asked,
            sign => (asked + sign * off).max(0.0),
        };
        let texel = |place: DVec2| {
            let place = place.clamp(DVec2::ZERO, DVec2::ONE) * f64::from(self.side);
            place.as_uvec2().min(UVec2::splat(self.side - 1))
        };
        let around = self.sign * (off_place + 2.0 * EPSILON);
        let (first, end) = (texel(low - around), texel(high + around));
        for (y, x) in (first.y..=end.y).flat_map(|y| (first.x..=end.x).map(move |x| (y, x))) {
            let texel = &mut self.texels[(y * self.side + x) as usize];
            *texel = texel.max(asked);
        }
    }
}

struct Image<'a> {
    places: &'a Values,
    vertices: &'a Values,
    errors: &'a Values,
    per_order: f64,
}

impl Image<'_> {
    /// The lowest and the highest place of a cell in the square, and how far they are from there.
    fn around(&self, corners: [usize; 4]) -> (DVec2, DVec2, f64) {
        let place = |at: usize| DVec2::from_slice(&self.places.value[2 * at..]);
        let off = |at: usize| self.places.bound[2 * at].max(self.places.bound[2 * at + 1]);
        corners.into_iter().fold((DVec2::MAX, DVec2::MIN, 0.0f64), |(low, high, most), at| {
            (low.min(place(at)), high.max(place(at)), most.max(off(at)))
        })
    }

    /// Points a metre that the error of a cell asks for, with the bound of that.
    fn asked_for(&self, [nw, ne, sw, se]: [usize; 4]) -> (f64, f64) {
        let vertex = |at: usize| DVec2::from_slice(&self.vertices.value[4 * at..]);
        let off = |at: usize| self.vertices.bound[4 * at].max(self.vertices.bound[4 * at + 1]);
        let sides = [(nw, ne), (sw, se), (nw, sw), (ne, se)].map(|(a, b)| {
            let (a_m, b_m) = (vertex(a), vertex(b));
            let largest = a_m.abs().max_element().max(b_m.abs().max_element());
            // a difference by parts, and its length
            (a_m.distance(b_m), 1.5 * (off(a) + off(b) + 2.0 * EPSILON * largest) + 8.0 * EPSILON * a_m.distance(b_m))
        });
        let error = [nw, ne, sw, se].map(|at| (self.errors.value[at], self.errors.bound[at]));
        let most = |of: &[(f64, f64)], sign: f64| of.iter().map(|(at, off)| at + sign * off).fold(0.0, f64::max);
        let asked = |sign: f64| {
            let (side, error) = (most(&sides, -sign), most(&error, sign).min(1.0));
            let times = (1.0 - error).max(1e-6).powf(-self.per_order);
            (times / side.max(1.0 / DENSEST)).min(DENSEST)
        };
        // what is next to 1 is rounded as it is
        let rounding = power(1e6, self.per_order) + 8.0 * EPSILON;
        let at = asked(0.0);
        (at, (asked(1.0) - at).max(at - asked(-1.0)) + rounding * at)
    }
}
