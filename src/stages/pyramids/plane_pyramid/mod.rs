mod reference;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::{Elem, Packing};
use crate::plan::{Chain, Spread};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "PlanePyramid",
    summary: "for every node of a pyramid a plane and the largest distance between it and the surface",
    formula: "|surface(x, y) - (c + g . (x, y))| <= r over 2^k x 2^k cells; g by least squares",
    source: "ours; what the minimum and maximum pyramids of Loeffler et al. 2009 are to a level surface, this is to a sloping one",
    writes: &["height_plane", "plane_slope"],
    parameters: schema::<PlanePyramid>,
    read: read_as::<PlanePyramid>,
    examples: &[Example::new("[PlanePyramid]")],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlanePyramid {}

/// Levels whose planes are fitted to the samples and not to the level below.
const EXACT_LEVELS: u32 = 3;

impl Stage for PlanePyramid {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        chain.check_scene_ground()?;
        let layout = chain.lattice().cells();
        let meaning = "height in the middle of each node, largest distance of the surface from its plane";
        let planes = chain.make_over("height_plane", Elem::Vec2F32, Spread::Nodes(layout), "m", meaning);
        let meaning = "slope of each plane to the east and to the south in metres a cell, as two halves";
        let slopes = chain.make_over("plane_slope", Elem::U32, Spread::Nodes(layout), "", meaning);
        chain.set_packing(slopes, Packing::Halves);
        let (low, high) = chain.data.ground.range_m();
        let kernel = chain.kernel("pyramids/plane_pyramid.wgsl")?;
        for level in 1..=layout.top {
            let entry = if level <= EXACT_LEVELS { "from_samples" } else { "from_planes" };
            let step = chain.step(&format!("level {level}"), &kernel, entry);
            step.bind("height_plane", planes)
                .bind("plane_slope", slopes)
                .set("level", level)
                .set("largest_m", low.abs().max(high.abs()) as f32)
                .over(layout.size(level))?;
        }
        Ok(())
    }
}
