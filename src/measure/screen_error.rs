//! Screen-space error at every pixel: how far, in pixels, the drawn surface point is from the true surface at the
//! same ground position. The metric of all five papers, against exact ground truth in f64.

use glam::DVec2;
use rayon::prelude::*;

use super::Measured;
use crate::camera::Camera;
use crate::experiment::scene::Surface;
use crate::terrain::HeightField;

/// Error of one pixel.
pub const SKY: f32 = f32::NAN;

/// One frame's pixels: error in pixels where something was drawn, NaN elsewhere.
#[derive(Clone, Debug)]
pub struct FrameError {
    pub error_px: Vec<f32>,
    /// Pixels where one of drawn and true is sky and the other is surface.
    pub silhouette_misses: usize,
    pub drawn: usize,
    pub true_hits: usize,
}

/// `drawn_m` and `true_m` are distances along each pixel's ray in metres, negative where there is no surface.
pub fn frame(terrain: &HeightField, surface: Surface, camera: &Camera, drawn_m: &[f32], true_m: &[f32]) -> FrameError {
    let width = camera.viewport.0 as usize;
    let diagonal_px = f64::from(camera.viewport.0).hypot(f64::from(camera.viewport.1));
    let pixel_error = |(at, &drawn): (usize, &f32)| {
        if drawn < 0.0 {
            return SKY;
        }
        let pixel = DVec2::new((at % width) as f64 + 0.5, (at / width) as f64 + 0.5);
        let point = camera.eye_m + camera.ray(pixel) * f64::from(drawn);
        let truth = point.truncate().extend(terrain.surface_m(point.truncate(), surface));
        // a true surface behind the eye has no place in the picture: as far off as anything in it can be
        let off_px = camera.pixel(truth).map_or(diagonal_px, |place| place.distance(pixel).min(diagonal_px));
        off_px as f32
    };
    let error_px: Vec<f32> = drawn_m.par_iter().enumerate().map(pixel_error).collect();
    let count =
        |pick: fn(f32, f32) -> bool| drawn_m.iter().zip(true_m).filter(|(drawn, truth)| pick(**drawn, **truth)).count();
    FrameError {
        error_px,
        silhouette_misses: count(|drawn, truth| (drawn < 0.0) != (truth < 0.0)),
        drawn: count(|drawn, _| drawn >= 0.0),
        true_hits: count(|_, truth| truth >= 0.0),
    }
}

/// Errors of all frames of a cell.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    errors_px: Vec<f32>,
    pixels: usize,
    silhouette_misses: usize,
    drawn: usize,
    true_hits: usize,
}

impl Summary {
    pub fn add(&mut self, frame: &FrameError) {
        self.errors_px.extend(frame.error_px.iter().filter(|error| !error.is_nan()));
        self.pixels += frame.error_px.len();
        self.silhouette_misses += frame.silhouette_misses;
        self.drawn += frame.drawn;
        self.true_hits += frame.true_hits;
    }

    pub fn measures(mut self, threshold_px: f64) -> Vec<Measured> {
        let count = self.errors_px.len();
        let sum = |power: i32| self.errors_px.par_iter().map(|&error| f64::from(error).powi(power)).sum::<f64>();
        let mean = |power| (count > 0).then(|| sum(power) / count as f64);
        let (mean_px, square) = (mean(1), mean(2));
        let over = self.errors_px.iter().filter(|&&error| f64::from(error) > threshold_px).count();
        let share = |part: usize| (self.pixels > 0).then(|| part as f64 / self.pixels as f64);
        let mut measures = vec![
            Measured::new("error_max", self.errors_px.iter().copied().reduce(f32::max).map(f64::from), "px"),
            Measured::new("error_mean", mean_px, "px"),
            Measured::new("error_rms", square.map(f64::sqrt), "px"),
            Measured::new("over_threshold", share(over), "of pixels"),
            Measured::new("silhouette_misses", share(self.silhouette_misses), "of pixels"),
            Measured::new("drawn", share(self.drawn), "of pixels"),
            Measured::new("true_surface", share(self.true_hits), "of pixels"),
        ];
        for percent in [50, 95, 99] {
            let value = percentile(&mut self.errors_px, f64::from(percent) / 100.0);
            measures.push(Measured::new(&format!("error_p{percent}"), value.map(f64::from), "px"));
        }
        measures
    }
}

/// The value below which `share` of the values are (nearest rank).
fn percentile(values: &mut [f32], share: f64) -> Option<f32> {
    let rank = ((share * values.len() as f64).ceil() as usize).max(1) - 1;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(rank, f32::total_cmp).1)
}
