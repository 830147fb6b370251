//! The policy for samples without data.

use super::TerrainError;
use crate::experiment::scene::Nodata;

/// Samples without data are NaN on entry; none is on a successful return.
pub fn apply(heights_m: &mut [f64], size: (u32, u32), policy: Nodata) -> Result<(), TerrainError> {
    let Some(first) = heights_m.iter().position(|height| height.is_nan()) else { return Ok(()) };
    match policy {
        Nodata::Refuse => Err(TerrainError::NoData {
            column: first as u32 % size.0,
            row: first as u32 / size.0,
            count: heights_m.iter().filter(|height| height.is_nan()).count(),
        }),
        Nodata::Fill(height_m) => {
            heights_m.iter_mut().filter(|height| height.is_nan()).for_each(|height| *height = height_m);
            Ok(())
        }
        Nodata::Interpolate => interpolate(heights_m, size),
    }
}

/// Fills gaps ring by ring from their border: each round, every unknown sample that touches a known one
/// becomes the mean of its known neighbours (of eight).
fn interpolate(heights_m: &mut [f64], (columns, rows): (u32, u32)) -> Result<(), TerrainError> {
    let mut unknown: Vec<usize> = (0..heights_m.len()).filter(|&at| heights_m[at].is_nan()).collect();
    while !unknown.is_empty() {
        let means: Vec<(usize, Option<f64>)> =
            unknown.iter().map(|&at| (at, known_mean(heights_m, columns, rows, at))).collect();
        unknown.clear();
        let mut progress = false;
        for (at, mean) in means {
            match mean {
                Some(mean) => {
                    heights_m[at] = mean;
                    progress = true;
                }
                None => unknown.push(at),
            }
        }
        if !progress {
            return Err(TerrainError::NothingKnown);
        }
    }
    Ok(())
}

fn known_mean(heights_m: &[f64], columns: u32, rows: u32, at: usize) -> Option<f64> {
    let (column, row) = (at as u32 % columns, at as u32 / columns);
    let (mut sum, mut count) = (0.0, 0u32);
    for y in row.saturating_sub(1)..=(row + 1).min(rows - 1) {
        for x in column.saturating_sub(1)..=(column + 1).min(columns - 1) {
            let height = heights_m[(y * columns + x) as usize];
            if !height.is_nan() {
                sum += height;
                count += 1;
            }
        }
    }
    (count > 0).then(|| sum / f64::from(count))
}
