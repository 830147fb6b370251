//! From values to shares of a range: the same as `share_of` in `kernels/lib/look.wgsl`.

use serde::{Deserialize, Serialize};

/// How values are spread over colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Scale {
    #[default]
    Linear,
    /// Equal ratios have equal steps; what is not positive is as the lowest.
    Logarithm,
    /// The same in both ways from zero, and linear next to it.
    Symmetric,
}

impl Scale {
    pub const ALL: [Scale; 3] = [Scale::Linear, Scale::Logarithm, Scale::Symmetric];
}

/// Which values have the first and the last colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Range {
    /// The lowest and the highest that there are.
    #[default]
    Auto,
    /// Those below and above which a hundredth of the values are, each.
    Percentile,
    Manual(f32, f32),
}

/// A range and a scale, with its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaled {
    pub low: f32,
    pub high: f32,
    pub scale: Scale,
}

/// Of a symmetric scale, the share of the larger end below which it is linear.
const LINEAR_SHARE: f32 = 1e-3;

impl Scaled {
    /// Of a logarithm, the lowest value that it shows.
    pub fn new(low: f32, high: f32, scale: Scale) -> Self {
        let low = if scale == Scale::Logarithm && low <= 0.0 { high.max(f32::MIN_POSITIVE) * 1e-6 } else { low };
        Self { low, high, scale }
    }

    pub fn linear_below(&self) -> f32 {
        let largest = self.low.abs().max(self.high.abs()) * LINEAR_SHARE;
        if largest > 0.0 { largest } else { 1.0 }
    }

    fn scaled(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => value,
            Scale::Logarithm => value.max(1e-38).log2(),
            Scale::Symmetric => value.signum() * (1.0 + value.abs() / f64::from(self.linear_below())).log2(),
        }
    }

    /// The lowest value as it is scaled, and the share of the range that one more is.
    pub fn scaled_low_and_per_unit(&self) -> (f32, f32) {
        let (low, high) = (self.scaled(self.low.into()), self.scaled(self.high.into()));
        (low as f32, if low == high { 0.0 } else { (1.0 / (high - low)) as f32 })
    }

    /// 0 at the lowest value and 1 at the highest.
    pub fn share(&self, value: f64) -> f64 {
        let (low, high) = (self.scaled(self.low.into()), self.scaled(self.high.into()));
        if low == high { 0.5 } else { ((self.scaled(value) - low) / (high - low)).clamp(0.0, 1.0) }
    }

    /// The value at a share.
    pub fn value(&self, share: f64) -> f64 {
        let (low, high) = (self.scaled(self.low.into()), self.scaled(self.high.into()));
        let scaled = low + (high - low) * share;
        match self.scale {
            Scale::Linear => scaled,
            Scale::Logarithm => scaled.exp2(),
            Scale::Symmetric => scaled.signum() * (scaled.abs().exp2() - 1.0) * f64::from(self.linear_below()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_leads_back_to_its_value() {
        for scale in Scale::ALL {
            for (low, high) in [(1.0, 1000.0), (-5.0, 20.0), (0.0, 1.0)] {
                let scaled = Scaled::new(low, high, scale);
                assert_eq!((scaled.share(scaled.low.into()), scaled.share(high.into())), (0.0, 1.0));
                for share in [0.1, 0.5, 0.9] {
                    let back = scaled.share(scaled.value(share));
                    assert!((back - share).abs() < 1e-6, "{scale:?} {low} {high} {share}: {back}");
                }
            }
        }
        assert_eq!(Scaled::new(3.0, 3.0, Scale::Linear).share(3.0), 0.5);
    }
}
