//! Screen-space error at every pixel: how far, in pixels, the drawn surface point is from the true surface at the
//! same ground position. The metric of all five papers, against exact ground truth in f64.

use glam::DVec2;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::coverage::{Counts, drawn_distance};
use super::missed::Missed;
use super::truth::MOST_ERROR_PX;
use super::{Column, Figures, Info, Measure, Measured, Picture, Seen, Show, Tally, read_as};
use crate::camera::Camera;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::ground::Ground;
use crate::plan::product::Drawn;
use crate::plan::{BufferId, Chain};

pub const INFO: Info = Info {
    name: "ScreenError",
    summary: "pixel distance between the drawn surface and the true surface at the same ground position",
    version: 2,
    parameters: schema::<ScreenError>,
    read: read_as::<ScreenError>,
    columns: &[
        Column { heading: "error mean px", figure: "error_mean", show: Show::Number },
        Column { heading: "rms", figure: "error_rms", show: Show::Number },
        Column { heading: "p99", figure: "error_p99", show: Show::Number },
        Column { heading: "max", figure: "error_max", show: Show::Number },
        Column { heading: "over %", figure: "over_threshold", show: Show::Percent },
        Column { heading: "sky miss %", figure: "silhouette_misses", show: Show::Percent },
    ],
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ScreenError {
    /// pixels above it are counted
    #[schemars(extend("minimum" = 0))]
    threshold_px: f64,
}

impl Default for ScreenError {
    fn default() -> Self {
        Self { threshold_px: 1.0 }
    }
}

impl Measure for ScreenError {
    fn needs(&self, chain: &Chain) -> Result<Vec<BufferId>, Diagnostic> {
        Ok(vec![drawn_distance(chain)?])
    }

    fn wants_truth(&self) -> bool {
        true
    }

    fn begin(&self) -> Box<dyn Tally> {
        Box::new(Summary { threshold_px: self.threshold_px, ..Summary::default() })
    }
}

/// The error of a pixel on which nothing was drawn.
pub const SKY: f32 = f32::NAN;

/// One frame's pixels: error in pixels where something was drawn, NaN elsewhere.
#[derive(Clone, Debug)]
pub struct FrameError {
    pub error_px: Vec<f32>,
    /// With a bound that the method promised: pixels that break it, and the largest error of any pixel, what it should have
    /// shown included.
    pub broken: Option<Broken>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Broken {
    pub pixels: usize,
    pub worst_px: f64,
}

/// How far, in pixels, what a pixel shows at a distance is from the true surface at the same ground position.
pub fn drawn_error_px(ground: &dyn Ground, camera: &Camera, pixel: DVec2, drawn_m: f64) -> f64 {
    let truth = ground.surface_at(camera.eye_m + camera.ray(pixel) * drawn_m);
    // a true surface behind the eye has no place in the picture: as far off as anything in it can be
    let diagonal_px = f64::from(camera.viewport.0).hypot(f64::from(camera.viewport.1));
    camera.pixel(truth).map_or(diagonal_px, |place| place.distance(pixel).min(diagonal_px))
}

/// `drawn_m` and `true_m` are distances along each pixel's ray in metres, negative where there is no surface.
pub fn frame(
    ground: &dyn Ground,
    camera: &Camera,
    drawn_m: &[f32],
    true_m: &[f32],
    bound_px: Option<f64>,
) -> FrameError {
    let width = camera.viewport.0 as usize;
    let pixel_error = |(at, &drawn): (usize, &f32)| {
        let pixel = DVec2::new((at % width) as f64 + 0.5, (at / width) as f64 + 0.5);
        if drawn < 0.0 { SKY } else { drawn_error_px(ground, camera, pixel, drawn.into()) as f32 }
    };
    let error_px: Vec<f32> = drawn_m.par_iter().enumerate().map(pixel_error).collect();
    let broken = bound_px.map(|bound_px| {
        let missed = Missed { ground, camera };
        let pixel = |at: usize| DVec2::new((at % width) as f64 + 0.5, (at / width) as f64 + 0.5);
        let worst = |at: usize| {
            let missed_px = missed.missed_px(pixel(at), drawn_m[at].into(), true_m[at].into());
            // NaN where nothing was drawn is no error of what was
            missed_px.max(f64::from(error_px[at]))
        };
        let errors: Vec<f64> = (0..drawn_m.len()).into_par_iter().map(worst).collect();
        Broken {
            pixels: errors.iter().filter(|&&error| error > bound_px).count(),
            worst_px: errors.into_iter().fold(0.0, f64::max),
        }
    });
    FrameError { broken, error_px }
}

/// Errors of all frames of a cell, in constant memory.
#[derive(Clone, Debug, Default)]
struct Summary {
    threshold_px: f64,
    errors: Distribution,
    over_threshold: usize,
    pixels: usize,
    counts: Counts,
    broken: Option<Broken>,
    /// The largest error of the truth, of frames that have one.
    truth_px: Option<f64>,
    picture: Option<Picture>,
}

impl Tally for Summary {
    fn frame(&mut self, seen: &Seen) {
        let (Some(truth), Some(drawn)) = (seen.truth, seen.plan.products.latest::<Drawn<BufferId>>()) else { return };
        let drawn_m: Vec<f32> = seen.read(drawn.distance);
        let bound_px = drawn.promise.map(|promise| promise.bound_px);
        let ground = seen.data.ground.as_ref();
        let found = frame(ground, seen.camera(), &drawn_m, &truth.distance_m, bound_px);
        self.add(&found);
        self.truth_px = Some(self.truth_px.unwrap_or(0.0).max(truth.error_px));
        self.counts.add(&drawn_m, &truth.distance_m);
        if seen.is_pictured() {
            self.picture =
                Some(self.heat_map(seen.data.scene.viewport.0, &found.error_px, &drawn_m, &truth.distance_m));
        }
    }

    fn finish(self: Box<Self>) -> Figures {
        let is_inexact = |error_px: &f64| *error_px > MOST_ERROR_PX;
        let warning =
            |error_px| format!("the ground truth itself is off by up to {error_px:.3} px: smaller errors say nothing");
        let warnings = self.truth_px.filter(is_inexact).map(warning).into_iter().collect();
        Figures { measured: self.measured(), pictures: self.picture.into_iter().collect(), warnings }
    }
}

impl Summary {
    fn add(&mut self, frame: &FrameError) {
        for error in frame.error_px.iter().filter(|error| !error.is_nan()).map(|&error| f64::from(error)) {
            self.errors.add(error);
            self.over_threshold += usize::from(error > self.threshold_px);
        }
        self.pixels += frame.error_px.len();
        if let Some(frame) = frame.broken {
            let broken = self.broken.get_or_insert_default();
            broken.pixels += frame.pixels;
            broken.worst_px = broken.worst_px.max(frame.worst_px);
        }
    }

    fn measured(&self) -> Vec<Measured> {
        let errors = &self.errors;
        let mean = |sum: f64| (errors.count > 0).then(|| sum / errors.count as f64);
        let share = |part: usize| (self.pixels > 0).then(|| part as f64 / self.pixels as f64);
        let mut measured = vec![
            Measured::new("error_max", (errors.count > 0).then_some(errors.largest), "px"),
            Measured::new("error_mean", mean(errors.sum), "px"),
            Measured::new("error_rms", mean(errors.sum_of_squares).map(f64::sqrt), "px"),
            Measured::new("over_threshold", share(self.over_threshold), "of pixels"),
        ];
        measured.extend(self.counts.measured());
        if let Some(broken) = self.broken {
            measured.push(Measured::new("bound_violations", broken.pixels as f64, "pixels"));
            measured.push(Measured::unbounded("bound_worst", broken.worst_px, "px"));
        }
        measured.push(Measured::new("truth_error_max", self.truth_px, "px"));
        for percent in [50, 95, 99] {
            let value = errors.percentile(f64::from(percent) / 100.0);
            measured.push(Measured::new(&format!("error_p{percent}"), value, "px"));
        }
        measured
    }

    /// Error in pixels from black (none) over red and yellow to white (four thresholds and more); grey is sky, and blue are pixels where
    /// sky and surface are mixed up.
    fn heat_map(&self, width: u32, error_px: &[f32], drawn_m: &[f32], true_m: &[f32]) -> Picture {
        let colour =
            |(&error, (&drawn, &truth)): (&f32, (&f32, &f32))| match ((drawn < 0.0) != (truth < 0.0), error.is_nan()) {
                (true, _) => [40, 90, 255],
                (false, true) => [70, 74, 80],
                (false, false) => heat((f64::from(error) / (4.0 * self.threshold_px)).clamp(0.0, 1.0)),
            };
        let rgb = error_px.iter().zip(drawn_m.iter().zip(true_m)).flat_map(colour).collect();
        Picture { kind: "error", width, rgb }
    }
}

fn heat(share: f64) -> [u8; 3] {
    let ramp = |from: f64| ((share - from) * 3.0).clamp(0.0, 1.0) * 255.0;
    [ramp(0.0) as u8, ramp(1.0 / 3.0) as u8, ramp(2.0 / 3.0) as u8]
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
