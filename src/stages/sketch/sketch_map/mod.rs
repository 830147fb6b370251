mod reference;

use glam::{DVec2, IVec2, UVec2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::ground::Lattice;
use crate::kernel::Elem;
use crate::plan::{Chain, Spread};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "SketchMap",
    summary: "the square of terrain that holds the view, copied out of one level of the mean pyramid",
    formula: "height(i, j) = mean_L(corner + (i, j)), L the finest level at which the map holds every node in view",
    source: "Dachsbacher, Stamminger 2004, sections 1 and 5 (sketch atlas and sketch map)",
    reads: &["height_mean"],
    writes: &["sketch_square", "sketch_height"],
    parameters: schema::<SketchMap>,
    read: read_as::<SketchMap>,
    examples: &[
        Example::new("[HeightPyramid, SketchMap(texels: 9)]").in_benches(&[("SketchMap.texels", "128")]),
        Example::new("[HeightPyramid, SketchMap(texels: 6, far_m: 900)]").in_benches(&[("SketchMap.texels", "128")]),
    ],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SketchMap {
    /// texels along a side of the map
    #[schemars(range(min = 4, max = 8192))]
    texels: u32,
    /// what is farther to the east, west, north or south than this is not asked for, in metres; None is all that can be seen
    #[schemars(extend("exclusiveMinimum" = 0))]
    far_m: Option<f64>,
}

impl Default for SketchMap {
    fn default() -> Self {
        Self { texels: 128, far_m: None }
    }
}

/// Samples along a side that a map has at least; `LEAST` of the kernel.
const LEAST: i32 = 4;

impl SketchMap {
    /// So many samples from the eye are asked for, by columns and by rows.
    fn far(&self, lattice: Lattice) -> IVec2 {
        let far = self.far_m.map_or(DVec2::INFINITY, |far_m| (far_m / lattice.cell_m).ceil());
        far.min(DVec2::splat(f64::from(1 << 29))).as_ivec2()
    }

    /// The coarsest level that can be needed.
    fn top(&self, lattice: Lattice) -> u32 {
        let last = lattice.last().max_element().max(LEAST as u32 - 1);
        (0..32).find(|level| last >> level < self.texels).unwrap_or(31)
    }
}

impl Stage for SketchMap {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let lattice = chain.lattice();
        let top = self.top(lattice);
        let means = match top == 0 || chain.is_flat() {
            true => None,
            false => Some(chain.read_of_ground("height_mean", Elem::F32, &lattice.means().dims())?),
        };
        if top == 0 {
            chain.leave_out("the mean pyramid", "the map has room for every sample of the terrain", 0, 0);
        } else if means.is_none() {
            chain.leave_out("the mean pyramid", "the terrain is flat, every level is the same", 0, 0);
        }
        let made = means.and_then(|means| chain.buffer(means).top_level).unwrap_or(u32::MAX);
        if made < top {
            let message =
                format!("a sketch map can need level {top} of the mean pyramid, which is made up to level {made}");
            return Err(Diagnostic::input(message)
                .at(chain.origin(), "this stage")
                .help(format!("give `HeightPyramid` a `max_level` of at least {top}, or the map more texels")));
        }
        let meaning =
            "column and row of the node that the north-west texel is, level of the nodes, texels along a side";
        let square = chain.make("sketch_square", Elem::I32, &[4], "", meaning);
        let dims = [self.texels; 2];
        let heights = chain.make("sketch_height", Elem::F32, &dims, "m", "height of each node in the square");
        chain.set_spread(heights, Spread::UnitSquare);
        let kernel = chain.kernel("sketch/sketch_map.wgsl")?;
        chain
            .step("copy", &kernel, "main")
            .bind_or_leave("height_mean", means)
            .bind("sketch_square", square)
            .bind("sketch_height", heights)
            .constant("FINEST", f64::from(means.is_none()))
            .set("texels", self.texels)
            .set("far", self.far(lattice).to_array())
            .over(UVec2::splat(self.texels))
    }
}
