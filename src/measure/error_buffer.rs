//! What a method says of its own error (Loeffler et al. 2009, tables 1 and 2), to be held against what it is.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Column, Info, Kind, Known, Measure, Measured, Seen, Show, Sums, Tally, read_as};
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::{Drawn, PointErrors};
use crate::plan::{BufferId, Chain};

pub const INFO: Info = Info {
    name: "ErrorBuffer",
    summary: "what the method says of its own error: mean normalised error of a grid point, share of pixels over the threshold",
    version: 1,
    parameters: schema::<ErrorBuffer>,
    read: read_as::<ErrorBuffer>,
    figures: &[
        Known::new(
            "grid_error",
            "normalised",
            Kind::Other,
            "mean of what the method says of the error of its grid points, in thresholds",
        ),
        Known::new(
            "flagged",
            "of pixels",
            Kind::Cost,
            "share of pixels that the method says are over its threshold, and casts if it casts any",
        ),
    ],
    columns: &[Column { heading: "cast %", figure: "flagged", show: Show::Percent }],
};

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ErrorBuffer {}

impl Measure for ErrorBuffer {
    fn needs(&self, chain: &Chain) -> Result<Vec<BufferId>, Diagnostic> {
        let points = chain.products().latest::<PointErrors<BufferId>>().map(|points| points.errors);
        let drawn = chain.products().latest::<Drawn<BufferId>>();
        if points.is_none() && drawn.is_none() {
            return Err(chain.missing::<PointErrors<BufferId>>());
        }
        let pixels = drawn.and_then(|drawn| drawn.error);
        if let Some(pixels) = pixels {
            let (columns, rows) = chain.data.scene.viewport;
            chain.check_kind(pixels, Elem::F32, &[rows, columns])?;
        }
        Ok(points.into_iter().chain(pixels).collect())
    }

    fn begin(&self) -> Box<dyn Tally> {
        Box::new(Said::default())
    }
}

/// Sums over the frames of a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Said {
    points: usize,
    sum: f64,
    pixels: usize,
    flagged: usize,
}

impl Sums for Said {
    fn of_frame(&self, seen: &Seen) -> Self {
        let mut own = Self::default();
        if let Some(points) = seen.plan.products.latest::<PointErrors<BufferId>>() {
            let errors: Vec<f32> = seen.read(points.errors);
            own.points = errors.len();
            own.sum = errors.iter().map(|&error| f64::from(error)).sum::<f64>();
        }
        if let Some(error) = seen.plan.products.latest::<Drawn<BufferId>>().and_then(|drawn| drawn.error) {
            let errors: Vec<f32> = seen.read(error);
            own.pixels = errors.len();
            // above 0 is over the threshold
            own.flagged = errors.iter().filter(|&&error| error > 0.0).count();
        }
        own
    }

    fn add(&mut self, frame: Self) {
        self.points += frame.points;
        self.sum += frame.sum;
        self.pixels += frame.pixels;
        self.flagged += frame.flagged;
    }

    fn measured(&self) -> Vec<Measured> {
        let mean = (self.points > 0).then(|| self.sum / self.points as f64);
        let share = (self.pixels > 0).then(|| self.flagged as f64 / self.pixels as f64);
        vec![Measured::new("grid_error", mean, "normalised"), Measured::new("flagged", share, "of pixels")]
    }
}
