//! What measures give: figures with units, pictures, and how tables show them.

use serde::{Deserialize, Serialize};

/// A tagged number with a unit. `None` is "not measured", which is not 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    pub name: String,
    #[serde(with = "maybe_infinite")]
    pub value: Option<f64>,
    pub unit: String,
}

impl Measured {
    pub fn new(name: &str, value: impl Into<Option<f64>>, unit: &str) -> Self {
        // JSON has no infinity, and a measure that is not a number is not measured
        let value = value.into().filter(|value: &f64| value.is_finite());
        Self { name: name.into(), value, unit: unit.into() }
    }

    /// A figure that can be infinite, and is not unknown then.
    pub fn unbounded(name: &str, value: f64, unit: &str) -> Self {
        let value = Some(value).filter(|value| !value.is_nan());
        Self { name: name.into(), value, unit: unit.into() }
    }
}

/// Numbers as JSON has them, and infinity, which it does not have, as the text `inf`.
mod maybe_infinite {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Deserialize, Serialize)]
    #[serde(untagged)]
    enum Written {
        Number(f64),
        Text(String),
    }

    pub fn serialize<S: Serializer>(value: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        let written = value
            .map(|value| if value.is_finite() { Written::Number(value) } else { Written::Text(value.to_string()) });
        written.serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
        Ok(match Option::<Written>::deserialize(deserializer)? {
            None => None,
            Some(Written::Number(value)) => Some(value),
            Some(Written::Text(text)) => {
                Some(text.parse().map_err(|_| D::Error::custom(format!("`{text}` is no number")))?)
            }
        })
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

/// What is known of a figure before it is measured: a line of `lodlab schema`.
pub struct Known {
    pub name: &'static str,
    pub unit: &'static str,
    pub meaning: &'static str,
    pub kind: Kind,
}

/// What a figure is good for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// An error that can be plotted against time; less is better.
    Error,
    /// The same of what is better the more there is of it.
    Likeness,
    /// What a picture costs, besides time.
    Cost,
    /// Above zero, something is wrong with the picture: its cell stands apart and is on no front. The text says what.
    Fault(&'static str),
    Other,
}

impl Kind {
    /// What `lodlab schema` calls it.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Error | Kind::Likeness => "error",
            Kind::Cost => "cost",
            Kind::Fault(_) => "fault",
            Kind::Other => "figure",
        }
    }
}

impl Known {
    pub const fn new(name: &'static str, unit: &'static str, kind: Kind, meaning: &'static str) -> Self {
        Self { name, unit, meaning, kind }
    }
}

/// What is known of a figure of any measure.
pub fn known(name: &str) -> Option<&'static Known> {
    super::REGISTRY.iter().flat_map(|info| info.figures).find(|known| known.name == name)
}

/// What is wrong with a picture, by its figures.
pub fn faults(measured: &[Measured]) -> Vec<String> {
    let fault = |measured: &Measured| match (known(&measured.name)?.kind, measured.value) {
        (Kind::Fault(what), Some(count)) if count > 0.0 => Some(format!("{what} ({count} {})", measured.unit)),
        _ => None,
    };
    measured.iter().filter_map(fault).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_infinite_is_not_what_is_unknown() {
        for value in [Some(1.5), Some(f64::INFINITY), None] {
            let figure = Measured { name: "worst".into(), value, unit: "px".into() };
            let text = serde_json::to_string(&figure).unwrap();
            assert_eq!(serde_json::from_str::<Measured>(&text).unwrap(), figure, "{text}");
        }
        assert_eq!(Measured::unbounded("worst", f64::INFINITY, "px").value, Some(f64::INFINITY));
        assert!(serde_json::from_str::<Measured>(r#"{"name": "worst", "value": "far", "unit": "px"}"#).is_err());
    }
}
