//! Times over many samples: median and quartiles; what was not measured stays that.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Column, Figures, Info, Measure, Measured, Sampling, Seen, Show, Tally, read_as};
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::plan::{BufferId, Chain};

pub const INFO: Info = Info {
    name: "Time",
    summary: "time of each kernel, of the method (a frame without what the drawn surface does not depend on, such as `Shade`) and of a whole frame: \
              medians and quartiles over warm repetitions of the path",
    version: 2,
    parameters: schema::<Time>,
    read: read_as::<Time>,
    figures: &[],
    columns: &[
        Column { heading: "method ms", figure: "method_ms", show: Show::Number },
        Column { heading: "frame ms", figure: "frame_ms", show: Show::Number },
    ],
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Time {
    /// frames run before the first one that counts
    #[schemars(range(max = 100000))]
    warmup: u32,
    /// how often the whole camera path is timed; 0 is once, too
    #[schemars(range(max = 100000))]
    repeats: u32,
    /// time the path again until its time is known well enough: `(noise: 0.01, seconds: 10)`
    until: Option<Until>,
}

/// When a path has been timed often enough.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Until {
    /// how far off the median time of the path may be, as a share of it (one standard error)
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub noise: f64,
    /// but no longer than that
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub seconds: f64,
}

impl Default for Until {
    fn default() -> Self {
        Self { noise: 0.01, seconds: 10.0 }
    }
}

impl Default for Time {
    fn default() -> Self {
        Self { warmup: 2, repeats: 1, until: None }
    }
}

impl Measure for Time {
    fn needs(&self, _chain: &Chain) -> Result<Vec<BufferId>, Diagnostic> {
        Ok(Vec::new())
    }

    fn looks_at_frames(&self) -> bool {
        false
    }

    fn sampling(&self) -> Option<Sampling> {
        Some(Sampling { warmup: self.warmup, repeats: self.repeats.max(1), until: self.until })
    }

    fn begin(&self) -> Box<dyn Tally> {
        Box::new(Nothing)
    }
}

/// Whoever runs the frames has the times; they are in the record by kernel and frame.
struct Nothing;

impl Tally for Nothing {
    fn frame(&mut self, _seen: &Seen) -> Vec<Measured> {
        Vec::new()
    }

    fn finish(self: Box<Self>) -> Figures {
        Figures::default()
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    pub median: f64,
    pub lower_quartile: f64,
    pub upper_quartile: f64,
    pub samples: usize,
}

/// `None` if no sample was measured.
pub fn spread(mut samples: Vec<f64>) -> Option<Spread> {
    if samples.is_empty() {
        return None;
    }
    samples.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let place = share * (samples.len() - 1) as f64;
        let low = samples[place.floor() as usize];
        low + (samples[place.ceil() as usize] - low) * place.fract()
    };
    Some(Spread { median: at(0.5), lower_quartile: at(0.25), upper_quartile: at(0.75), samples: samples.len() })
}

/// The standard error of the median of some samples, as a share of it: from the quartiles, as if the samples were spread normally. `None` of
/// fewer than three, of which nothing can be said.
pub fn noise(samples: Vec<f64>) -> Option<f64> {
    let Spread { median, lower_quartile, upper_quartile, samples } = spread(samples)?;
    // a normal distribution has 1.349 standard deviations between its quartiles, and its median an error of 1.2533 of them over the root
    let error = 1.2533 / 1.349 * (upper_quartile - lower_quartile) / (samples as f64).sqrt();
    (samples >= 3 && median > 0.0).then_some(error / median)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_falls_with_the_root_of_the_samples() {
        let of = |count: usize| noise((0..count).map(|at| 1.0 + (at % 11) as f64 / 100.0).collect()).unwrap();
        assert!((of(1100) / of(11) - 0.1).abs() < 0.03);
        assert_eq!((noise(vec![1.0, 1.0]), noise(vec![3.0; 5])), (None, Some(0.0)));
    }

    #[test]
    fn quartiles_are_between_the_samples() {
        let of = |samples: &[f64]| spread(samples.to_vec()).map(|s| (s.lower_quartile, s.median, s.upper_quartile));
        assert_eq!(of(&[]), None);
        assert_eq!(of(&[7.0]), Some((7.0, 7.0, 7.0)));
        assert_eq!(of(&[5.0, 1.0, 3.0, 2.0, 4.0]), Some((2.0, 3.0, 4.0)));
        assert_eq!(of(&[4.0, 1.0, 2.0, 3.0]), Some((1.75, 2.5, 3.25)));
        // one slow frame moves neither median nor quartiles far
        assert_eq!(of(&[1.0, 1.0, 1.0, 1.0, 1000.0]), Some((1.0, 1.0, 1.0)));
    }
}
