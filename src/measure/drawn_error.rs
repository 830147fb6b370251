//! The error of what was drawn alone, as the papers measure it: how far, in pixels, each drawn surface point is from the true surface at
//! the same ground position. What should have been shown and was not has no part in it; see [`super::screen_error`].

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::coverage::drawn_distance;
use super::distribution::Distribution;
use super::screen_error::{drawn_error_px, middle};
use super::{Column, Info, Kind, Known, Measure, Measured, Seen, Show, Sums, Tally, read_as};
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::plan::product::Drawn;
use crate::plan::{BufferId, Chain};

pub const INFO: Info = Info {
    name: "DrawnError",
    summary: "the error of what was drawn alone, as papers measure it: what should have been shown and was not has no part in it",
    version: 1,
    parameters: schema::<DrawnError>,
    read: read_as::<DrawnError>,
    figures: &[
        Known::new(
            "drawn_error_max",
            "px",
            Kind::Error,
            "maximum of the error of what was drawn alone over all pixels of all frames",
        ),
        Known::new(
            "drawn_error_mean",
            "px",
            Kind::Error,
            "mean of the error of what was drawn alone over all pixels of all frames",
        ),
        Known::new(
            "drawn_error_rms",
            "px",
            Kind::Error,
            "root of the mean square of the error of what was drawn alone over all pixels of all frames",
        ),
        Known::new(
            "drawn_error_p50",
            "px",
            Kind::Error,
            "median of the error of what was drawn alone over all pixels of all frames",
        ),
        Known::new(
            "drawn_error_p95",
            "px",
            Kind::Error,
            "95th percentile of the error of what was drawn alone over all pixels of all frames",
        ),
        Known::new(
            "drawn_error_p99",
            "px",
            Kind::Error,
            "99th percentile of the error of what was drawn alone over all pixels of all frames",
        ),
    ],
    columns: &[
        Column { heading: "drawn mean px", figure: "drawn_error_mean", show: Show::Number },
        Column { heading: "drawn rms", figure: "drawn_error_rms", show: Show::Number },
        Column { heading: "drawn max", figure: "drawn_error_max", show: Show::Number },
    ],
};

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DrawnError {}

impl Measure for DrawnError {
    fn needs(&self, chain: &Chain) -> Result<Vec<BufferId>, Diagnostic> {
        Ok(vec![drawn_distance(chain)?])
    }

    fn begin(&self) -> Box<dyn Tally> {
        Box::new(Distribution::default())
    }
}

impl Sums for Distribution {
    fn of_frame(&self, seen: &Seen) -> Self {
        let mut own = Self::default();
        let Some(drawn) = seen.plan.products.latest::<Drawn<BufferId>>() else { return own };
        let drawn_m: Vec<f32> = seen.read(drawn.distance);
        let (ground, camera) = (seen.data.ground.as_ref(), seen.camera());
        let hits = drawn_m.par_iter().enumerate().filter(|(_, drawn)| **drawn >= 0.0);
        let errors: Vec<f64> =
            hits.map(|(at, &drawn)| drawn_error_px(ground, camera, middle(camera, at), drawn.into())).collect();
        errors.into_iter().for_each(|error_px| own.count(error_px));
        own
    }

    fn add(&mut self, frame: Self) {
        self.merge(&frame);
    }

    fn measured(&self) -> Vec<Measured> {
        self.named("drawn_error")
    }
}
