//! Colour maps: for values that go one way those whose steps look alike, and one with a middle.

use serde::{Deserialize, Serialize};

/// A colour for each share of a range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Colours {
    #[default]
    Viridis,
    Magma,
    Cividis,
    Grey,
    /// Two ways from a middle.
    RedBlue,
    /// Neighbours differ much: for levels.
    Levels,
}

impl Colours {
    pub const ALL: [Colours; 6] =
        [Colours::Viridis, Colours::Magma, Colours::Cividis, Colours::Grey, Colours::RedBlue, Colours::Levels];

    /// Red, green and blue, 0 to 255.
    pub fn at(self, share: f64) -> [u8; 3] {
        let share = share.clamp(0.0, 1.0);
        let eval = |gradient: colorous::Gradient| {
            let colour = gradient.eval_continuous(share);
            [colour.r, colour.g, colour.b]
        };
        match self {
            Colours::Viridis => eval(colorous::VIRIDIS),
            Colours::Magma => eval(colorous::MAGMA),
            Colours::Cividis => eval(colorous::CIVIDIS),
            Colours::Grey => [(share * 255.0).round() as u8; 3],
            // blue is below the middle
            Colours::RedBlue => {
                let colour = colorous::RED_BLUE.eval_continuous(1.0 - share);
                [colour.r, colour.g, colour.b]
            }
            Colours::Levels => eval(colorous::SPECTRAL),
        }
    }

    /// 256 colours, red in the lowest byte.
    pub fn table(self) -> Vec<u32> {
        let colour = |at: u32| {
            let [r, g, b] = self.at(f64::from(at) / 255.0);
            u32::from_le_bytes([r, g, b, 255])
        };
        (0..256).map(colour).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_for_one_way_get_lighter_all_the_way() {
        for map in [Colours::Viridis, Colours::Magma, Colours::Cividis, Colours::Grey] {
            let light = |share: f64| {
                let [r, g, b] = map.at(share).map(f64::from);
                0.299 * r + 0.587 * g + 0.114 * b
            };
            let steps: Vec<f64> = (0..=16).map(|at| light(f64::from(at) / 16.0)).collect();
            assert!(steps.windows(2).all(|pair| pair[0] < pair[1]), "{map:?}: {steps:?}");
        }
        assert_eq!(Colours::Grey.table()[255], 0xffff_ffff);
    }
}
