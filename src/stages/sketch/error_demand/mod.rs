mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::{Demand, PointErrors, what};
use crate::plan::{BufferId, Chain, Spread, StepBuilder};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "ErrorDemand",
    summary: "how densely grid points would have to lie for the errors of a geometry image to be as large as is allowed; for the next frame's importance",
    formula: "max over the cells that may touch a texel: (error / allowed)^(1 / order) / largest side; error / allowed = 1 / (1 - grid_error), which is at least 1: `threshold_px` has to be below the errors",
    source: "ours; errors of grid points after Loeffler et al. 2009, Eq. 4",
    writes: &["error_demand", "error_square"],
    needs: &[what::<Demand<()>>(), what::<PointErrors<()>>()],
    parameters: schema::<ErrorDemand>,
    read: read_as::<ErrorDemand>,
    examples: &[
        Example::new(
            "[HeightPyramid, SketchMap(texels: 8), SketchImportance(error_share: 0.5), ViewGrid(size: (23, 17)), Warp, GeometryImage, \
             GridError(rule: Estimate, threshold_px: 0.1), ErrorDemand(texels: 11)]",
        )
        .in_benches(&[("SketchMap.texels", "128"), ("ViewGrid.size", "(512, 512)"), ("ErrorDemand.texels", "64")]),
        Example::new(
            "[HeightPyramid, SketchMap(texels: 9, blend: 1), SketchImportance(error_share: 1, distance: false), ViewGrid(size: (8, 6)), \
             GeometryImage, GridError(rule: Estimate, threshold_px: 0.01), ErrorDemand(texels: 6, order: 1)]",
        )
        .in_benches(&[("SketchMap.texels", "128"), ("ViewGrid.size", "(512, 512)"), ("ErrorDemand.texels", "64")]),
    ],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ErrorDemand {
    // a cell may touch all texels, and the loops of a thread have 65535 turns
    /// texels along a side of the map
    #[schemars(range(min = 1, max = 255))]
    texels: u32,
    /// power of a cell's side that the error falls with: 2 where the ground is smooth, 1 where it is rough at every scale
    #[schemars(range(min = 0.25, max = 4))]
    order: f64,
}

impl Default for ErrorDemand {
    fn default() -> Self {
        Self { texels: 64, order: 2.0 }
    }
}

impl Stage for ErrorDemand {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let Demand { places, vertex, square, .. } = chain.latest::<Demand<BufferId>>()?;
        let PointErrors { errors } = chain.latest::<PointErrors<BufferId>>()?;
        let size = chain.grid_size(places, Elem::Vec2F32)?;
        chain.check_kind(errors, Elem::F32, &[size.y, size.x])?;
        let dims = [self.texels; 2];
        let meaning = "grid points a metre that errors ask for";
        let demand = chain.make("error_demand", Elem::F32, &dims, "1/m", meaning);
        let over =
            chain.make("error_square", Elem::I32, &[4], "", "the square that it is over, as `sketch_square` has it");
        let painted = chain.make("painted", Elem::U32, &dims, "", "the largest so far, as the bits of an f32");
        [demand, painted].into_iter().for_each(|id| chain.set_spread(id, Spread::UnitSquare));
        let texels = UVec2::new(self.texels * self.texels, 1);
        self.step(chain, size, "begin")?.bind("painted", painted).over(texels)?;
        let paint = self.step(chain, size, "paint")?.bind("grid_point", places).bind("vertex", vertex);
        paint.bind("grid_error", errors).bind("painted", painted).over(size - 1)?;
        let finish = self.step(chain, size, "finish")?.bind("painted", painted).bind("error_demand", demand);
        finish.bind("sketch_square", square).bind("error_square", over).over(texels)
    }
}

impl ErrorDemand {
    fn step<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        size: UVec2,
        entry: &str,
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        let kernel = chain.kernel("sketch/error_demand.wgsl")?;
        let step = chain.step(entry, &kernel, entry).set("grid", size.to_array()).set("texels", self.texels);
        Ok(step.set("per_order", (1.0 / self.order) as f32))
    }
}
