//! What a picture and a mesh are worth: pure functions of buffers, no device.

pub mod error_buffer;
pub mod image;
pub mod mesh;
pub mod pinholes;
pub mod screen_error;
pub mod time;

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
