//! What a picture should have shown and did not: how far the true surface sticks out over a pixel's ray.

use glam::DVec2;

use crate::camera::Camera;
use crate::ground::{Ground, Ray};

pub struct Missed<'a> {
    pub ground: &'a dyn Ground,
    pub camera: &'a Camera,
}

/// A ray that comes no farther over the ground than this, as a part of its way, runs along the border as far as f32 can tell.
const ALONG_BORDER: f64 = 1e-6;

impl Missed<'_> {
    /// How far, in pixels, the true surface sticks out over a pixel's ray between where the ray meets it and where it met
    /// what was drawn: the least error that the mesh must have there, since it lies under the ray. A pixel that shows what
    /// is there, or something nearer, has missed nothing. A ray that comes from under the surface is the same upside down.
    pub fn missed_px(&self, pixel: DVec2, drawn_m: f64, true_m: f64) -> f64 {
        if true_m < 0.0 || drawn_m >= 0.0 && drawn_m <= true_m {
            return 0.0;
        }
        let ray = self.ray(pixel);
        let Some((enter_m, leave_m)) = self.ground.stay(&ray) else { return 0.0 };
        let end_m = if drawn_m < 0.0 { leave_m } else { drawn_m.min(leave_m) };
        if self.is_along_border(&ray, (enter_m, end_m)) {
            return 0.0;
        }
        let side = self.side(&ray, enter_m);
        let passed_px = self.most_px(&ray, (true_m, end_m), pixel, side);
        // from outside, a ray can come in on the other side of the mesh than of the surface
        let beside_px = if enter_m > 0.0 { self.most_px(&ray, (enter_m, true_m), pixel, -side) } else { f64::INFINITY };
        passed_px.min(beside_px)
    }

    /// How far the true surface sticks out over a pixel's ray before it meets what was drawn, or in all of the picture if that is the sky:
    /// a cast in f64 that is told where it should have ended.
    pub fn passed_px(&self, pixel: DVec2, drawn_m: f64) -> f64 {
        let ray = self.ray(pixel);
        let Some((enter_m, leave_m)) = self.ground.stay(&ray) else { return 0.0 };
        let end_m = if drawn_m < 0.0 { leave_m } else { drawn_m.min(leave_m) };
        if self.is_along_border(&ray, (enter_m, end_m)) {
            return 0.0;
        }
        let side = self.side(&ray, enter_m);
        let passed_px = self.most_px(&ray, (enter_m, end_m), pixel, side);
        // at the border rounding can decide on which side a ray comes in
        if enter_m > 0.0 { passed_px.min(self.most_px(&ray, (enter_m, end_m), pixel, -side)) } else { passed_px }
    }

    fn ray(&self, pixel: DVec2) -> Ray {
        Ray { eye_m: self.camera.eye_m, direction: self.camera.ray(pixel) }
    }

    /// Whether a part of a ray is along the border itself, where over the ground and beside it are both right.
    fn is_along_border(&self, ray: &Ray, (enter_m, end_m): (f64, f64)) -> bool {
        self.ground.margin_m(ray.at(0.5 * (enter_m + end_m))) <= ALONG_BORDER * end_m
    }

    /// 1 for a ray that comes from over the surface, -1 from under it.
    fn side(&self, ray: &Ray, enter_m: f64) -> f64 {
        if self.over_m(ray, enter_m) <= 0.0 { 1.0 } else { -1.0 }
    }

    /// Surface above a ray, in metres.
    fn over_m(&self, ray: &Ray, t: f64) -> f64 {
        -self.ground.above_m(ray.at(t))
    }

    /// The most that the surface is over a part of a ray (or, with -1, under it), in pixels.
    fn most_px(&self, ray: &Ray, (start_m, end_m): (f64, f64), pixel: DVec2, side: f64) -> f64 {
        let over_px = |t: f64| {
            if side * self.over_m(ray, t) <= 0.0 {
                return 0.0;
            }
            let place = self.camera.pixel(self.ground.surface_at(ray.at(t)));
            place.map_or(f64::INFINITY, |place| place.distance(pixel))
        };
        self.ground.crests(ray, (start_m, end_m), side).into_iter().map(over_px).fold(0.0, f64::max)
    }
}
