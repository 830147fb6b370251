mod reference;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::experiment::scene::Surface;
use crate::kernel::Elem;
use crate::plan::product::what;
use crate::plan::{Chain, Spread, StepBuilder, product};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "Roughness",
    summary: "for every block of the quadtree, how far the surface is from the block's triangles",
    formula: "Paper: s(block) = max(five errors of the block, 2 s(blocks below)); Proven: s = max |surface - mesh| over all samples",
    source: "Lee, Shin 2011, section 2.1, Eq. 3 and Fig. 2; Proven is ours",
    writes: &["roughness"],
    offers: &[what::<product::Roughness<()>>()],
    parameters: schema::<Roughness>,
    read: read_as::<Roughness>,
    examples: &[Example::new("[Roughness]"), Example::new("[Roughness(error: Proven)]").only_on(Surface::Triangles)],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
enum Error {
    /// the nested five errors
    #[default]
    Paper,
    /// a bound, for surfaces of triangles
    Proven,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Roughness {
    /// what a block's distance is taken from
    error: Error,
}

/// Cells a side of a tile of samples, as a power of two; `TILE_LEVEL` of the kernel.
const TILE_LEVEL: u32 = 4;

/// A step for one level.
fn step<'c, 'a>(chain: &'c mut Chain<'a>, entry: &str, level: u32) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
    let kernel = chain.kernel("quadtree/roughness.wgsl")?;
    Ok(chain.step(&format!("{entry} {level}"), &kernel, entry).set("level", level))
}

impl Stage for Roughness {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let layout = chain.lattice().cells();
        let proven = self.error == Error::Proven;
        if proven && chain.data.scene.surface != Surface::Triangles {
            return Err(Diagnostic::input(
                "a mesh of triangles cannot keep to bilinear patches by more than it has cells",
            )
            .at(chain.origin(), "this stage promises a bound")
            .help("`error: Paper`, or `surface: Triangles` in the scene"));
        }
        if proven {
            chain.check_scene_ground()?;
        }
        let meaning = "largest distance of the surface from a block's triangles";
        let roughness = chain.make_over("roughness", Elem::F32, Spread::Nodes(layout), "m", meaning);
        chain.offer(product::Roughness { roughness, is_bound: proven });
        let finest = layout.size(1).element_product();
        let largest_tiles = layout.size(TILE_LEVEL.min(layout.top)).max(layout.size(1)).element_product();
        let mut edges_and_tiles = None;
        if proven {
            let edges =
                chain.make("edge_off", Elem::Vec4F32, &[finest], "m", "samples on each edge of a block from its line");
            let tiles =
                chain.make("tile_off", Elem::F32, &[largest_tiles], "m", "surface from a block's triangles, by tiles");
            edges_and_tiles = Some((edges, tiles));
        }
        for level in 1..=layout.top {
            let blocks = layout.size(level);
            let Some((edges, tiles)) = edges_and_tiles else {
                step(chain, "nested", level)?.bind("roughness", roughness).over(blocks)?;
                continue;
            };
            step(chain, "edges", level)?.bind("edge_off", edges).over(blocks)?;
            let step_tiles = step(chain, "tiles", level)?.bind("edge_off_in", edges).bind("tile_off", tiles);
            step_tiles.over(layout.size(level.min(TILE_LEVEL)))?;
            step(chain, "gather", level)?.bind("tile_off_in", tiles).bind("roughness", roughness).over(blocks)?;
        }
        Ok(())
    }
}
