//! Screen-space error at every pixel, against exact ground truth in f64: how far, in pixels, the drawn surface point is from the true
//! surface at the same ground position, or how far the true surface sticks out over the pixel's ray before what was drawn, if that is more.
//! The papers measure the first alone ([`super::drawn_error`]), which says nothing of a hill that a mesh has flattened.

use glam::DVec2;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::coverage::{Counts, DRAWN, SILHOUETTE_MISSES, TRUE_SURFACE, drawn_distance};
use super::distribution::Distribution;
use super::missed::Missed;
use super::{Column, Figures, Info, Kind, Known, Measure, Measured, Picture, Seen, Show, Sums, Tally, read_as};
use crate::camera::Camera;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::ground::{EXACT_PX, Ground};
use crate::plan::product::Drawn;
use crate::plan::{BufferId, Chain};

pub const INFO: Info = Info {
    name: "ScreenError",
    summary: "pixel distance between the drawn surface and the true surface at the same ground position, or of what should have been shown \
              before it and was not, if that is more",
    version: 4,
    parameters: schema::<ScreenError>,
    read: read_as::<ScreenError>,
    figures: &[
        Known::new("error_max", "px", Kind::Error, "maximum of the screen-space error over all pixels of all frames"),
        Known::new("error_mean", "px", Kind::Error, "mean of the screen-space error over all pixels of all frames"),
        Known::new(
            "error_rms",
            "px",
            Kind::Error,
            "root of the mean square of the screen-space error over all pixels of all frames",
        ),
        Known::new("error_p50", "px", Kind::Error, "median of the screen-space error over all pixels of all frames"),
        Known::new(
            "error_p95",
            "px",
            Kind::Error,
            "95th percentile of the screen-space error over all pixels of all frames",
        ),
        Known::new(
            "error_p99",
            "px",
            Kind::Error,
            "99th percentile of the screen-space error over all pixels of all frames",
        ),
        Known::new("over_threshold", "of pixels", Kind::Error, "share of pixels whose error is above the threshold"),
        SILHOUETTE_MISSES,
        DRAWN,
        TRUE_SURFACE,
        Known::new(
            "bound_violations",
            "pixels",
            Kind::Fault("breaks the bound that it promises"),
            "pixels whose error is above the bound that the method promises, all frames together",
        ),
        Known::new(
            "bound_worst",
            "px",
            Kind::Other,
            "largest error of any pixel, of a method that promises a bound; it can be infinite",
        ),
        Known::new("truth_error_max", "px", Kind::Other, "how far off the ground truth itself can be"),
    ],
    columns: &[
        Column { heading: "error mean px", figure: "error_mean", show: Show::Number },
        Column { heading: "rms", figure: "error_rms", show: Show::Number },
        Column { heading: "p99", figure: "error_p99", show: Show::Number },
        Column { heading: "max", figure: "error_max", show: Show::Number },
        Column { heading: "over %", figure: "over_threshold", show: Show::Percent },
        Column { heading: "sky miss %", figure: "silhouette_misses", show: Show::Percent },
        Column { heading: "over bound px", figure: "bound_violations", show: Show::Count },
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

/// The error of a pixel on which nothing was drawn and nothing should have been.
pub const SKY: f32 = f32::NAN;

/// The errors of one frame's pixels.
#[derive(Clone, Debug)]
pub struct FrameError {
    /// The larger of how far off is what was drawn and of how far what was not shown sticks out; [`SKY`] where there is neither.
    pub error_px: Vec<f32>,
    /// With a bound that the method promised: pixels that break it, and the largest error of any pixel.
    pub broken: Option<Broken>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Broken {
    pub pixels: usize,
    pub worst_px: f64,
}

/// The middle of a pixel, by its place in a frame.
pub fn middle(camera: &Camera, at: usize) -> DVec2 {
    let width = camera.viewport.0 as usize;
    DVec2::new((at % width) as f64 + 0.5, (at / width) as f64 + 0.5)
}

/// As far off as anything in a picture can be.
fn diagonal_px(camera: &Camera) -> f64 {
    f64::from(camera.viewport.0).hypot(f64::from(camera.viewport.1))
}

/// How far, in pixels, what a pixel shows at a distance is from the true surface at the same ground position.
pub fn drawn_error_px(ground: &dyn Ground, camera: &Camera, pixel: DVec2, drawn_m: f64) -> f64 {
    let truth = ground.surface_at(camera.eye_m + camera.ray(pixel) * drawn_m);
    // a true surface behind the eye has no place in the picture
    let most_px = diagonal_px(camera);
    camera.pixel(truth).map_or(most_px, |place| place.distance(pixel).min(most_px))
}

/// `drawn_m` and `true_m` are distances along each pixel's ray in metres, negative where there is no surface.
pub fn frame(
    ground: &dyn Ground,
    camera: &Camera,
    drawn_m: &[f32],
    true_m: &[f64],
    bound_px: Option<f64>,
) -> FrameError {
    let missed = Missed { ground, camera };
    let error = |(at, (&drawn, &truth)): (usize, (&f32, &f64))| {
        if drawn < 0.0 && truth < 0.0 {
            return f64::NAN;
        }
        let pixel = middle(camera, at);
        let missed_px = missed.missed_px(pixel, drawn.into(), truth);
        if drawn < 0.0 { missed_px } else { missed_px.max(drawn_error_px(ground, camera, pixel, drawn.into())) }
    };
    let errors: Vec<f64> = drawn_m.par_iter().zip(true_m).enumerate().map(error).collect();
    let broken = bound_px.map(|bound_px| Broken {
        pixels: errors.iter().filter(|&&error| error > bound_px).count(),
        worst_px: errors.iter().copied().fold(0.0, f64::max),
    });
    let most_px = diagonal_px(camera);
    let in_picture = |error: f64| if error.is_nan() { SKY } else { error.min(most_px) as f32 };
    FrameError { broken, error_px: errors.into_iter().map(in_picture).collect() }
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

impl Sums for Summary {
    fn of_frame(&self, seen: &Seen) -> Self {
        let mut own = Self { threshold_px: self.threshold_px, ..Self::default() };
        let (Some(truth), Some(drawn)) = (seen.truth, seen.plan.products.latest::<Drawn<BufferId>>()) else {
            return own;
        };
        let drawn_m: Vec<f32> = seen.read(drawn.distance);
        let bound_px = drawn.promise.map(|promise| promise.bound_px);
        let ground = seen.data.ground.as_ref();
        let found = frame(ground, seen.camera(), &drawn_m, &truth.distance_m, bound_px);
        own.pixels_of(&found);
        own.truth_px = Some(truth.error_px);
        own.counts.count(&drawn_m, &truth.distance_m);
        if seen.is_pictured() {
            let width = seen.data.scene.viewport.0;
            own.picture = Some(own.heat_map(width, &found.error_px, &drawn_m, &truth.distance_m));
        }
        own
    }

    fn add(&mut self, frame: Self) {
        self.errors.merge(&frame.errors);
        self.over_threshold += frame.over_threshold;
        self.pixels += frame.pixels;
        self.counts.add(frame.counts);
        if let Some(frame) = frame.broken {
            let broken = self.broken.get_or_insert_default();
            broken.pixels += frame.pixels;
            broken.worst_px = broken.worst_px.max(frame.worst_px);
        }
        self.truth_px = self.truth_px.into_iter().chain(frame.truth_px).reduce(f64::max);
        self.picture = self.picture.take().or(frame.picture);
    }

    fn measured(&self) -> Vec<Measured> {
        let over = (self.pixels > 0).then(|| self.over_threshold as f64 / self.pixels as f64);
        let mut measured = self.errors.named("error");
        measured.push(Measured::new("over_threshold", over, "of pixels"));
        measured.extend(self.counts.measured());
        if let Some(broken) = self.broken {
            measured.push(Measured::new("bound_violations", broken.pixels as f64, "pixels"));
            measured.push(Measured::unbounded("bound_worst", broken.worst_px, "px"));
        }
        measured.push(Measured::new("truth_error_max", self.truth_px, "px"));
        measured
    }

    fn figures(self) -> Figures {
        let is_inexact = |error_px: &f64| *error_px > EXACT_PX;
        let warning =
            |error_px| format!("the ground truth itself is off by up to {error_px:.3} px: smaller errors say nothing");
        let warnings = self.truth_px.filter(is_inexact).map(warning).into_iter().collect();
        Figures { measured: self.measured(), pictures: self.picture.into_iter().collect(), warnings }
    }
}

impl Summary {
    fn pixels_of(&mut self, frame: &FrameError) {
        for error in frame.error_px.iter().filter(|error| !error.is_nan()).map(|&error| f64::from(error)) {
            self.errors.count(error);
            self.over_threshold += usize::from(error > self.threshold_px);
        }
        self.pixels += frame.error_px.len();
        self.broken = frame.broken;
    }

    /// Error in pixels from black (none) over red and yellow to white (four thresholds and more); grey is sky, and blue are pixels where
    /// sky and surface are mixed up.
    fn heat_map(&self, width: u32, error_px: &[f32], drawn_m: &[f32], true_m: &[f64]) -> Picture {
        let colour =
            |(&error, (&drawn, &truth)): (&f32, (&f32, &f64))| match ((drawn < 0.0) != (truth < 0.0), error.is_nan()) {
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
