//! What a method says of its own error (Loeffler et al. 2009, tables 1 and 2), to be held against what it is.

use super::Measured;

/// Sums over the frames of a cell.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summary {
    points: usize,
    sum: f64,
    pixels: usize,
    flagged: usize,
}

impl Summary {
    /// Normalised errors of the grid's points.
    pub fn add_grid(&mut self, errors: &[f32]) {
        self.points += errors.len();
        self.sum += errors.iter().map(|&error| f64::from(error)).sum::<f64>();
    }

    /// Normalised errors of the pixels; above 0 is over the threshold.
    pub fn add_pixels(&mut self, errors: &[f32]) {
        self.pixels += errors.len();
        self.flagged += errors.iter().filter(|&&error| error > 0.0).count();
    }

    pub fn measures(&self) -> Vec<Measured> {
        let mean = (self.points > 0).then(|| self.sum / self.points as f64);
        let share = (self.pixels > 0).then(|| self.flagged as f64 / self.pixels as f64);
        vec![Measured::new("grid_error", mean, "normalised"), Measured::new("flagged", share, "of pixels")]
    }
}
