mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::ground::EXACT_PX;
use crate::plan::Chain;
use crate::plan::product::{Drawn, NodeRanges, Promise, what};
use crate::stages::shared::drawn::make_distance;
use crate::stages::shared::traversal;
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "RayCast",
    summary: "exact first hit of every pixel's ray with the full-resolution surface: the ground truth",
    formula: "smallest t > 0 with eye.z + t d.z = surface(eye.xy + t d.xy)",
    source: "maximum-pyramid traversal after Tevs, Ihrke, Seidel 2008; sign test at cell borders is ours",
    writes: &["distance"],
    needs: &[what::<NodeRanges<()>>()],
    offers: &[what::<Drawn<()>>()],
    parameters: schema::<RayCast>,
    read: read_as::<RayCast>,
    examples: &[Example::new("[HeightPyramid, RayCast]")],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RayCast {}

impl Stage for RayCast {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        traversal::check(chain)?;
        let start = traversal::lead_tiles(chain)?;
        let (width_px, height_px) = chain.data.scene.viewport;
        let distance = make_distance(chain);
        let kernel = chain.kernel("rays/ray_cast.wgsl")?;
        traversal::step(chain, "cast", &kernel, "main")
            .bind_or_leave("start", start)
            .bind("distance", distance)
            .over(UVec2::new(width_px, height_px))?;
        // of another ground than the scene's, nothing is known; and steep ground can be more than f32 has digits for
        let promise = Promise { bound_px: EXACT_PX, proven: true };
        let promise = (chain.is_scene_ground() && chain.data.rounding_px() <= EXACT_PX).then_some(promise);
        chain.offer(Drawn { distance, error: None, mesh: None, promise });
        Ok(())
    }
}
