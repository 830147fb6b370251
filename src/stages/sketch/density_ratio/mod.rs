mod reference;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::{Demand, what};
use crate::plan::{BufferId, Chain, Spread};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "DensityRatio",
    summary: "density of grid points that there is over the density that was asked for, for each cell of a geometry image",
    formula: "1 / (||Phi_s|| I) along rows, 1 / (||Phi_t|| I) down columns, with a cell's sides and the importance in its middle",
    source: "Dachsbacher, Stamminger 2004, section 3.3, Fig. 6: the text's ratio, not the caption's",
    writes: &["density_ratio"],
    needs: &[what::<Demand<()>>()],
    parameters: schema::<DensityRatio>,
    read: read_as::<DensityRatio>,
    examples: &[Example::new(
        "[HeightPyramid, SketchMap(texels: 8), SketchImportance, ViewGrid(size: (23, 17)), Warp, GeometryImage, DensityRatio]",
    )
    .in_benches(&[("SketchMap.texels", "128"), ("ViewGrid.size", "(512, 512)")])],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DensityRatio {}

impl Stage for DensityRatio {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let Demand { importance, places, vertex, .. } = chain.latest::<Demand<BufferId>>()?;
        let size = chain.grid_size(places, Elem::Vec2F32)?;
        let texels = chain.buffer(importance).dims[0];
        let meaning =
            "obtained over demanded density of grid points: along rows, down columns; a common factor is free";
        let ratio = chain.make("density_ratio", Elem::Vec2F32, &[size.y - 1, size.x - 1], "", meaning);
        chain.set_spread(ratio, Spread::GridCells);
        let kernel = chain.kernel("sketch/density_ratio.wgsl")?;
        chain
            .step("ratio", &kernel, "main")
            .bind("importance", importance)
            .bind("grid_point", places)
            .bind("vertex", vertex)
            .bind("density_ratio", ratio)
            .set("grid", size.to_array())
            .set("texels", texels)
            .over(size - 1)
    }
}
