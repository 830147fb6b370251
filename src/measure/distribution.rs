//! How errors are distributed, in constant memory.

use super::Measured;

/// Maximum, sums, and a histogram whose bins are a thousandth wide, from a millionth of a pixel up.
#[derive(Clone, Debug, Default)]
pub struct Distribution {
    values: u64,
    sum: f64,
    sum_of_squares: f64,
    largest: f64,
    bins: Vec<u64>,
}

const SMALLEST_PX: f64 = 1e-6;
const BIN_WIDTH: f64 = 1e-3;

impl Distribution {
    pub fn count(&mut self, error_px: f64) {
        self.values += 1;
        self.sum += error_px;
        self.sum_of_squares += error_px * error_px;
        self.largest = self.largest.max(error_px);
        let bin = ((error_px.max(SMALLEST_PX) / SMALLEST_PX).ln() / BIN_WIDTH) as usize;
        if bin >= self.bins.len() {
            self.bins.resize(bin + 1, 0);
        }
        self.bins[bin] += 1;
    }

    /// Those of somebody else, too.
    pub fn merge(&mut self, other: &Self) {
        self.values += other.values;
        self.sum += other.sum;
        self.sum_of_squares += other.sum_of_squares;
        self.largest = self.largest.max(other.largest);
        self.bins.resize(self.bins.len().max(other.bins.len()), 0);
        self.bins.iter_mut().zip(&other.bins).for_each(|(own, other)| *own += other);
    }

    /// Largest, mean, root of the mean square and percentiles, under names that begin with `name`; nothing was measured without a value.
    pub fn named(&self, name: &str) -> Vec<Measured> {
        let mean = |sum: f64| (self.values > 0).then(|| sum / self.values as f64);
        let figure = |what: &str, value| Measured::new(&format!("{name}_{what}"), value, "px");
        let percentile = |percent: u32| figure(&format!("p{percent}"), self.percentile(f64::from(percent) / 100.0));
        vec![
            figure("max", (self.values > 0).then_some(self.largest)),
            figure("mean", mean(self.sum)),
            figure("rms", mean(self.sum_of_squares).map(f64::sqrt)),
            percentile(50),
            percentile(95),
            percentile(99),
        ]
    }

    /// The value below which `share` of the values are, to a thousandth of it (nearest rank).
    fn percentile(&self, share: f64) -> Option<f64> {
        let rank = ((share * self.values as f64).ceil() as u64).max(1);
        let mut below = 0;
        let bin = self.bins.iter().position(|count| {
            below += count;
            below >= rank
        })?;
        Some((SMALLEST_PX * ((bin as f64 + 0.5) * BIN_WIDTH).exp()).min(self.largest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_right_to_a_thousandth() {
        let mut errors = Distribution::default();
        (1..=1000).rev().for_each(|error| errors.count(f64::from(error) / 100.0));
        for (share, exact) in [(0.5, 5.0), (0.95, 9.5), (0.99, 9.9), (1.0, 10.0)] {
            let value = errors.percentile(share).unwrap();
            assert!((value / exact - 1.0).abs() <= 1e-3, "{share}: {value}");
        }
        assert_eq!(Distribution::default().percentile(0.5), None);
        assert_eq!((errors.values, errors.largest), (1000, 10.0));
    }
}
