mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::experiment::scene::Surface;
use crate::ground::pyramid::Layout;
use crate::kernel::Elem;
use crate::plan::product::what;
use crate::plan::{BufferId, Chain, Spread, StepBuilder, product};
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
        let scratch = proven.then(|| Scratch::make(chain, layout));
        for level in 1..=layout.top {
            match &scratch {
                None => step(chain, "nested", level)?.bind("roughness", roughness).over(layout.size(level))?,
                Some(scratch) => scratch.level(chain, layout, level, roughness)?,
            }
        }
        Ok(())
    }
}

/// What the levels of a bound use one after the other.
struct Scratch {
    edge_off: BufferId,
    tile_off: BufferId,
    /// Needed where blocks are larger than tiles.
    row_off: Option<BufferId>,
}

impl Scratch {
    fn make(chain: &mut Chain, layout: Layout) -> Self {
        let edges = layout.size(1).element_product();
        let tiles = layout.size(TILE_LEVEL.min(layout.top)).max(layout.size(1)).element_product();
        let rows = (TILE_LEVEL + 1..=layout.top).map(|level| layout.size(level).x * layout.size(TILE_LEVEL).y).max();
        let meaning = "samples on each edge of a block from its line";
        let edge_off = chain.make("edge_off", Elem::Vec4F32, &[edges], "m", meaning);
        let mut make = |name: &str, length: u32, by: &str| {
            chain.make(name, Elem::F32, &[length], "m", &format!("surface from a block's triangles, by {by}"))
        };
        let tile_off = make("tile_off", tiles, "tiles");
        let row_off = rows.map(|rows| make("row_off", rows, "rows of tiles"));
        Self { edge_off, tile_off, row_off }
    }

    /// The steps of one level.
    fn level(&self, chain: &mut Chain, layout: Layout, level: u32, roughness: BufferId) -> Result<(), Diagnostic> {
        let (blocks, tiles) = (layout.size(level), layout.size(level.min(TILE_LEVEL)));
        step(chain, "edges", level)?.bind("edge_off", self.edge_off).over(blocks)?;
        step(chain, "tiles", level)?.bind("edge_off_in", self.edge_off).bind("tile_off", self.tile_off).over(tiles)?;
        // a block that is no larger than a tile is its own row of tiles
        let mut row_off = self.tile_off;
        if let Some(rows) = self.row_off.filter(|_| level > TILE_LEVEL) {
            let rows_of_tiles = UVec2::new(blocks.x, tiles.y);
            step(chain, "gather_rows", level)?
                .bind("tile_off_in", self.tile_off)
                .bind("row_off", rows)
                .over(rows_of_tiles)?;
            row_off = rows;
        }
        step(chain, "gather", level)?.bind("row_off_in", row_off).bind("roughness", roughness).over(blocks)
    }
}
