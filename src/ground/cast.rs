//! The first hit of a ray with the surface, in f64: what the ground truth is made of where f32 has too few digits.

use glam::{DVec2, UVec2};
use rayon::prelude::*;

use super::pyramid::Layout;
use super::{Ground, Ray};

/// The first place in a part of a ray at which it comes to the other side of the surface; `side` is 1 for a ray over the surface and -1 under it.
/// Every bend in the part is visited, so it is short, or the ground small.
pub fn first_hit_in(ground: &(impl Ground + ?Sized), ray: &Ray, (from, to): (f64, f64), side: f64) -> Option<f64> {
    let over_m = |t: f64| side * ground.above_m(ray.at(t));
    let mut bends = ground.bends(ray, from, to);
    bends.extend([from, to]);
    bends.sort_by(f64::total_cmp);
    if over_m(from) <= 0.0 {
        return Some(from);
    }
    bends.windows(2).find_map(|pair| first_sign_change(over_m, pair[0], pair[1]))
}

/// Where a smooth function that begins above 0 first comes to it: exactly for parabolas, which is what the distance from a patch is.
fn first_sign_change(f: impl Fn(f64) -> f64, start: f64, end: f64) -> Option<f64> {
    let at = |share: f64| start + (end - start) * share;
    let (f0, middle, f1) = (f(start), f(at(0.5)), f(end));
    let bend = 2.0 * (f0 + f1 - 2.0 * middle);
    let lowest = at(0.5 - 0.5 * (f1 - f0) / bend);
    let dips = lowest > start && lowest < end && f(lowest) <= 0.0;
    let (mut low, mut high) = (start, if dips { lowest } else { end });
    if !dips && f1 > 0.0 {
        return None;
    }
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return Some(high);
        }
        if f(middle) > 0.0 { low = middle } else { high = middle }
    }
}

/// What of a part of a ray is between the lowest and the highest that there is.
pub fn among((low_m, high_m): (f64, f64), ray: &Ray, (from, to): (f64, f64)) -> (f64, f64) {
    let reaches = |height_m: f64| (height_m - ray.eye_m.z) / ray.direction.z;
    let (low, high) = (reaches(low_m), reaches(high_m));
    // of a level ray, nothing is left out
    if !(low.is_finite() && high.is_finite()) {
        return (from, to);
    }
    (from.max(low.min(high).min(to)), to.min(low.max(high).max(from)))
}

/// 1 for a ray that comes to a place over the surface, -1 under it.
pub fn side(ground: &(impl Ground + ?Sized), ray: &Ray, enter: f64) -> f64 {
    if ground.above_m(ray.at(enter)) >= 0.0 { 1.0 } else { -1.0 }
}

/// Lowest and highest heights over squares of cells, so that a ray can pass over what it does not come near.
#[derive(Clone, Debug)]
pub struct Nodes {
    cells: UVec2,
    /// Of the levels from [`FINEST`] on, by rows.
    levels: Vec<(UVec2, Vec<(f64, f64)>)>,
}

/// Squares of four cells a side are not looked into: their cells are visited one by one.
const FINEST: u32 = 2;

/// A ray in sample coordinates, and from where it comes.
struct Walk<'a> {
    ray: &'a Ray,
    origin: DVec2,
    direction: DVec2,
    side: f64,
    /// How far the surface can be above or below the heights of the nodes.
    beyond_m: f64,
    /// The first hit in a part of the ray that no node excludes.
    in_part: &'a dyn Fn((f64, f64)) -> Option<f64>,
}

impl Nodes {
    pub fn new(ground: &dyn Ground) -> Self {
        let last = ground.lattice().last();
        let layout = Layout::new(last);
        let finest = layout.size(FINEST);
        let of_square = |at: usize| {
            let square = UVec2::new(at as u32 % finest.x, at as u32 / finest.x) << FINEST;
            let end = (square + (1 << FINEST)).min(last);
            let samples = (square.y..=end.y).flat_map(|y| (square.x..=end.x).map(move |x| UVec2::new(x, y)));
            wider(samples.map(|sample| ground.height_m(sample)).map(|height_m| (height_m, height_m)))
        };
        let mut levels =
            vec![(finest, (0..finest.element_product() as usize).into_par_iter().map(of_square).collect())];
        for level in FINEST + 1..=layout.top {
            let (below, ranges): &(UVec2, Vec<(f64, f64)>) = &levels[levels.len() - 1];
            let size = layout.size(level);
            let of_node = |at: u32| {
                let first = UVec2::new(at % size.x, at / size.x) * 2;
                let end = (first + 2).min(*below);
                let nodes = (first.y..end.y).flat_map(|y| (first.x..end.x).map(move |x| (y * below.x + x) as usize));
                wider(nodes.map(|node| ranges[node]))
            };
            let ranges = (0..size.element_product()).map(of_node).collect();
            levels.push((size, ranges));
        }
        Self { cells: last, levels }
    }

    /// `ground` is the one that the nodes are of.
    pub fn first_hit(&self, ground: &dyn Ground, ray: &Ray) -> Option<f64> {
        let side = side(ground, ray, ground.stay(ray)?.0);
        self.first_in(ground, ray, (side, 0.0), &|part| first_hit_in(ground, ray, part, side))
    }

    /// The first place that is found in one of the parts of a ray, each short, in which it can meet what is up to `beyond_m` above or below
    /// the surface between samples. On the other side of it are no hits: `side` is 1 for a ray that comes from over the surface.
    pub fn first_in(
        &self,
        ground: &dyn Ground,
        ray: &Ray,
        (side, beyond_m): (f64, f64),
        in_part: &dyn Fn((f64, f64)) -> Option<f64>,
    ) -> Option<f64> {
        let part = ground.stay(ray)?;
        let lattice = ground.lattice();
        let origin = lattice.sample_from_world(ray.eye_m.truncate());
        let direction = lattice.cells_from_world(ray.direction.truncate());
        let walk = Walk { ray, origin, direction, side, beyond_m, in_part };
        self.visit(&walk, self.levels.len() - 1, UVec2::ZERO, part)
    }

    /// The first hit with what is over one node.
    fn visit(&self, walk: &Walk, level: usize, at: UVec2, part: (f64, f64)) -> Option<f64> {
        let (size, ranges) = &self.levels[level];
        let finer = FINEST + level as u32;
        let (low, high) = (at << finer, ((at + 1) << finer).min(self.cells));
        let (from, to) = walk.over(low.as_dvec2(), high.as_dvec2(), part)?;
        let (a_m, b_m) = (walk.ray.at(from).z, walk.ray.at(to).z);
        let (lowest_m, highest_m) = ranges[(at.y * size.x + at.x) as usize];
        let is_clear = match walk.side > 0.0 {
            true => a_m.min(b_m) > highest_m + walk.beyond_m,
            false => a_m.max(b_m) < lowest_m - walk.beyond_m,
        };
        if is_clear {
            return None;
        }
        let Some(below) = level.checked_sub(1) else {
            return (walk.in_part)((from, to));
        };
        // in the order in which a ray comes to them; it comes to one of the two in the middle at most
        let near = UVec2::new(u32::from(walk.direction.x < 0.0), u32::from(walk.direction.y < 0.0));
        let order = [near, UVec2::new(1 - near.x, near.y), UVec2::new(near.x, 1 - near.y), 1 - near];
        let children = order.into_iter().map(|child| 2 * at + child);
        let size = self.levels[below].0;
        children.filter(|child| child.cmplt(size).all()).find_map(|child| self.visit(walk, below, child, (from, to)))
    }
}

impl Walk<'_> {
    /// What of a part of the ray is over a rectangle.
    fn over(&self, low: DVec2, high: DVec2, (mut from, mut to): (f64, f64)) -> Option<(f64, f64)> {
        for axis in 0..2 {
            let (start, speed) = (self.origin[axis], self.direction[axis]);
            if speed == 0.0 {
                if start < low[axis] || start > high[axis] {
                    return None;
                }
                continue;
            }
            let (a, b) = ((low[axis] - start) / speed, (high[axis] - start) / speed);
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
        (from <= to).then_some((from, to))
    }
}

/// The range that holds all of these.
fn wider(ranges: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    ranges.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (from, to)| (low.min(from), high.max(to)))
}
