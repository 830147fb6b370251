use glam::{DVec2, UVec2};

use super::{EXACT_LEVELS, PlanePyramid};
use crate::ground::pyramid::Layout;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::rounding::EPSILON;

impl Reference for PlanePyramid {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let size = frame.lattice().size;
        let layout = frame.lattice().cells();
        let height = buffers.get("height")?;
        let largest_m = frame.ground.range_m().0.abs().max(frame.ground.range_m().1.abs());
        let mut planes =
            Planes { values: Values::missing(&layout.dims(), 2), slopes: Vec::new(), off_slope: Vec::new() };
        planes.slopes.resize(planes.values.value.len() / 2, DVec2::ZERO);
        planes.off_slope.resize(planes.slopes.len(), 0.0);
        for level in 1..=layout.top {
            let nodes = layout.size(level);
            for at in (0..nodes.y).flat_map(|y| (0..nodes.x).map(move |x| UVec2::new(x, y))) {
                let node = match level <= EXACT_LEVELS {
                    true => Node::of_samples(&height, size, level, at),
                    false => Node::of_nodes(&planes, layout, level, at),
                };
                node.store(&mut planes, layout, level, at, largest_m);
            }
        }
        let mut slopes = Values::missing(&layout.dims(), 2);
        for (at, slope) in planes.slopes.iter().enumerate().filter(|(at, _)| !planes.values.value[2 * at].is_nan()) {
            // a slope is a sum over the samples, or a mean of four, and then a half
            let bound = planes.off_slope[at];
            slopes.set(2 * at, slope.x, bound);
            slopes.set(2 * at + 1, slope.y, bound);
        }
        buffers.put("height_plane", planes.values);
        buffers.put("plane_slope", slopes);
        Ok(())
    }
}

/// The planes of all nodes so far.
struct Planes {
    /// Height in the middle, largest distance.
    values: Values,
    slopes: Vec<DVec2>,
    /// Largest difference of each slope from the stored one.
    off_slope: Vec<f64>,
}

/// How far a slope is from the half it is stored as: 11 digits of it, or what is below the smallest normal half.
fn off_slope(slope: DVec2) -> f64 {
    slope.abs().max_element() * 2.0f64.powi(-11) + 2.0f64.powi(-14)
}

/// A plane and how far the surface is above and below it.
struct Node {
    middle_m: f64,
    slope: DVec2,
    lowest: f64,
    highest: f64,
    /// Largest bound of the nodes it was made of.
    off_m: f64,
    /// Largest bound of their slopes.
    off_slope: f64,
    /// Cells of the shorter side that samples were taken from.
    extent: f64,
}

impl Node {
    /// The plane through a set of samples (offset from the node's middle, height) with the least sum of squares.
    fn of_samples(height: &Values, size: UVec2, level: u32, at: UVec2) -> Self {
        let low = at << level;
        let high = (low + (1 << level)).min(size - 1);
        let middle = low.as_dvec2() + f64::from(1u32 << level) / 2.0;
        let mut samples: Vec<(DVec2, f64)> = Vec::new();
        for y in low.y..=high.y {
            for x in low.x..=high.x {
                let offset = DVec2::new(x.into(), y.into()) - middle;
                samples.push((offset, height.value[(y * size.x + x) as usize]));
            }
        }
        let count = samples.len() as f64;
        let mean = samples.iter().map(|(offset, _)| *offset).sum::<DVec2>() / count;
        let mean_m = samples.iter().map(|(_, height)| height).sum::<f64>() / count;
        let products: DVec2 = samples.iter().map(|(offset, height)| (*offset - mean) * (height - mean_m)).sum();
        let squares: DVec2 = samples.iter().map(|(offset, _)| (*offset - mean) * (*offset - mean)).sum();
        let slope = products / squares;
        let middle_m = mean_m - slope.dot(mean);
        let off = samples.iter().map(|(offset, height)| height - middle_m - slope.dot(*offset));
        let (lowest, highest) = off.fold((f64::MAX, f64::MIN), |(low, high), off| (low.min(off), high.max(off)));
        let extent = f64::from((high - low).min_element());
        Self { middle_m, slope, lowest, highest, off_m: 0.0, off_slope: 0.0, extent }
    }

    /// The mean of the planes below, and what bounds all of them at their corners.
    fn of_nodes(planes: &Planes, layout: Layout, level: u32, at: UVec2) -> Self {
        let below = layout.size(level - 1);
        let side = f64::from(1u32 << (level - 1));
        let inside = |child: &UVec2| child.cmplt(below).all();
        let children = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| UVec2::new(x, y));
        let known: Vec<(DVec2, f64, DVec2, f64, f64, f64)> = children
            .into_iter()
            .filter(|child| inside(&(at * 2 + *child)))
            .map(|child| {
                let index = layout.index(level - 1, at.x * 2 + child.x, at.y * 2 + child.y);
                let (v, bound) = (&planes.values.value, &planes.values.bound);
                let offset = (child.as_dvec2() - 0.5) * side;
                let own = planes.slopes[index];
                // the stored plane is another one than this one by its slope, and its distance by what that makes
                let off = bound[2 * index] + bound[2 * index + 1] + 2.0 * off_slope(own) * side;
                (offset, v[2 * index], own, v[2 * index + 1], off, planes.off_slope[index])
            })
            .collect();
        let count = known.len() as f64;
        let slope = known.iter().map(|(_, _, slope, ..)| *slope).sum::<DVec2>() / count;
        let middle_m = known.iter().map(|(offset, m, slope, ..)| m - slope.dot(*offset)).sum::<f64>() / count;
        let (mut lowest, mut highest) = (f64::MAX, f64::MIN);
        for (offset, m, own, r, ..) in &known {
            for corner in [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)].map(DVec2::from) {
                let place = *offset + corner * side;
                let off = m + own.dot(corner * side) - middle_m - slope.dot(place);
                lowest = lowest.min(off - r);
                highest = highest.max(off + r);
            }
        }
        let off_m = known.iter().map(|known| known.4).fold(0.0, f64::max);
        let off_slope = known.iter().map(|known| known.5).fold(0.0, f64::max);
        Self { middle_m, slope, lowest, highest, off_m, off_slope, extent: 1.0 }
    }

    fn store(&self, planes: &mut Planes, layout: Layout, level: u32, at: UVec2, largest_m: f64) {
        let side = f64::from(1u32 << level);
        let index = layout.index(level, at.x, at.y);
        let terms = largest_m + (self.slope.x.abs() + self.slope.y.abs()) * side + self.highest - self.lowest;
        // the sums of a node have up to 81 terms, added one by one; the kernel adds 1e-6 of the terms to the radius
        let samples = if level <= EXACT_LEVELS { (f64::from((1u32 << level) + 1)).powi(2) } else { 8.0 };
        let bound = 2.0 * samples * EPSILON * terms + 3.0 * self.off_m + 2.0 * off_slope(self.slope) * side;
        let middle = self.middle_m + 0.5 * (self.lowest + self.highest);
        // of a sum over samples, what rounds the heights by that much turns a plane through them by it over their extent
        let turned = if level <= EXACT_LEVELS { 8.0 * samples * EPSILON * terms / self.extent } else { self.off_slope };
        planes.off_slope[index] = turned + off_slope(self.slope) + 8.0 * EPSILON * self.slope.abs().max_element();
        planes.slopes[index] = self.slope;
        planes.values.set(2 * index, middle, bound);
        planes.values.set(2 * index + 1, 0.5 * (self.highest - self.lowest), bound + 1e-6 * terms);
    }
}
