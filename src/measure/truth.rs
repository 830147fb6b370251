//! The ground truth of a frame, and how exact it is itself.

use rayon::prelude::*;

use super::missed::Missed;
use super::screen_error::{drawn_error_px, middle};
use crate::camera::Camera;
use crate::ground::{Ground, Ray};

/// Exact distances and their shaded picture for one frame.
#[derive(Clone, Debug)]
pub struct TruthFrame {
    /// Along each pixel's ray, negative where there is no surface.
    pub distance_m: Vec<f64>,
    pub colour: Vec<u32>,
    /// The largest error that was found in the truth, in pixels; see [`error_px`].
    pub error_px: f64,
}

/// Pixels of a frame that are followed in f64, if it has so many.
const SAMPLE: usize = 1024;

/// The largest error of a frame's truth in pixels, in f64: at every pixel, how far what was hit is from the surface at its place; and at
/// no fewer than 1024 pixels, or all, how far the surface sticks out over the ray before that. The pixels are one of each run of equal
/// length, at another place in each.
pub fn error_px(ground: &dyn Ground, camera: &Camera, true_m: &[f64]) -> f64 {
    let pixel = |at: usize| middle(camera, at);
    let hits = true_m.par_iter().enumerate().filter(|(_, true_m)| **true_m >= 0.0);
    let hit_px = hits.map(|(at, &true_m)| drawn_error_px(ground, camera, pixel(at), true_m));
    let hit_px = hit_px.reduce(|| 0.0, f64::max);
    let run = (true_m.len() / SAMPLE).max(1);
    let missed = Missed { ground, camera };
    let followed = (0..true_m.len() / run).into_par_iter().map(|number| {
        // steps of the golden ratio: all columns come about as often
        let within = (number as f64 * 0.618_033_988_749_895).fract() * run as f64;
        let at = number * run + within as usize;
        missed.passed_px(pixel(at), true_m[at])
    });
    followed.reduce(|| 0.0, f64::max).max(hit_px)
}

/// The distances of one frame in f64.
pub fn cast(ground: &dyn Ground, camera: &Camera) -> Vec<f64> {
    let hit_m = |at: usize| {
        let ray = Ray { eye_m: camera.eye_m, direction: camera.ray(middle(camera, at)) };
        ground.first_hit(&ray).unwrap_or(-1.0)
    };
    let pixels = camera.viewport.0 as usize * camera.viewport.1 as usize;
    (0..pixels).into_par_iter().map(hit_m).collect()
}
