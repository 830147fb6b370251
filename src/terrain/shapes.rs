//! Exact shapes whose heights are known in closed form.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::{HeightField, TerrainError};
use crate::experiment::scene::{Shape, ShapeKind};

pub fn generate(spec: &Shape) -> Result<HeightField, TerrainError> {
    if !(spec.period_cells > 0.0 && spec.period_cells.is_finite()) {
        return Err(TerrainError::Parameter(format!("a period of {} cells never repeats", spec.period_cells)));
    }
    let (columns, rows) = spec.size;
    let (low, high) = spec.height_m;
    let mut heights_m = vec![0.0; columns as usize * rows as usize];
    heights_m.par_chunks_mut(columns as usize).zip(0..rows).for_each(|(heights_m, row)| {
        let height_m = |column: u32| (low + (high - low) * share(spec, column, row)) as f32;
        heights_m.iter_mut().zip(0..columns).for_each(|(height, column)| *height = height_m(column));
    });
    Ok(HeightField { size: spec.size.into(), cell_m: spec.cell_m.xy().into(), heights_m })
}

/// Height as a share of the way from lowest to highest.
fn share(spec: &Shape, column: u32, row: u32) -> f64 {
    let (columns, rows) = spec.size;
    let (x, y) = (f64::from(column), f64::from(row));
    let middle = (f64::from(columns - 1) / 2.0, f64::from(rows - 1) / 2.0);
    let period = spec.period_cells;
    match spec.kind {
        ShapeKind::Flat => 0.0,
        ShapeKind::Ramp => x / f64::from(columns - 1),
        ShapeKind::GaussianHill => {
            let sigma = f64::from(columns.min(rows)) / 8.0;
            let (dx, dy) = ((x - middle.0) / sigma, (y - middle.1) / sigma);
            (-(dx * dx + dy * dy) / 2.0).exp()
        }
        ShapeKind::Spike => f64::from((column, row) == (columns / 2, rows / 2)),
        ShapeKind::Cliff => f64::from(column > (columns - 1) / 2),
        ShapeKind::Checkerboard => f64::from(((2.0 * x / period) as u64 + (2.0 * y / period) as u64) % 2 == 1),
        ShapeKind::Sine => 0.5 + 0.5 * (TAU * x / period).sin() * (TAU * y / period).sin(),
    }
}
