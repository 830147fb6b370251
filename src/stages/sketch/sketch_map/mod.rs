mod reference;

use glam::{DVec2, IVec2, UVec2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::ground::Lattice;
use crate::kernel::Elem;
use crate::plan::{Chain, Spread};
use crate::stages::shared::heights::{Filter, Means};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "SketchMap",
    summary: "the square of terrain that holds the view, copied out of one level of the mean pyramid",
    formula: "height(i, j) = mean_L(corner + (i, j)), L the finest level at which the map holds every node in view; where a change is blended, side = side_(L-1) + (seen - side_(L-1)) / blend, heights between levels L - 1 and L",
    source: "Dachsbacher, Stamminger 2004, sections 1 and 5 (sketch atlas and sketch map)",
    reads: &["height_mean"],
    writes: &["sketch_square", "sketch_height"],
    parameters: schema::<SketchMap>,
    read: read_as::<SketchMap>,
    examples: &[
        Example::new("[HeightPyramid, SketchMap(texels: 9)]").in_benches(&[("SketchMap.texels", "128")]),
        Example::new("[HeightPyramid, SketchMap(texels: 6, far_m: 900)]").in_benches(&[("SketchMap.texels", "128")]),
        Example::new("[HeightPyramid, SketchMap(texels: 7, blend: 1)]").in_benches(&[("SketchMap.texels", "128")]),
        Example::new("[HeightPyramid, SketchMap(texels: 9, blend: 0.3)]").in_benches(&[("SketchMap.texels", "128")]),
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
    /// share of a level's range over which the change to it is blended: the square grows with the view, and heights go from one level to the
    /// other; 0 changes at once, with 1 the square grows with the view over all of the range
    #[schemars(range(min = 0, max = 1))]
    blend: f64,
}

impl Default for SketchMap {
    fn default() -> Self {
        Self { texels: 128, far_m: None, blend: 0.0 }
    }
}

/// Samples along a side that a map has at least; `LEAST` of the kernel.
const LEAST: i32 = 4;
/// Parts of what is blended; `STEPS` of the kernel. Twice the largest terrain's side times these, or times the texels of the largest map, is a
/// number of 32 bits.
const STEPS: i32 = 1024;

impl SketchMap {
    /// So many samples from the eye are asked for, by columns and by rows.
    fn far(&self, lattice: Lattice) -> IVec2 {
        let far = self.far_m.map_or(DVec2::INFINITY, |far_m| (far_m / lattice.cell_m).ceil());
        far.min(DVec2::splat(f64::from(1 << 29))).as_ivec2()
    }

    /// The share over which a change is blended, in parts.
    fn blend(&self) -> i32 {
        let parts = (self.blend * f64::from(STEPS)).round() as i32;
        if self.blend > 0.0 { parts.max(1) } else { 0 }
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
        let filter = if top == 0 { Filter::Finest } else { Filter::default() };
        let means = Means::find(chain, filter, None)?;
        if top == 0 {
            chain.leave_out("the mean pyramid", "the map has room for every sample of the terrain", 0, 0);
        }
        if self.blend > 0.0 && top == 0 {
            chain.leave_out("blended changes of the level", "the map has one level only", 0, 0);
        }
        if let Some(made) = means.top_level(chain).filter(|made| *made < top) {
            let message =
                format!("a sketch map can need level {top} of the mean pyramid, which is made up to level {made}");
            return Err(Diagnostic::input(message)
                .at(chain.origin(), "this stage")
                .help(format!("give `HeightPyramid` a `max_level` of at least {top}, or the map more texels")));
        }
        let meaning = "column and row of the north-west sample, samples along a side, level of the nodes";
        let square = chain.make("sketch_square", Elem::I32, &[4], "", meaning);
        let dims = [self.texels; 2];
        let heights = chain.make("sketch_height", Elem::F32, &dims, "m", "height of each node in the square");
        chain.set_spread(heights, Spread::UnitSquare);
        let kernel = chain.kernel("sketch/sketch_map.wgsl")?;
        let copy = chain
            .step("copy", &kernel, "main")
            .bind("sketch_square", square)
            .bind("sketch_height", heights)
            .constant("BLENDED", f64::from(self.blend > 0.0 && top > 0))
            .set("texels", self.texels)
            .set("far", self.far(lattice).to_array())
            .set("blend", self.blend());
        means.bind(copy).over(UVec2::splat(self.texels))
    }
}
