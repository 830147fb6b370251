//! The ground truth of a frame, and how exact it is itself.

use glam::DVec2;
use rayon::prelude::*;

use super::missed::Missed;
use super::screen_error::drawn_error_px;
use crate::camera::Camera;
use crate::ground::Ground;

/// Exact distances and their shaded picture for one frame.
#[derive(Clone, Debug)]
pub struct TruthFrame {
    pub distance_m: Vec<f32>,
    pub colour: Vec<u32>,
    /// The largest error that was found in the truth, in pixels; see [`error_px`].
    pub error_px: f64,
}

/// What the truth may be off by until somebody is warned.
pub const MOST_ERROR_PX: f64 = 0.01;

/// Pixels of a frame that are followed in f64, if it has so many.
const SAMPLE: usize = 1024;

/// The largest error of a frame's truth in pixels, in f64: at every pixel, how far what was hit is from the surface at its place; and at
/// no fewer than 1024 pixels, or all, how far the surface sticks out over the ray before that. The pixels are one of each run of equal
/// length, at another place in each.
pub fn error_px(ground: &dyn Ground, camera: &Camera, true_m: &[f32]) -> f64 {
    let width = camera.viewport.0 as usize;
    let pixel = |at: usize| DVec2::new((at % width) as f64 + 0.5, (at / width) as f64 + 0.5);
    let hits = true_m.par_iter().enumerate().filter(|(_, true_m)| **true_m >= 0.0);
    let hit_px = hits.map(|(at, &true_m)| drawn_error_px(ground, camera, pixel(at), true_m.into()));
    let hit_px = hit_px.reduce(|| 0.0, f64::max);
    let run = (true_m.len() / SAMPLE).max(1);
    let missed = Missed { ground, camera };
    let followed = (0..true_m.len() / run).into_par_iter().map(|number| {
        // steps of the golden ratio: all columns come about as often
        let within = (number as f64 * 0.618_033_988_749_895).fract() * run as f64;
        let at = number * run + within as usize;
        missed.passed_px(pixel(at), true_m[at].into())
    });
    followed.reduce(|| 0.0, f64::max).max(hit_px)
}
