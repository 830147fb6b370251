use glam::UVec2;
use serde::Deserialize;

use super::{EPSILON, Info, Stage};
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Kernel};
use crate::plan::Chain;
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "ViewGrid",
    summary: "uniform grid over the projector's image",
    formula: "point(i, j) = (i / (columns - 1), j / (rows - 1))",
    source: "Livny et al. 2008, section 3 (the persistent grid)",
    reads: &[],
    writes: &["grid_point"],
    kernels: &["view_grid.wgsl"],
    params: &[("size", "(256, 256)", "columns and rows of grid points, 2 to 8192 each")],
    read: |node, _| {
        let grid: ViewGrid = node.parse_fields()?;
        let (columns, rows) = grid.size;
        if !(2..=8192).contains(&columns) || !(2..=8192).contains(&rows) {
            let size = node.field("size").unwrap_or(node);
            return Err(Diagnostic::input(format!("a grid of {columns} x {rows} points"))
                .at(&size.origin, "each side is from 2 to 8192 points"));
        }
        Ok(Box::new(grid))
    },
};

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ViewGrid {
    size: (u32, u32),
}

impl Default for ViewGrid {
    fn default() -> Self {
        Self { size: (256, 256) }
    }
}

impl Stage for ViewGrid {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let (columns, rows) = self.size;
        let points = chain.make(
            "grid_point",
            Elem::Vec2F32,
            &[rows, columns],
            "",
            "place in the projector's image, (0, 0) to (1, 1)",
        );
        let kernel = Kernel::built_in("view_grid.wgsl")?;
        chain
            .step("grid", &kernel, "main")
            .bind("grid_point", points)
            .set("size", [columns, rows])
            .over(UVec2::from(self.size))
    }

    fn reference(&self, _frame: &Frame, buffers: &mut Buffers) {
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
    }
}
