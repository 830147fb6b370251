//! Cameras: f64 on the CPU, camera-relative f32 on the GPU.

use glam::{DMat3, DVec2, DVec3};

use crate::experiment::scene::{self, Scene};
use crate::ground::{Ground, foreground};

/// How often the sum of octaves is rounded to 2^-24 of what all can add: ten times as far as the hunt has seen, of the 160 that are derived for
/// references.
const OCTAVES_ROUNDED: f64 = 20.0;

/// One frame's camera. Pixel (0, 0) is top left, pixel centres are at +0.5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// World metres.
    pub eye_m: DVec3,
    /// Columns: right, up, forward, orthonormal, in world coordinates.
    pub world_from_view: DMat3,
    /// Tangents of half the horizontal and half the vertical field of view.
    pub half_tan: DVec2,
    pub viewport: (u32, u32),
}

impl Camera {
    pub fn looking_at(eye_m: DVec3, target_m: DVec3, scene: &Scene) -> Self {
        let forward = (target_m - eye_m).normalize_or(DVec3::Y);
        Self::new(eye_m, forward, 0.0, scene)
    }

    fn new(eye_m: DVec3, forward: DVec3, roll_rad: f64, scene: &Scene) -> Self {
        // straight up or down, "right" is east: any choice will do, but it must be one
        let right = forward.cross(DVec3::Z).try_normalize().unwrap_or(DVec3::X);
        let up = right.cross(forward);
        let (sin, cos) = roll_rad.sin_cos();
        let world_from_view = DMat3::from_cols(right * cos - up * sin, up * cos + right * sin, forward);
        let vertical = (scene.fov_deg.to_radians() / 2.0).tan();
        let (width, height) = scene.viewport;
        let half_tan = DVec2::new(vertical * f64::from(width) / f64::from(height), vertical);
        Self { eye_m, world_from_view, half_tan, viewport: scene.viewport }
    }

    /// Pixels from the middle of the picture to where a ray at 45 degrees to the view direction leaves it.
    pub fn focal_px(&self) -> f64 {
        f64::from(self.viewport.1) / (2.0 * self.half_tan.y)
    }

    /// The most pixels that a place moves by whose height is off by a part of its distance: a metre of height at a depth of 1, on the ray
    /// that it moves most, times the length of the longest ray.
    pub fn most_px(&self) -> f64 {
        let up = self.forward().z;
        self.focal_px() * self.most_of(|ray| (ray * up - DVec3::Z).length()) * self.most_of(|ray| ray.length())
    }

    /// The largest value of a convex function of the picture's rays, which is at a corner.
    pub fn most_of(&self, value: impl Fn(DVec3) -> f64) -> f64 {
        let (width, height) = (f64::from(self.viewport.0), f64::from(self.viewport.1));
        let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
        corners.into_iter().map(|(x, y)| value(self.view_ray(DVec2::new(x, y)))).fold(0.0, f64::max)
    }

    /// By how much rounding in f32 can move what a ray meets, in pixels: heights and places are rounded eight times to 2^-24 of the
    /// distance, and a place that is off is on a slope. Octaves are rounded to a part of their own height, however near they are.
    pub fn rounding_px(&self, ground: &dyn Ground) -> f64 {
        let of_octaves = ground.detail().map_or(0.0, |detail| {
            OCTAVES_ROUNDED * 2f64.powi(-24) * detail.octaves().most_m()
                / foreground::least_distance_m(ground, self.eye_m)
        });
        self.most_px() * (8.0 * 2f64.powi(-24) * ground.steepest_seen().hypot(1.0) + of_octaves)
    }

    pub fn forward(&self) -> DVec3 {
        self.world_from_view.z_axis
    }

    /// Unit direction in the world of the ray through a point of the image, in pixels.
    pub fn ray(&self, pixel: DVec2) -> DVec3 {
        self.view_ray(pixel).normalize()
    }

    /// Like [`Camera::ray`], with length 1 along the view direction instead.
    fn view_ray(&self, pixel: DVec2) -> DVec3 {
        let size = DVec2::new(f64::from(self.viewport.0), f64::from(self.viewport.1));
        let ndc = DVec2::new(pixel.x / size.x * 2.0 - 1.0, 1.0 - pixel.y / size.y * 2.0);
        self.world_from_view * (ndc * self.half_tan).extend(1.0)
    }

    /// Image position in pixels of a world point, or `None` behind the eye.
    pub fn pixel(&self, point_m: DVec3) -> Option<DVec2> {
        let view = self.world_from_view.transpose() * (point_m - self.eye_m);
        let ndc = DVec2::new(view.x, view.y) / view.z / self.half_tan;
        let size = DVec2::new(f64::from(self.viewport.0), f64::from(self.viewport.1));
        (view.z > 0.0).then(|| DVec2::new(ndc.x + 1.0, 1.0 - ndc.y) / 2.0 * size)
    }

    /// `right`, `down` and `corner` such that `corner + x * right + y * down` is the view ray of pixel (x, y).
    pub fn pixel_basis(&self) -> [DVec3; 3] {
        let corner = self.view_ray(DVec2::ZERO);
        [self.view_ray(DVec2::X) - corner, self.view_ray(DVec2::Y) - corner, corner]
    }
}

/// The cameras of all frames, the same ones every time.
pub fn path(scene: &Scene, ground: &dyn Ground) -> Vec<Camera> {
    let frames = scene.camera.frames();
    (0..frames)
        .map(|frame| match &scene.camera {
            scene::Camera::Still(still) => still_camera(still, scene, ground),
            scene::Camera::Orbit(orbit) => {
                let share = f64::from(frame) / f64::from(frames);
                let angle = (orbit.start_deg + 360.0 * orbit.turns * share).to_radians();
                let center = DVec3::from(orbit.center);
                let offset = DVec3::new(angle.sin() * orbit.radius_m, angle.cos() * orbit.radius_m, orbit.height_m);
                Camera::looking_at(ground.stand(center + offset, orbit.clearance_m), center, scene)
            }
            scene::Camera::Flight(flight) => {
                let share = if frames == 1 { 0.0 } else { f64::from(frame) / f64::from(frames - 1) };
                let at = share * flight.keys.len().saturating_sub(1) as f64;
                let eye = spline(&flight.keys, at, |key| key.eye.into());
                let target = spline(&flight.keys, at, |key| key.look_at.into());
                Camera::looking_at(ground.stand(eye, flight.clearance_m), target, scene)
            }
        })
        .collect()
}

fn still_camera(still: &scene::Still, scene: &Scene, ground: &dyn Ground) -> Camera {
    let eye = ground.stand(still.eye.into(), still.clearance_m);
    let (yaw, pitch) = (still.yaw_deg.to_radians(), still.pitch_deg.to_radians());
    let forward = match still.look_at {
        Some(target) => (DVec3::from(target) - eye).normalize_or(DVec3::Y),
        None => DVec3::new(yaw.sin() * pitch.cos(), yaw.cos() * pitch.cos(), pitch.sin()),
    };
    Camera::new(eye, forward, still.roll_deg.to_radians(), scene)
}

/// Catmull-Rom through the keys at `at`, counted in keys; the ends are doubled.
fn spline(keys: &[scene::Key], at: f64, point: impl Fn(&scene::Key) -> DVec3) -> DVec3 {
    let Some(last) = keys.len().checked_sub(1) else { return DVec3::ZERO };
    let from = (at.floor() as usize).min(last.saturating_sub(1));
    let t = at - from as f64;
    let key = |offset: isize| point(&keys[from.saturating_add_signed(offset).min(last)]);
    let (a, b, c, d) = (key(-1), key(0), key(1), key(2));
    0.5 * (2.0 * b + (c - a) * t + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t + (3.0 * (b - c) + d - a) * t * t * t)
}
