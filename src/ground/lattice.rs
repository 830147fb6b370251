//! Where height samples are.

use glam::{DVec2, UVec2};

use super::pyramid::Layout;

/// A rectangle of samples. Sample coordinates are (column, row), row 0 in the north; the south-west sample is at world (0, 0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Columns and rows of samples.
    pub size: UVec2,
    /// Metres between columns and between rows.
    pub cell_m: DVec2,
}

impl Lattice {
    /// The last sample: south-east.
    pub fn last(&self) -> UVec2 {
        self.size - 1
    }

    /// World metres from the south-west to the north-east sample.
    pub fn extent_m(&self) -> DVec2 {
        self.last().as_dvec2() * self.cell_m
    }

    /// Sample coordinates, both continuous, of a world position.
    pub fn sample_from_world(&self, position_m: DVec2) -> DVec2 {
        let cells = position_m / self.cell_m;
        DVec2::new(cells.x, f64::from(self.size.y - 1) - cells.y)
    }

    /// World position of sample coordinates.
    pub fn world_from_sample(&self, sample: DVec2) -> DVec2 {
        DVec2::new(sample.x, f64::from(self.size.y - 1) - sample.y) * self.cell_m
    }

    /// A direction in the world as cells to the east and to the south.
    pub fn cells_from_world(&self, direction_m: DVec2) -> DVec2 {
        DVec2::new(direction_m.x, -direction_m.y) / self.cell_m
    }

    /// Levels over cells: lowest and highest heights.
    pub fn cells(&self) -> Layout {
        Layout::new(self.last())
    }

    /// Levels over samples: means.
    pub fn means(&self) -> Layout {
        Layout::new(self.size)
    }
}
