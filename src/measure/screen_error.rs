//! Screen-space error at every pixel: how far, in pixels, the drawn surface point is from the true surface at the
//! same ground position. The metric of all five papers, against exact ground truth in f64.

use glam::DVec2;
use rayon::prelude::*;

use super::Measured;
use crate::camera::Camera;
use crate::experiment::scene::Surface;
use crate::terrain::HeightField;

/// The error of a pixel on which nothing was drawn.
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

/// Errors of all frames of a cell, in constant memory.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    errors: Distribution,
    over_threshold: usize,
    pixels: usize,
    silhouette_misses: usize,
    drawn: usize,
    true_hits: usize,
}

impl Summary {
    pub fn add(&mut self, frame: &FrameError, threshold_px: f64) {
        for error in frame.error_px.iter().filter(|error| !error.is_nan()).map(|&error| f64::from(error)) {
            self.errors.add(error);
            self.over_threshold += usize::from(error > threshold_px);
        }
        self.pixels += frame.error_px.len();
        self.silhouette_misses += frame.silhouette_misses;
        self.drawn += frame.drawn;
        self.true_hits += frame.true_hits;
    }

    pub fn measures(&self) -> Vec<Measured> {
        let errors = &self.errors;
        let mean = |sum: f64| (errors.count > 0).then(|| sum / errors.count as f64);
        let share = |part: usize| (self.pixels > 0).then(|| part as f64 / self.pixels as f64);
        let mut measures = vec![
            Measured::new("error_max", (errors.count > 0).then_some(errors.largest), "px"),
            Measured::new("error_mean", mean(errors.sum), "px"),
            Measured::new("error_rms", mean(errors.sum_of_squares).map(f64::sqrt), "px"),
            Measured::new("over_threshold", share(self.over_threshold), "of pixels"),
            Measured::new("silhouette_misses", share(self.silhouette_misses), "of pixels"),
            Measured::new("drawn", share(self.drawn), "of pixels"),
            Measured::new("true_surface", share(self.true_hits), "of pixels"),
        ];
        for percent in [50, 95, 99] {
            let value = errors.percentile(f64::from(percent) / 100.0);
            measures.push(Measured::new(&format!("error_p{percent}"), value, "px"));
        }
        measures
    }
}

/// Maximum, sums, and a histogram whose bins are a thousandth wide, from a millionth of a pixel up.
#[derive(Clone, Debug, Default)]
struct Distribution {
    count: u64,
    sum: f64,
    sum_of_squares: f64,
    largest: f64,
    bins: Vec<u64>,
}

const SMALLEST_PX: f64 = 1e-6;
const BIN_WIDTH: f64 = 1e-3;

impl Distribution {
    fn add(&mut self, error_px: f64) {
        self.count += 1;
        self.sum += error_px;
        self.sum_of_squares += error_px * error_px;
        self.largest = self.largest.max(error_px);
        let bin = ((error_px.max(SMALLEST_PX) / SMALLEST_PX).ln() / BIN_WIDTH) as usize;
        if bin >= self.bins.len() {
            self.bins.resize(bin + 1, 0);
        }
        self.bins[bin] += 1;
    }

    /// The value below which `share` of the values are, to a thousandth of it (nearest rank).
    fn percentile(&self, share: f64) -> Option<f64> {
        let rank = ((share * self.count as f64).ceil() as u64).max(1);
        let mut below = 0;
        let bin = self.bins.iter().position(|count| {
            below += count;
            below >= rank
        })?;
        Some((SMALLEST_PX * ((bin as f64 + 0.5) * BIN_WIDTH).exp()).min(self.largest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_right_to_a_thousandth() {
        let mut errors = Distribution::default();
        (1..=1000).rev().for_each(|error| errors.add(f64::from(error) / 100.0));
        for (share, exact) in [(0.5, 5.0), (0.95, 9.5), (0.99, 9.9), (1.0, 10.0)] {
            let value = errors.percentile(share).unwrap();
            assert!((value / exact - 1.0).abs() <= 1e-3, "{share}: {value}");
        }
        assert_eq!(Distribution::default().percentile(0.5), None);
        assert_eq!((errors.count, errors.largest), (1000, 10.0));
    }
}
