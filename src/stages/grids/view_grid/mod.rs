mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::{Chain, Spread};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "ViewGrid",
    summary: "uniform grid over the unit square: the projector's image, or the square of a sketch map",
    formula: "point(i, j) = (i / (columns - 1), j / (rows - 1))",
    source: "Livny et al. 2008, section 3 (the persistent grid)",
    writes: &["grid_point"],
    parameters: schema::<ViewGrid>,
    read: read_as::<ViewGrid>,
    examples: &[Example::new("[ViewGrid(size: (23, 17))]").in_benches(&[("ViewGrid.size", "(512, 384)")])],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ViewGrid {
    /// columns and rows of grid points
    #[schemars(extend("minimum" = 2, "maximum" = 8192))]
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
            "place in the square that the grid is over, (0, 0) to (1, 1)",
        );
        chain.set_spread(points, Spread::GridPoints);
        let kernel = chain.kernel("grids/view_grid.wgsl")?;
        chain
            .step("grid", &kernel, "main")
            .bind("grid_point", points)
            .set("size", [columns, rows])
            .over(UVec2::from(self.size))
    }
}
