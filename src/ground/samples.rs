//! The ground of a plane: one height for each sample of a rectangle, all in memory.

use std::sync::{Arc, OnceLock};

use glam::{DVec2, DVec3, UVec2};
use rayon::prelude::*;

use super::cast::{self, Nodes};
use super::cell::{Cell, bends};
use super::{Ground, Lattice, Part, Ray, foreground};
use crate::experiment::scene::Surface;
use crate::terrain::HeightField;

/// Parts a side that the ground is cut into.
const PARTS: u32 = 16;

/// Heights with a surface between them.
#[derive(Clone, Debug)]
pub struct Samples {
    lattice: Lattice,
    heights: Heights,
    surface: Surface,
    range_m: (f64, f64),
    parts: Vec<Part>,
    /// Found when somebody asks for it: the steepest slope, and the most that a cell's heights differ by.
    steepest: OnceLock<(f64, f64)>,
    nodes: OnceLock<Nodes>,
}

#[derive(Clone, Debug)]
enum Heights {
    Field(Arc<HeightField>),
    /// What a kernel has left.
    Made(Arc<[f64]>),
}

impl Samples {
    /// The terrain of a scene.
    pub fn new(field: Arc<HeightField>, surface: Surface) -> Self {
        let lattice = Lattice { size: field.size, cell_m: field.cell_m };
        Self::of(lattice, Heights::Field(field), surface)
    }

    /// Other heights in the place of a ground's own.
    pub fn made(lattice: Lattice, heights_m: Arc<[f64]>, surface: Surface) -> Self {
        Self::of(lattice, Heights::Made(heights_m), surface)
    }

    fn of(lattice: Lattice, heights: Heights, surface: Surface) -> Self {
        let mut samples = Self {
            lattice,
            heights,
            surface,
            range_m: (0.0, 0.0),
            parts: Vec::new(),
            steepest: OnceLock::new(),
            nodes: OnceLock::new(),
        };
        let ranges = samples.ranges_of_parts();
        let low = ranges.iter().map(|(_, low, _)| *low).fold(f64::INFINITY, f64::min);
        let high = ranges.iter().map(|(_, _, high)| *high).fold(f64::NEG_INFINITY, f64::max);
        samples.range_m = (low, high);
        samples.parts = ranges
            .into_iter()
            .map(|((from, to), low, high)| {
                let corner = |column: u32, row: u32, height_m: f64| {
                    lattice.world_from_sample(DVec2::new(column.into(), row.into())).extend(height_m)
                };
                Part { low_m: corner(from.x, to.y, low), high_m: corner(to.x, from.y, high) }
            })
            .collect();
        samples
    }

    /// First and last sample of each part, and its lowest and highest height.
    fn ranges_of_parts(&self) -> Vec<((UVec2, UVec2), f64, f64)> {
        let last = self.lattice.last();
        let count = last.min(UVec2::splat(PARTS));
        let cut = |at: u32, last: u32, count: u32| (last * at / count, last * (at + 1) / count);
        let places = (0..count.y).flat_map(|y| (0..count.x).map(move |x| UVec2::new(x, y)));
        let samples = |at: UVec2| {
            let ((left, right), (top, bottom)) = (cut(at.x, last.x, count.x), cut(at.y, last.y, count.y));
            (UVec2::new(left, top), UVec2::new(right, bottom))
        };
        let all: Vec<(UVec2, UVec2)> = places.map(samples).collect();
        let range = |(from, to): (UVec2, UVec2)| {
            let (low, high) = self.range_of_samples(from, to);
            ((from, to), low, high)
        };
        all.into_par_iter().map(range).collect()
    }

    fn range_of_samples(&self, from: UVec2, to: UVec2) -> (f64, f64) {
        let heights = (from.y..=to.y).flat_map(|y| (from.x..=to.x).map(move |x| self.height_m(UVec2::new(x, y))));
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), height| (low.min(height), high.max(height)))
    }

    fn cell(&self, at: UVec2) -> Cell {
        let height = |x, y| self.height_m(at + UVec2::new(x, y));
        Cell { nw: height(0, 0), ne: height(1, 0), sw: height(0, 1), se: height(1, 1) }
    }

    /// The steepest slope, and the most that the heights of a cell differ by.
    fn steepest_and_rise_m(&self) -> (f64, f64) {
        let cells = self.lattice.last();
        let most = |a: (f64, f64), b: (f64, f64)| (a.0.max(b.0), a.1.max(b.1));
        let of_cell = |at: UVec2| {
            let cell = self.cell(at);
            let (low, high) = cell.range();
            (cell.steepest(self.lattice.cell_m, self.surface), high - low)
        };
        let in_row = |y| (0..cells.x).map(|x| of_cell(UVec2::new(x, y))).fold((0.0, 0.0), most);
        *self.steepest.get_or_init(|| (0..cells.y).into_par_iter().map(in_row).reduce(|| (0.0, 0.0), most))
    }

    fn surface_m(&self, position_m: DVec2) -> f64 {
        let last = self.lattice.last().as_dvec2();
        let sample = self.lattice.sample_from_world(position_m).clamp(DVec2::ZERO, last);
        let at = sample.floor().min(last - 1.0).max(DVec2::ZERO);
        self.cell(at.as_uvec2()).surface_m(sample - at, self.surface)
    }
}

impl Ground for Samples {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn height_m(&self, sample: UVec2) -> f64 {
        let at = (sample.y * self.lattice.size.x + sample.x) as usize;
        match &self.heights {
            Heights::Field(field) => field.heights_m[at].into(),
            Heights::Made(heights_m) => heights_m[at],
        }
    }

    fn sample_m(&self, sample: UVec2) -> DVec3 {
        self.lattice.world_from_sample(sample.as_dvec2()).extend(self.height_m(sample))
    }

    fn up(&self, _point_m: DVec3) -> DVec3 {
        DVec3::Z
    }

    fn surface_at(&self, point_m: DVec3) -> DVec3 {
        let place = point_m.truncate();
        place.extend(self.surface_m(place))
    }

    fn above_m(&self, point_m: DVec3) -> f64 {
        point_m.z - self.surface_m(point_m.truncate())
    }

    fn margin_m(&self, point_m: DVec3) -> f64 {
        let place = point_m.truncate();
        place.min(self.lattice.extent_m() - place).min_element()
    }

    fn stay(&self, ray: &Ray) -> Option<(f64, f64)> {
        let origin = self.lattice.sample_from_world(ray.eye_m.truncate());
        let direction = self.lattice.cells_from_world(ray.direction.truncate());
        let last = self.lattice.last().as_dvec2();
        let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
        for axis in 0..2 {
            if direction[axis] == 0.0 {
                if origin[axis] < 0.0 || origin[axis] > last[axis] {
                    return None;
                }
                continue;
            }
            let (a, b) = (-origin[axis] / direction[axis], (last[axis] - origin[axis]) / direction[axis]);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        if leave.is_infinite() {
            // straight up or down: nothing is beyond the lowest and the highest height
            let (low, high) = self.range_m;
            let eye_m = ray.eye_m.z;
            leave = ((low - eye_m).abs().max((high - eye_m).abs()) + 1.0) / ray.direction.z.abs().max(1e-300);
        }
        (enter <= leave).then_some((enter, leave))
    }

    fn among_heights(&self, ray: &Ray, part: (f64, f64)) -> (f64, f64) {
        cast::among(self.range_m, ray, part)
    }

    fn bends(&self, ray: &Ray, from: f64, to: f64) -> Vec<f64> {
        let origin = self.lattice.sample_from_world(ray.eye_m.truncate());
        bends(origin, self.lattice.cells_from_world(ray.direction.truncate()), from, to)
    }

    fn first_hit(&self, ray: &Ray) -> Option<f64> {
        self.nodes.get_or_init(|| Nodes::new(self)).first_hit(self, ray)
    }

    fn parts(&self) -> &[Part] {
        &self.parts
    }

    fn range_m(&self) -> (f64, f64) {
        self.range_m
    }

    fn range_over_m(&self, low: DVec2, high: DVec2) -> Option<(f64, f64)> {
        let last = self.lattice.last().as_dvec2();
        if low.cmpgt(last).any() || high.cmplt(DVec2::ZERO).any() {
            return None;
        }
        let inside = |sample: DVec2| sample.clamp(DVec2::ZERO, last).as_uvec2();
        Some(self.range_of_samples(inside(low.floor()), inside(high.ceil())))
    }

    fn steepest(&self) -> f64 {
        self.steepest_and_rise_m().0
    }

    fn steepest_seen(&self) -> f64 {
        // of a long and narrow cell, more than its slope is seen from next to it
        let (steepest, rise_m) = self.steepest_and_rise_m();
        steepest.max(rise_m / (foreground::BEYOND_CELLS * self.lattice.cell_m.min_element()))
    }

    fn identity(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(bytemuck::bytes_of(&self.lattice.size.to_array()));
        hasher.update(bytemuck::bytes_of(&self.lattice.cell_m.to_array()));
        match &self.heights {
            Heights::Field(field) => hasher.update(bytemuck::cast_slice(&field.heights_m)),
            Heights::Made(heights_m) => hasher.update(bytemuck::cast_slice(heights_m)),
        };
        hasher.finalize().to_hex().as_str()[..32].to_string()
    }

    fn truth(&self) -> &'static str {
        "[HeightPyramid, RayCast, Shade]"
    }
}
