//! What measures give: figures with units, pictures, and how tables show them.

use serde::{Deserialize, Serialize};

/// A tagged number with a unit. `None` is "not measured", which is not 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    pub name: String,
    pub value: Option<f64>,
    pub unit: String,
}

impl Measured {
    pub fn new(name: &str, value: impl Into<Option<f64>>, unit: &str) -> Self {
        // JSON has no infinity, and a measure that is not a number is not measured
        let value = value.into().filter(|value: &f64| value.is_finite());
        Self { name: name.into(), value, unit: unit.into() }
    }
}

/// A picture of the frame in the middle of the path.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// What it shows, which is part of its file's name.
    pub kind: &'static str,
    pub width: u32,
    /// Three bytes a pixel.
    pub rgb: Vec<u8>,
}

/// What a measure found over all frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figures {
    pub measured: Vec<Measured>,
    pub pictures: Vec<Picture>,
    pub warnings: Vec<String>,
}

impl From<Vec<Measured>> for Figures {
    fn from(measured: Vec<Measured>) -> Self {
        Self { measured, ..Self::default() }
    }
}

/// A column of a table.
pub struct Column {
    pub heading: &'static str,
    /// The figure that it shows.
    pub figure: &'static str,
    pub show: Show,
}

/// How a figure stands in a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Show {
    /// Three significant digits.
    Number,
    /// The same of a hundred times a share.
    Percent,
    /// All digits of a count.
    Count,
    /// A number, or `equal` where another figure is 1.
    NumberUnless(&'static str),
}
