//! The policy for samples without data.

use super::TerrainError;
use crate::experiment::scene::Nodata;

/// Samples without data are NaN on entry; none is on a successful return. A height that fills a gap is exaggerated as all others are.
pub fn apply(heights_m: &mut [f32], size: (u32, u32), policy: Nodata, vertical_scale: f64) -> Result<(), TerrainError> {
    let Some(first) = heights_m.iter().position(|height| height.is_nan()) else { return Ok(()) };
    match policy {
        Nodata::Refuse => Err(TerrainError::NoData {
            column: first as u32 % size.0,
            row: first as u32 / size.0,
            count: heights_m.iter().filter(|height| height.is_nan()).count(),
        }),
        Nodata::Fill(height_m) => {
            let filled = (height_m * vertical_scale) as f32;
            heights_m.iter_mut().filter(|height| height.is_nan()).for_each(|height| *height = filled);
            Ok(())
        }
        Nodata::Interpolate => Gaps { heights_m, size }.fill().map(|_| ()),
    }
}

struct Gaps<'a> {
    heights_m: &'a mut [f32],
    size: (u32, u32),
}

impl Gaps<'_> {
    /// Fills gaps ring by ring from their border: each round, every unknown sample that touches a known one
    /// becomes the mean of its known neighbours (of eight). Returns how many means were taken, which is one for each unknown sample.
    fn fill(self) -> Result<usize, TerrainError> {
        let all = 0..self.heights_m.len() as u32;
        let mut ring: Vec<u32> = all.filter(|&at| self.is_unknown(at) && self.known(at).next().is_some()).collect();
        if ring.is_empty() {
            return Err(TerrainError::NothingKnown);
        }
        let mut is_in_ring = vec![false; self.heights_m.len()];
        ring.iter().for_each(|&at| is_in_ring[at as usize] = true);
        let mut taken = 0;
        while !ring.is_empty() {
            // the means of a round know nothing of each other
            let means: Vec<f32> = ring.iter().map(|&at| self.mean(at)).collect();
            ring.iter().zip(means).for_each(|(&at, mean)| self.heights_m[at as usize] = mean);
            taken += ring.len();
            let mut next = Vec::new();
            for at in ring.into_iter().flat_map(|at| self.around(at)) {
                if self.is_unknown(at) && !std::mem::replace(&mut is_in_ring[at as usize], true) {
                    next.push(at);
                }
            }
            ring = next;
        }
        Ok(taken)
    }

    fn is_unknown(&self, at: u32) -> bool {
        self.heights_m[at as usize].is_nan()
    }

    /// The sample and its eight neighbours, as far as there are any.
    fn around(&self, at: u32) -> impl Iterator<Item = u32> + use<> {
        let (columns, rows) = self.size;
        let (column, row) = (at % columns, at / columns);
        let near = |place: u32, count: u32| place.saturating_sub(1)..=(place + 1).min(count - 1);
        near(row, rows).flat_map(move |y| near(column, columns).map(move |x| y * columns + x))
    }

    fn known(&self, at: u32) -> impl Iterator<Item = f64> {
        self.around(at).map(|at| f64::from(self.heights_m[at as usize])).filter(|height| !height.is_nan())
    }

    fn mean(&self, at: u32) -> f32 {
        let (sum, count) = self.known(at).fold((0.0, 0.0), |(sum, count), height| (sum + height, count + 1.0));
        (sum / count) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (u32, u32) = (60, 40);

    /// A terrain with one sample in `every` known.
    fn with_gaps(every: usize) -> Vec<f32> {
        let height = |at: usize| if at.is_multiple_of(every) { (at * 7919 % 3001) as f32 } else { f32::NAN };
        (0..SIZE.0 as usize * SIZE.1 as usize).map(height).collect()
    }

    /// The rule as it is told: all samples that touch a known one at once, round by round.
    fn by_rounds(mut heights_m: Vec<f32>) -> Vec<f32> {
        while heights_m.iter().any(|height| height.is_nan()) {
            let mut before = heights_m.clone();
            let gaps = Gaps { heights_m: &mut before, size: SIZE };
            let unknown: Vec<u32> = (0..SIZE.0 * SIZE.1).filter(|&at| gaps.is_unknown(at)).collect();
            unknown.into_iter().for_each(|at| heights_m[at as usize] = gaps.mean(at));
        }
        heights_m
    }

    #[test]
    fn rings_are_filled_inwards_and_each_sample_once() {
        for every in [2, 61, 1999, 5000] {
            let mut heights_m = with_gaps(every);
            let expected = by_rounds(heights_m.clone());
            let unknown = heights_m.iter().filter(|height| height.is_nan()).count();
            let taken = Gaps { heights_m: &mut heights_m, size: SIZE }.fill().unwrap();
            assert_eq!(heights_m, expected, "one in {every} is known");
            // work that grows with the width of a gap would be many more
            assert_eq!(taken, unknown, "one in {every} is known");
        }
    }
}
