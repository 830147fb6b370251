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
    name: "AspectImportance",
    summary: "importance of the cells of a coarse grid on the view plane: how stretched they are on the base plane",
    formula: "importance = length along the view / width across it, of the projected cell",
    source: "Loeffler et al. 2009, section 4 (grid definition): the inverse of their aspect ratio",
    writes: &["importance"],
    parameters: schema::<AspectImportance>,
    read: read_as::<AspectImportance>,
    examples: &[Example::new("[AspectImportance(size: (21, 17))]").in_benches(&[("AspectImportance.size", "(64, 64)")])],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AspectImportance {
    /// columns and rows of cells
    #[schemars(extend("minimum" = 1, "maximum" = 8192))]
    size: (u32, u32),
}

impl Default for AspectImportance {
    fn default() -> Self {
        Self { size: (64, 64) }
    }
}

impl Stage for AspectImportance {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let (columns, rows) = self.size;
        let importance =
            chain.make("importance", Elem::F32, &[rows, columns], "", "length over width of the projected cell");
        chain.set_spread(importance, Spread::UnitSquare);
        let kernel = chain.kernel("grids/aspect_importance.wgsl")?;
        chain
            .step("importance", &kernel, "main")
            .bind("importance", importance)
            .set("size", [columns, rows])
            .over(UVec2::from(self.size))
    }
}
