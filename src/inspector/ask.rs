//! What is asked of the device about a buffer that is shown: values, what they are like, files of them.

use std::path::PathBuf;
use std::sync::Arc;

use super::probe::{Asked, Where};
use super::wish::Shown;
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::paint::{Canvas, Part, Tones};
use crate::gpu::statistics::{Looked, Statistics};
use crate::gpu::{Gpu, Held};
use crate::look::scale::Scaled;
use crate::look::{Channel, Colours, Range, Scale};

/// A question; what it is about is held until it is answered.
#[derive(Clone)]
pub enum Ask {
    /// What values are like, and the range in which they are shown.
    Statistics {
        of: Values,
        range: Range,
        scale: Scale,
    },
    /// The bytes of some elements of a row, or of some rows.
    Bytes {
        held: Held,
        at: (u32, u32),
        elements: u32,
    },
    /// A place in everything that is shown.
    Probe {
        shown: Arc<Shown>,
        from: Asked,
        at: Where,
        views: Vec<Asked>,
    },
    /// A file of the values, and one of the picture.
    Export {
        held: Held,
        path: PathBuf,
    },
    Picture {
        canvas: Arc<Canvas>,
        path: PathBuf,
    },
}

/// Values that are looked at.
#[derive(Clone)]
pub struct Values {
    pub held: Held,
    pub channel: Channel,
    pub minus: Option<(Held, Channel)>,
    pub part: Part,
}

/// What was found out about values.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    pub statistics: Statistics,
    pub scaled: Scaled,
    pub histogram: Vec<u32>,
}

/// The share of values that a percentile range leaves out at either end.
const LEFT_OUT: f64 = 0.01;

impl Values {
    fn looked(&self) -> Looked<'_> {
        let minus = self.minus.as_ref().map(|(held, channel)| (held, channel));
        Looked { held: &self.held, channel: &self.channel, minus, part: self.part }
    }

    pub fn seen(&self, gpu: &Gpu, range: Range, scale: Scale) -> Result<Seen, Diagnostic> {
        let looked = self.looked();
        let statistics = gpu.statistics(&looked)?;
        let (lowest, highest) = (statistics.lowest.unwrap_or(0.0), statistics.highest.unwrap_or(1.0));
        let (low, high) = match range {
            Range::Auto => (lowest, highest),
            Range::Manual(low, high) => (low, high),
            Range::Percentile => {
                let at = |share| gpu.percentile(&looked, statistics.numbers, share);
                (at(LEFT_OUT)?.unwrap_or(lowest), at(1.0 - LEFT_OUT)?.unwrap_or(highest))
            }
        };
        let scaled = Scaled::new(low, high, scale);
        let tones = Tones { colours: Colours::Grey, scaled, mark_above: None };
        let histogram = gpu.histogram(&looked, tones)?;
        Ok(Seen { statistics, scaled, histogram })
    }
}
