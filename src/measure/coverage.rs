//! On how many pixels something was drawn, and on how many it should have been.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Info, Kind, Known, Measure, Measured, Seen, Sums, Tally, read_as};
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::Drawn;
use crate::plan::{BufferId, Chain};

pub const INFO: Info = Info {
    name: "Coverage",
    summary: "shares of pixels with a surface, drawn and true, and of pixels where one of the two is sky",
    version: 1,
    parameters: schema::<Coverage>,
    read: read_as::<Coverage>,
    figures: &[SILHOUETTE_MISSES, DRAWN, TRUE_SURFACE],
    columns: &[],
};

/// (These three are figures of `ScreenError`, too.)
pub const SILHOUETTE_MISSES: Known = Known::new(
    "silhouette_misses",
    "of pixels",
    Kind::Error,
    "share of pixels where one of drawn and true is sky and the other is surface",
);
pub const DRAWN: Known = Known::new("drawn", "of pixels", Kind::Other, "share of pixels on which a surface was drawn");
pub const TRUE_SURFACE: Known =
    Known::new("true_surface", "of pixels", Kind::Other, "share of pixels on which the ground truth has a surface");

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Coverage {}

/// The distances that were drawn, as pixels of the scene's viewport.
pub fn drawn_distance(chain: &Chain) -> Result<BufferId, Diagnostic> {
    let drawn: Drawn<BufferId> = chain.latest()?;
    let (columns, rows) = chain.data.scene.viewport;
    chain.check_kind(drawn.distance, Elem::F32, &[rows, columns])?;
    Ok(drawn.distance)
}

impl Measure for Coverage {
    fn needs(&self, chain: &Chain) -> Result<Vec<BufferId>, Diagnostic> {
        Ok(vec![drawn_distance(chain)?])
    }

    fn wants_truth(&self) -> bool {
        true
    }

    fn begin(&self) -> Box<dyn Tally> {
        Box::new(Counts::default())
    }
}

/// Pixels of one frame or of several.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    pub pixels: usize,
    /// Pixels where one of drawn and true is sky and the other is surface.
    pub silhouette_misses: usize,
    pub drawn: usize,
    pub true_hits: usize,
}

impl Counts {
    /// Distances along the pixels' rays in metres, negative where there is no surface.
    pub fn count(&mut self, drawn_m: &[f32], true_m: &[f64]) {
        let found = |pick: fn(f32, f64) -> bool| drawn_m.iter().zip(true_m).filter(|(a, b)| pick(**a, **b)).count();
        self.pixels += drawn_m.len();
        self.silhouette_misses += found(|drawn, truth| (drawn < 0.0) != (truth < 0.0));
        self.drawn += found(|drawn, _| drawn >= 0.0);
        self.true_hits += found(|_, truth| truth >= 0.0);
    }
}

impl Sums for Counts {
    fn of_frame(&self, seen: &Seen) -> Self {
        let mut own = Self::default();
        if let (Some(truth), Some(drawn)) = (seen.truth, seen.plan.products.latest::<Drawn<BufferId>>()) {
            own.count(&seen.read(drawn.distance), &truth.distance_m);
        }
        own
    }

    fn add(&mut self, frame: Self) {
        self.pixels += frame.pixels;
        self.silhouette_misses += frame.silhouette_misses;
        self.drawn += frame.drawn;
        self.true_hits += frame.true_hits;
    }

    fn measured(&self) -> Vec<Measured> {
        let share = |part: usize| (self.pixels > 0).then(|| part as f64 / self.pixels as f64);
        vec![
            Measured::new("silhouette_misses", share(self.silhouette_misses), "of pixels"),
            Measured::new("drawn", share(self.drawn), "of pixels"),
            Measured::new("true_surface", share(self.true_hits), "of pixels"),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sky_and_surface_are_told_apart() {
        let mut counts = Counts::default();
        counts.count(&[1.0, -1.0, 3.0, -1.0], &[1.0, 2.0, -1.0, -1.0]);
        assert_eq!(counts, Counts { pixels: 4, silhouette_misses: 2, drawn: 2, true_hits: 2 });
    }
}
