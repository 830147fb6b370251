mod reference;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::plan::Chain;
use crate::plan::product::{NodeRanges, what};
use crate::stages::shared::traversal;
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "LeadRays",
    summary: "how far the rays of each tile of pixels can go at once before any of them can meet the surface",
    formula: "clear_until <= min over the tile's rays of the depth of their first hit; without end if a bundle meets nothing",
    source: "ours; the coarse pass of RayCast as a stage, so that sky is known before pixels are listed",
    writes: &["clear_until"],
    needs: &[what::<NodeRanges<()>>()],
    parameters: schema::<LeadRays>,
    read: read_as::<LeadRays>,
    examples: &[Example::new("[HeightPyramid, LeadRays]")],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LeadRays {}

impl Stage for LeadRays {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        traversal::check(chain)?;
        traversal::lead_tiles(chain).map(|_| ())
    }
}
