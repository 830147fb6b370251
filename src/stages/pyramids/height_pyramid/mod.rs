mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::{NodeRanges, what};
use crate::plan::{Chain, Spread};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "HeightPyramid",
    summary: "mean, minimum and maximum pyramids of the height samples",
    formula: "max_k(node) = max of the surface over 2^k x 2^k cells; mean_k(node) = mean of 2^k x 2^k samples",
    source: "Livny et al. 2008, section 3.4 (mean); Loeffler et al. 2009, section 4 (minimum, maximum)",
    writes: &["height_max", "height_min", "height_mean"],
    offers: &[what::<NodeRanges<()>>()],
    parameters: schema::<HeightPyramid>,
    read: read_as::<HeightPyramid>,
    examples: &[Example::new("[HeightPyramid]"), Example::new("[HeightPyramid(max_level: 2)]")],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HeightPyramid {
    /// coarsest level of the mean pyramid; None is up to a single node
    max_level: Option<u32>,
}

impl Stage for HeightPyramid {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let (bounds, mean) = (chain.lattice().cells(), chain.lattice().means());
        let highest =
            chain.make_over("height_max", Elem::F32, Spread::Nodes(bounds), "m", "maximum pyramid over cells");
        let lowest = chain.make_over("height_min", Elem::F32, Spread::Nodes(bounds), "m", "minimum pyramid over cells");
        chain.offer(NodeRanges { lowest, highest });
        let means = chain.make_over("height_mean", Elem::F32, Spread::Nodes(mean), "m", "mean pyramid over samples");
        let kernel = chain.kernel("pyramids/height_pyramid.wgsl")?;
        let mean_top = self.max_level.unwrap_or(mean.top).min(mean.top);
        chain.set_top_level(means, mean_top);
        if mean_top < mean.top {
            let nodes = |level| u64::from(mean.size(level).element_product());
            let saved = (mean_top + 1..=mean.top).map(nodes).sum::<u64>();
            let what = format!("mean levels {} to {}", mean_top + 1, mean.top);
            chain.leave_out(&what, "`max_level` says nobody samples them", saved * 4, saved);
        }
        let top = bounds.top.max(mean_top);
        for level in (1..=top).step_by(3) {
            let levels = (top - level + 1).min(3);
            let label = format!("levels {level} to {}", level + levels - 1);
            let mut step = chain.step(&label, &kernel, "main").constant("FROM_SAMPLES", f64::from(level == 1));
            // past its own top a pyramid has nothing to write
            if level <= bounds.top {
                step = step.bind_if_wanted("height_max", highest, "WRITE_MAX").bind_if_wanted(
                    "height_min",
                    lowest,
                    "WRITE_MIN",
                );
            } else {
                step = step.bind("height_max", highest).bind("height_min", lowest);
                step = step.constant("WRITE_MAX", 0.0).constant("WRITE_MIN", 0.0);
            }
            if level <= mean_top {
                step = step.bind_if_wanted("height_mean", means, "WRITE_MEAN");
            } else {
                step = step.bind("height_mean", means).constant("WRITE_MEAN", 0.0);
            }
            step.set("level", level)
                .set("levels", levels)
                .over(mean.size(level - 1).map(|side| side.div_ceil(8)).max(UVec2::ONE))?;
        }
        Ok(())
    }
}
