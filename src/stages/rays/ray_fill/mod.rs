mod reference;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::{Drawn, Listing, NodeRanges, what};
use crate::plan::{BufferId, Chain};
use crate::stages::shared::traversal;
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "RayFill",
    summary: "first hit for the pixels of a list, in place of what the mesh drew there; of blocks of rows, within the mesh's bound",
    formula: "as RayCast, from where the mesh was hit if it is nowhere under the surface; pixels of a block over the bound share the ray between them where focal_px (h + G a) |q f_z - z| / (s - (h + G a) |f_z|) is within it (docs/proven_bound.md, 5)",
    source: "Loeffler et al. 2009, section 4 (rendering); the start at the mesh is ours",
    reads: &["pixels", "pixels_count"],
    writes: &["distance"],
    needs: &[what::<NodeRanges<()>>(), what::<Drawn<()>>(), what::<Listing<()>>()],
    offers: &[what::<Drawn<()>>()],
    parameters: schema::<RayFill>,
    read: read_as::<RayFill>,
    examples: &[
        Example::new(
            "[HeightPyramid, ViewGrid(size: (23, 17)), AspectImportance(size: (21, 17)), Warp(rounds: 2, least_gain: 0, uniform_share: 0.1), \
             Project, GridError(threshold_px: 0.5), Rasterize, Compact, RayFill]",
        )
        .in_benches(&[("ViewGrid.size", "(512, 384)"), ("AspectImportance.size", "(64, 64)"), ("GridError.threshold_px", "1")]),
        Example::new(
            "[HeightPyramid, PlanePyramid, ViewGrid(size: (17, 23)), AspectImportance(size: (5, 8)), Warp, Project(filter: Finest), \
             GridError(rule: Proven, threshold_px: 2), LeadRays, Rasterize, Compact, RayFill]",
        )
        .in_benches(&[("ViewGrid.size", "(96, 72)"), ("AspectImportance.size", "(64, 64)"), ("GridError.threshold_px", "1")]),
        Example::new(
            "[HeightPyramid, PlanePyramid, ViewGrid(size: (17, 23)), Project(filter: Finest), GridError(rule: Proven, threshold_px: 2), \
             LeadRays, Rasterize, Compact(rows: 4), RayFill]",
        )
        .in_benches(&[("ViewGrid.size", "(96, 72)")]),
    ],
    ..Info::EMPTY
};

#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RayFill {
    /// the list, as `Compact` makes it
    pixels: String,
}

impl Default for RayFill {
    fn default() -> Self {
        Self { pixels: "pixels".into() }
    }
}

/// The pixels to fill.
struct Pixels {
    pixels: BufferId,
    count: BufferId,
    rows: u32,
    length: u32,
}

impl RayFill {
    fn list(&self, chain: &Chain, error: BufferId) -> Result<Pixels, Diagnostic> {
        let (width_px, height_px) = chain.data.scene.viewport;
        let count_name = format!("{}_count", self.pixels);
        let numbers = chain.read(&self.pixels)?;
        let is_block = |listing: &Listing<BufferId>| listing.numbers == numbers && listing.rows > 1;
        let listing = chain.products().find(is_block);
        let Some(listing) = listing else {
            let length = width_px * height_px;
            let pixels = chain.read_as(&self.pixels, Elem::U32, &[length])?;
            let count = chain.read_as(&count_name, Elem::U32, &[4])?;
            return Ok(Pixels { pixels, count, rows: 1, length });
        };
        if listing.of != error || listing.above != 0.0 {
            let listed = &chain.buffer(listing.of).name;
            let message = format!(
                "blocks of rows are filled where the picture's error is above 0, and `{}` lists `{listed}` above {}",
                self.pixels, listing.above
            );
            return Err(Diagnostic::input(message).at(chain.origin(), "this stage").help("list it with `rows: 1`"));
        }
        // a thread casts the ray between the rows, and where that does not do, one for each row
        let turns = (listing.rows + 1).saturating_mul(traversal::most_turns(chain.lattice().size));
        if turns > traversal::MOST_TURNS {
            let message = format!(
                "blocks of {} rows over so large a terrain take up to {turns} turns of a thread's loops, which an adapter may end after {}",
                listing.rows,
                traversal::MOST_TURNS
            );
            return Err(Diagnostic::input(message)
                .at(chain.origin(), "this stage")
                .help("list fewer rows in a block; with `rows: 1` any terrain will do"));
        }
        let length = width_px * height_px.div_ceil(listing.rows);
        let Listing { numbers: pixels, count, rows, .. } = listing;
        chain.check_kind(pixels, Elem::U32, &[length])?;
        for id in [pixels, count] {
            chain.check_own(id)?;
        }
        Ok(Pixels { pixels, count, rows, length })
    }
}

impl Stage for RayFill {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        traversal::check(chain)?;
        let drawn: Drawn<BufferId> = chain.latest()?;
        let distance = drawn.distance;
        let Some(error) = drawn.error else {
            return Err(Diagnostic::input("`RayFill` needs the error of each pixel, and what was drawn has none")
                .at(chain.origin(), "this stage")
                .help("`GridError` before `Rasterize` makes it"));
        };
        let Pixels { pixels, count, rows, length } = self.list(chain, error)?;
        let promise = drawn.promise.filter(|promise| promise.proven);
        // what another fill has shown may be behind the surface, if only by the bound
        let is_drawn = chain.steps_writing(distance) == 1;
        let is_own = chain.check_own(error).is_ok();
        let from_mesh = promise.is_some() && is_drawn && is_own && drawn.mesh.is_some();
        let start = traversal::lead_tiles(chain)?;
        let kernel = chain.kernel("rays/ray_fill.wgsl")?;
        let bound_px = promise.map_or(0.0, |promise| promise.told_px(chain.data));
        let steepest = if rows == 1 { 0.0 } else { chain.data.ground.steepest() };
        traversal::step(chain, "fill", &kernel, "main")
            .constant("FROM_MESH", f64::from(from_mesh))
            .constant("ROWS", rows.into())
            .set("length", length)
            .set("steepest", (steepest * 1.000001) as f32)
            .set("bound_px", bound_px as f32)
            .bind_or_leave("clear_until", start)
            .bind("pixels", pixels)
            .bind("pixels_count", count)
            .bind("error", error)
            .bind("distance", distance)
            .over_indirect(count)?;
        chain.offer(drawn);
        Ok(())
    }
}
