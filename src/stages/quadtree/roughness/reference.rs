use glam::{DVec2, UVec2};
use rayon::prelude::*;

use super::{Error, Roughness};
use crate::experiment::scene::Surface;
use crate::ground::cell::Cell;
use crate::ground::pyramid::Layout;
use crate::plan::product;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::rounding::EPSILON;

impl Reference for Roughness {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let height = buffers.get("height")?;
        let layout = frame.lattice().cells();
        let mut roughness = Values::missing(&layout.dims(), 1);
        for level in 1..=layout.top {
            let nodes = layout.size(level);
            let own: Vec<(f64, f64)> = (0..nodes.element_product())
                .into_par_iter()
                .map(|at| {
                    let block = Block::new(&height, level, UVec2::new(at % nodes.x, at / nodes.x));
                    match self.error {
                        Error::Paper => block.five_errors(),
                        Error::Proven => block.most(),
                    }
                })
                .collect();
            for (at, (mut value, mut bound)) in own.into_iter().enumerate() {
                let at = UVec2::new(at as u32 % nodes.x, at as u32 / nodes.x);
                let factor = if self.error == Error::Paper { 2.0 } else { 1.0 };
                for child in children(layout, level, at) {
                    value = value.max(factor * roughness.value[child]);
                    bound = bound.max(factor * roughness.bound[child]);
                }
                roughness.set(layout.index(level, at.x, at.y), value, bound);
            }
        }
        let roughness = buffers.put("roughness", roughness);
        buffers.offer(product::Roughness { roughness, is_bound: self.error == Error::Proven });
        Ok(())
    }
}

/// Places of the blocks below a block.
fn children(layout: Layout, level: u32, at: UVec2) -> Vec<usize> {
    if level == 1 {
        return Vec::new();
    }
    let below = layout.size(level - 1);
    let all = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| at * 2 + UVec2::new(x, y));
    all.into_iter()
        .filter(|child| child.cmplt(below).all())
        .map(|child| layout.index(level - 1, child.x, child.y))
        .collect()
}

/// A block with its heights, for the formulas as they are written.
struct Block<'a> {
    height: &'a Values,
    low: UVec2,
    middle: UVec2,
    high: UVec2,
}

impl<'a> Block<'a> {
    fn new(height: &'a Values, level: u32, at: UVec2) -> Self {
        let last = UVec2::new(height.dims[1], height.dims[0]) - 1;
        let low = at << level;
        Self { height, low, middle: (low + (1 << level) / 2).min(last), high: (low + (1 << level)).min(last) }
    }

    fn at(&self, x: u32, y: u32) -> f64 {
        self.height.value[(y * self.height.dims[1] + x) as usize]
    }

    /// Largest difference of two heights in the block: what all roundings are a part of.
    fn relief(&self) -> f64 {
        let heights = (self.low.y..=self.high.y).flat_map(|y| (self.low.x..=self.high.x).map(move |x| self.at(x, y)));
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), height| (low.min(height), high.max(height)));
        high - low
    }

    /// The centre against the diagonal, the middle of each edge against its ends; where the terrain's border cuts the block down
    /// to one cell or two, the middle of the first as well, whose diagonal is not the block's.
    fn five_errors(&self) -> (f64, f64) {
        let (low, mid, high) = (self.low, self.middle, self.high);
        let [nw, ne, sw, se] =
            [self.at(low.x, low.y), self.at(high.x, low.y), self.at(low.x, high.y), self.at(high.x, high.y)];
        let t = (mid - low).as_dvec2() / (high - low).as_dvec2();
        let line = |a: f64, b: f64, t: f64| a + (b - a) * t;
        // a block's own two triangles lie as those of a cell do
        let centre = Cell { nw, ne, sw, se }.surface_m(t, Surface::Triangles);
        let errors = [
            self.at(mid.x, mid.y) - centre,
            self.at(mid.x, low.y) - line(nw, ne, t.x),
            self.at(mid.x, high.y) - line(sw, se, t.x),
            self.at(low.x, mid.y) - line(nw, sw, t.y),
            self.at(high.x, mid.y) - line(ne, se, t.y),
        ];
        let is_cut = high - low != UVec2::splat((mid.x - low.x) * 2) && (high - low).min_element() == 1;
        let cell = low + 1;
        let twist = nw + self.at(cell.x, cell.y) - self.at(cell.x, low.y) - self.at(low.x, cell.y);
        let cut = if is_cut && (high - low).max_element() <= 2 { twist / 2.0 } else { 0.0 };
        let largest = errors.into_iter().chain([cut]).fold(0.0, |largest: f64, error| largest.max(error.abs()));
        // up to six differences and products of heights of the block
        (largest, 12.0 * EPSILON * self.relief() * 4.0)
    }

    /// The bound over all samples. Between them the surface is flat but for the fan's own ridges: on the one across the surface's
    /// diagonals the crossings are looked at as well, and a block that the border cut has half a cell's diagonal of its ridges.
    fn most(&self) -> (f64, f64) {
        let (low, high) = (self.low, self.high);
        let edge = |from: UVec2, to: UVec2| {
            let cells = (to - from).max_element();
            let step = (to - from) / cells.max(1);
            let (a, b) = (self.at(from.x, from.y), self.at(to.x, to.y));
            let off = |i: u32| {
                let place = from + step * i;
                (self.at(place.x, place.y) - a - (b - a) * f64::from(i) / f64::from(cells)).abs()
            };
            (0..cells).map(off).fold(0.0, f64::max)
        };
        let (ne, sw) = (UVec2::new(high.x, low.y), UVec2::new(low.x, high.y));
        let edges = [(low, ne), (sw, high), (low, sw), (ne, high)];
        let is_whole = high - low == UVec2::splat((self.middle.x - low.x) * 2);
        // in a block that the border has cut, ridges are anywhere, and one number has to do for all edges
        let largest = edges.map(|(from, to)| edge(from, to)).into_iter().fold(0.0, f64::max);
        let fan = edges.map(|(from, to)| self.triangle(from, to, if is_whole { edge(from, to) } else { largest }));
        let there: Vec<&Triangle> = fan.iter().flatten().collect();
        let mut most: f64 = 0.0;
        for (x, y) in (low.y..=high.y).flat_map(|y| (low.x..=high.x).map(move |x| (x, y))) {
            let place = DVec2::new(x.into(), y.into());
            most = most.max(worst_at(&there, place, self.at(x, y)));
            let is_ridge = x + self.middle.y == y + self.middle.x && x < high.x && y < high.y;
            if is_whole && is_ridge {
                most = most.max(worst_at(&there, place + 0.5, 0.5 * (self.at(x + 1, y) + self.at(x, y + 1))));
            }
        }
        if !is_whole {
            let pairs = there.iter().flat_map(|a| there.iter().map(move |b| a.slope.distance(b.slope)));
            most += 0.7072 * pairs.fold(0.0, f64::max);
        }
        // what the kernel adds for its own roundings, and those
        (most, 2e-6 * (self.relief() + most))
    }

    /// The triangle between the centre and an edge, if it has an area.
    fn triangle(&self, from: UVec2, to: UVec2, edge_off: f64) -> Option<Triangle> {
        let point = |p: UVec2| p.as_dvec2().extend(self.at(p.x, p.y));
        let (c, a, b) = (point(self.middle), point(from), point(to));
        let normal = (a - c).cross(b - c);
        (normal.z != 0.0).then(|| Triangle {
            centre: c.truncate(),
            centre_m: c.z,
            slope: -normal.truncate() / normal.z,
            ends: [a.truncate() - c.truncate(), b.truncate() - c.truncate()],
            edge_off,
        })
    }
}

struct Triangle {
    centre: DVec2,
    centre_m: f64,
    slope: DVec2,
    ends: [DVec2; 2],
    edge_off: f64,
}

/// Largest distance at a place, over the triangles that it is in.
fn worst_at(fan: &[&Triangle], place: DVec2, surface_m: f64) -> f64 {
    let off = |triangle: &&Triangle| {
        let offset = place - triangle.centre;
        let [a, b] = triangle.ends;
        let area = a.perp_dot(b);
        let (u, v) = (offset.perp_dot(b) / area, a.perp_dot(offset) / area);
        let is_inside = u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9;
        let off_m = (surface_m - triangle.centre_m - triangle.slope.dot(offset)).abs();
        if is_inside { off_m + (u + v) * triangle.edge_off } else { 0.0 }
    };
    fan.iter().map(off).fold(0.0, f64::max)
}
