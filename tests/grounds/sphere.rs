//! A sphere with samples in longitude and latitude: the first column comes after the last, and each pole is a row. Between samples, heights
//! are bilinear in the map.

use glam::{DVec2, DVec3, UVec2};
use lodlab::experiment::scene::Surface;
use lodlab::ground::cell::Cell;
use lodlab::ground::{Ground, Lattice, Part, Ray};
use std::f64::consts::{PI, TAU};

#[derive(Debug)]
pub struct Sphere {
    radius_m: f64,
    size: UVec2,
    heights_m: Vec<f64>,
    range_m: (f64, f64),
    parts: Vec<Part>,
}

/// Parts a side.
const PARTS: u32 = 8;

impl Sphere {
    pub fn new(radius_m: f64, size: UVec2, height: impl Fn(UVec2) -> f64) -> Self {
        let heights_m: Vec<f64> =
            (0..size.element_product()).map(|at| height(UVec2::new(at % size.x, at / size.x))).collect();
        let range_m = heights_m.iter().fold((f64::MAX, f64::MIN), |(low, high), h| (low.min(*h), high.max(*h)));
        let mut sphere = Self { radius_m, size, heights_m, range_m, parts: Vec::new() };
        let places = (0..PARTS).flat_map(|y| (0..PARTS).map(move |x| UVec2::new(x, y)));
        sphere.parts = places.map(|at| sphere.part(at)).collect();
        sphere
    }

    /// A box around a patch of longitude and latitude: of a patch that is no wider than this, it sticks out of its corners by less than the
    /// height of its arcs.
    fn part(&self, at: UVec2) -> Part {
        let (low, high) = self.range_m;
        let (width, height) = (TAU / f64::from(PARTS), PI / f64::from(PARTS));
        let most_m = (self.radius_m + high) * (1.0 - (0.5 * width).cos() * (0.5 * height).cos());
        let corners = [0, 1, 2, 3].map(|i| {
            let (lon, theta) = (f64::from(at.x + i % 2) * width, f64::from(at.y + i / 2) * height);
            direction(lon, theta)
        });
        let radii = [self.radius_m + low, self.radius_m + high];
        let points = corners.iter().flat_map(|corner| radii.map(|radius| *corner * radius));
        let (low_m, high_m) = points.fold((DVec3::MAX, DVec3::MIN), |(low, high), p| (low.min(p), high.max(p)));
        Part { low_m: low_m - most_m, high_m: high_m + most_m }
    }

    /// Sample coordinates of a place.
    fn sample(&self, point_m: DVec3) -> DVec2 {
        let lon = point_m.y.atan2(point_m.x).rem_euclid(TAU);
        let theta = point_m.truncate().length().atan2(point_m.z);
        DVec2::new(lon / TAU * f64::from(self.size.x), theta / PI * f64::from(self.size.y - 1))
    }

    fn surface_m(&self, point_m: DVec3) -> f64 {
        let sample = self.sample(point_m);
        let at = sample.floor().min(DVec2::new(f64::INFINITY, f64::from(self.size.y - 2)));
        let height = |x: u32, y: u32| {
            let column = (at.x as u32 + x) % self.size.x;
            self.heights_m[((at.y as u32 + y) * self.size.x + column) as usize]
        };
        let cell = Cell { nw: height(0, 0), ne: height(1, 0), sw: height(0, 1), se: height(1, 1) };
        cell.surface_m(sample - at, Surface::Bilinear)
    }
}

/// `theta` is the angle from the north pole.
fn direction(lon: f64, theta: f64) -> DVec3 {
    DVec3::new(theta.sin() * lon.cos(), theta.sin() * lon.sin(), theta.cos())
}

/// Both roots of a t^2 + 2 b t + c.
fn roots(a: f64, b: f64, c: f64) -> Vec<f64> {
    let discriminant = b * b - a * c;
    if discriminant < 0.0 || a == 0.0 {
        return Vec::new();
    }
    vec![(-b - discriminant.sqrt()) / a, (-b + discriminant.sqrt()) / a]
}

impl Ground for Sphere {
    fn lattice(&self) -> Lattice {
        let cell_m = DVec2::new(TAU / f64::from(self.size.x), PI / f64::from(self.size.y - 1)) * self.radius_m;
        Lattice { size: self.size, cell_m }
    }
    fn height_m(&self, sample: UVec2) -> f64 {
        self.heights_m[(sample.y * self.size.x + sample.x) as usize]
    }
    fn sample_m(&self, sample: UVec2) -> DVec3 {
        let (lon, theta) =
            (f64::from(sample.x) / f64::from(self.size.x) * TAU, f64::from(sample.y) / f64::from(self.size.y - 1) * PI);
        direction(lon, theta) * (self.radius_m + self.height_m(sample))
    }
    fn up(&self, point_m: DVec3) -> DVec3 {
        point_m.normalize_or(DVec3::Z)
    }
    fn surface_at(&self, point_m: DVec3) -> DVec3 {
        self.up(point_m) * (self.radius_m + self.surface_m(point_m))
    }
    fn above_m(&self, point_m: DVec3) -> f64 {
        point_m.length() - self.radius_m - self.surface_m(point_m)
    }
    fn margin_m(&self, _: DVec3) -> f64 {
        f64::INFINITY
    }
    fn stay(&self, ray: &Ray) -> Option<(f64, f64)> {
        let outer_m = self.radius_m + self.range_m.1;
        let (eye, d) = (ray.eye_m, ray.direction);
        let found = roots(d.length_squared(), eye.dot(d), eye.length_squared() - outer_m * outer_m);
        let [enter, leave] = found[..] else { return None };
        (leave >= 0.0).then_some((enter.max(0.0), leave))
    }
    /// Where a ray crosses the half planes of meridians and the cones of parallels.
    fn bends(&self, ray: &Ray, from: f64, to: f64) -> Vec<f64> {
        let (eye, d) = (ray.eye_m, ray.direction);
        let meridians = (0..self.size.x).map(|column| {
            let lon = f64::from(column) / f64::from(self.size.x) * TAU;
            let normal = DVec3::new(-lon.sin(), lon.cos(), 0.0);
            -eye.dot(normal) / d.dot(normal)
        });
        let parallels = (0..self.size.y).flat_map(|row| {
            let cos = (f64::from(row) / f64::from(self.size.y - 1) * PI).cos();
            let cone = |a: DVec3, b: DVec3| a.z * b.z - cos * cos * a.dot(b);
            roots(cone(d, d), cone(eye, d), cone(eye, eye))
        });
        meridians.chain(parallels).filter(|t| (from..=to).contains(t)).collect()
    }
    fn parts(&self) -> &[Part] {
        &self.parts
    }
    fn range_m(&self) -> (f64, f64) {
        self.range_m
    }
    fn range_over_m(&self, _: DVec2, _: DVec2) -> Option<(f64, f64)> {
        Some(self.range_m)
    }
    fn steepest(&self) -> f64 {
        let at = |x: u32, y: u32| self.height_m(UVec2::new(x % self.size.x, y));
        let slopes = (0..self.size.y - 1).flat_map(|y| (0..self.size.x).map(move |x| (x, y))).map(|(x, y)| {
            // along a parallel, cells get narrower towards a pole
            let narrow = (f64::from(y).max(0.5) / f64::from(self.size.y - 1) * PI).sin().abs().max(1e-9);
            let cell_m = self.lattice().cell_m;
            ((at(x + 1, y) - at(x, y)) / (cell_m.x * narrow)).hypot((at(x, y + 1) - at(x, y)) / cell_m.y)
        });
        slopes.fold(0.0, f64::max)
    }
    fn identity(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&self.radius_m.to_le_bytes());
        self.heights_m.iter().for_each(|height| {
            hasher.update(&height.to_le_bytes());
        });
        hasher.finalize().to_hex().as_str()[..32].to_string()
    }
    fn truth(&self) -> &'static str {
        "[SphereCast, Shade]"
    }
}
