//! Windows of a terrain that is not in memory: tiles that are read when somebody asks for a sample of them.

use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex};

use glam::{DVec2, DVec3, UVec2};
use lodlab::experiment::scene::Surface;
use lodlab::ground::cell::{Cell, bends};
use lodlab::ground::{Ground, Lattice, Part, Ray};

/// Cells a side of a tile.
const TILE: u32 = 16;

type Read = Box<dyn Fn(UVec2) -> f64 + Send + Sync>;

pub struct Window {
    lattice: Lattice,
    read: Read,
    tiles: Mutex<HashMap<UVec2, Arc<Vec<f64>>>>,
    /// What a store says of its tiles without reading them.
    parts: Vec<Part>,
    range_m: (f64, f64),
}

impl fmt::Debug for Window {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "Window({:?})", self.lattice)
    }
}

impl Window {
    /// `parts` a side are known of the terrain, and samples are read by tiles.
    pub fn new(lattice: Lattice, parts: u32, read: impl Fn(UVec2) -> f64 + Send + Sync + 'static) -> Self {
        let cut = |at: u32, last: u32| last * at / parts;
        let mut known = Vec::new();
        for (x, y) in (0..parts).flat_map(|y| (0..parts).map(move |x| (x, y))) {
            let last = lattice.last();
            let (from, to) =
                (UVec2::new(cut(x, last.x), cut(y, last.y)), UVec2::new(cut(x + 1, last.x), cut(y + 1, last.y)));
            let heights = (from.y..=to.y).flat_map(|y| (from.x..=to.x).map(move |x| UVec2::new(x, y))).map(&read);
            let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), h| (low.min(h), high.max(h)));
            let corner = |x: u32, y: u32, z: f64| lattice.world_from_sample(UVec2::new(x, y).as_dvec2()).extend(z);
            known.push(Part { low_m: corner(from.x, to.y, low), high_m: corner(to.x, from.y, high) });
        }
        let low = known.iter().map(|part| part.low_m.z).fold(f64::MAX, f64::min);
        let high = known.iter().map(|part| part.high_m.z).fold(f64::MIN, f64::max);
        Self { lattice, read: Box::new(read), tiles: Mutex::default(), parts: known, range_m: (low, high) }
    }

    pub fn tiles_read(&self) -> usize {
        self.tiles.lock().unwrap().len()
    }

    fn tile(&self, at: UVec2) -> Arc<Vec<f64>> {
        let mut tiles = self.tiles.lock().unwrap();
        let read = || {
            let samples =
                (0..TILE * TILE).map(|i| (at * TILE + UVec2::new(i % TILE, i / TILE)).min(self.lattice.last()));
            Arc::new(samples.map(&self.read).collect())
        };
        tiles.entry(at).or_insert_with(read).clone()
    }
}

impl Ground for Window {
    fn lattice(&self) -> Lattice {
        self.lattice
    }
    fn height_m(&self, sample: UVec2) -> f64 {
        let place = sample % TILE;
        self.tile(sample / TILE)[(place.y * TILE + place.x) as usize]
    }
    fn sample_m(&self, sample: UVec2) -> DVec3 {
        self.lattice.world_from_sample(sample.as_dvec2()).extend(self.height_m(sample))
    }
    fn up(&self, _: DVec3) -> DVec3 {
        DVec3::Z
    }
    fn surface_at(&self, point_m: DVec3) -> DVec3 {
        let last = self.lattice.last().as_dvec2();
        let sample = self.lattice.sample_from_world(point_m.truncate()).clamp(DVec2::ZERO, last);
        let at = sample.floor().min(last - 1.0).max(DVec2::ZERO);
        let height = |x, y| self.height_m(at.as_uvec2() + UVec2::new(x, y));
        let cell = Cell { nw: height(0, 0), ne: height(1, 0), sw: height(0, 1), se: height(1, 1) };
        point_m.truncate().extend(cell.surface_m(sample - at, Surface::Triangles))
    }
    fn margin_m(&self, point_m: DVec3) -> f64 {
        let place = point_m.truncate();
        place.min(self.lattice.extent_m() - place).min_element()
    }
    fn stay(&self, ray: &Ray) -> Option<(f64, f64)> {
        let origin = self.lattice.sample_from_world(ray.eye_m.truncate());
        let direction = self.lattice.cells_from_world(ray.direction.truncate());
        let (a, b) = (-origin / direction, (self.lattice.last().as_dvec2() - origin) / direction);
        let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        (enter <= leave).then_some((enter, leave))
    }
    fn bends(&self, ray: &Ray, from: f64, to: f64) -> Vec<f64> {
        let origin = self.lattice.sample_from_world(ray.eye_m.truncate());
        bends(origin, self.lattice.cells_from_world(ray.direction.truncate()), from, to)
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
        let (from, to) = (inside(low.floor()), inside(high.ceil()));
        let samples = (from.y..=to.y).flat_map(|y| (from.x..=to.x).map(move |x| UVec2::new(x, y)));
        Some(
            samples
                .map(|at| self.height_m(at))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z))),
        )
    }
    fn steepest(&self) -> f64 {
        let (low, high) = self.range_m;
        // a store knows its tiles' ranges: a bound, and not the steepest there is
        (high - low) / self.lattice.cell_m.min_element() * 2f64.sqrt()
    }
    fn identity(&self) -> String {
        let manifest = format!("{:?} {:?}", self.lattice, self.parts);
        blake3::hash(manifest.as_bytes()).to_hex().as_str()[..32].to_string()
    }
    fn truth(&self) -> &'static str {
        "[HeightPyramid, RayCast, Shade]"
    }
}
