use super::ViewGrid;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::rounding::EPSILON;

impl Reference for ViewGrid {
    fn reference(&self, _frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let (columns, rows) = self.size;
        let mut points = Values::missing(&[rows, columns], 2);
        for row in 0..rows {
            for column in 0..columns {
                let at = 2 * (row * columns + column) as usize;
                let place = |at: u32, side: u32| f64::from(at) / f64::from(side - 1);
                // Vulkan lets a division be off by 2.5 units in the last place
                points.set(at, place(column, columns), 5.0 * EPSILON);
                points.set(at + 1, place(row, rows), 5.0 * EPSILON);
            }
        }
        buffers.put("grid_point", points);
        Ok(())
    }
}
