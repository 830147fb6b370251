//! A grid of vertices, drawn as one strip and cut at the terrain's border.

use glam::UVec2;

use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::Elem;
use crate::plan::product::{Drawn, Grid, Mesh, MeshLevel};
use crate::plan::{BufferId, Chain, Spread, StepBuilder, Vertices};
use crate::stages::shared::drawn::make_distance;
use crate::stages::shared::rounding::PROOF_SNAP_PX;
use crate::stages::shared::traversal::known_tiles;

pub(super) fn plan(chain: &mut Chain, grid: Grid<BufferId>) -> Result<Drawn<BufferId>, Diagnostic> {
    let size = chain.grid_size(grid.vertex, Elem::Vec4F32)?;
    let strip = strip(chain, size)?;
    let is_proven = grid.promise.is_some_and(|promise| promise.proven);
    let tiles = match is_proven && chain.find("clear_until").is_some() && !chain.sees_underside() {
        true => Some(known_tiles(chain)?),
        false => None,
    };
    let carries_level = grid.promise.is_none() && chain.octaves().is_some();
    let (elem, meaning) = match (grid.promise, carries_level) {
        (None, false) => (Elem::U32, "distance of the nearest triangle as the bits of an f32; 0 is none"),
        (None, true) => {
            (Elem::Vec2U32, "distance of the nearest triangle and its level, as the bits of f32; 0 is none")
        }
        (Some(_), _) => {
            (Elem::Vec2U32, "distance of the nearest triangle and its error, as the bits of f32; 0 is none")
        }
    };
    let drawn = chain.make_target("drawn", elem, meaning);
    let distance = make_distance(chain);
    let (columns, rows) = chain.data.scene.viewport;
    let meaning = "normalised error of what is drawn; 0 is within the threshold";
    let error = grid.promise.map(|_| chain.make_over("error", Elem::F32, Spread::Pixels, "", meaning));
    let meaning = "pyramid level of the mesh, or minus its split octave; 0 where nothing is drawn";
    let level = carries_level.then(|| chain.make_over("mesh_level", Elem::F32, Spread::Pixels, "", meaning));
    let carried = error.or(level);
    let (fragment, resolve) = if carried.is_some() { ("keep_carried", "resolve_carried") } else { ("keep", "resolve") };
    let draw = grid_step(chain, &grid, size, "draw", "draw", tiles)?;
    draw.bind("vertex", grid.vertex).bind_or_leave("cell_bound", grid.cell_bound).draw_strip(strip, drawn, fragment)?;
    let resolve = grid_step(chain, &grid, size, "resolve", resolve, tiles)?;
    let resolve = resolve.bind("drawn", drawn).bind("distance", distance);
    let resolve = match carried {
        None => resolve,
        Some(carried) => resolve.bind("carried", carried).bind_or_leave("clear_until", tiles),
    };
    resolve.over(UVec2::new(columns, rows))?;
    if let Some(level) = level {
        chain.offer(MeshLevel { level, distance });
    }
    Ok(Drawn { distance, error, mesh: Some(Mesh::Grid(grid)), promise: grid.promise })
}

/// A row of the strip has two vertices a column, and two that lead to the next row.
fn strip(chain: &Chain, size: UVec2) -> Result<Vertices, Diagnostic> {
    let vertices = (2 * u64::from(size.x) + 2) * u64::from(size.y - 1);
    let triangles = 2 * u64::from(size.x - 1) * u64::from(size.y - 1);
    match (u32::try_from(vertices), u32::try_from(triangles)) {
        (Ok(vertices), Ok(triangles)) => Ok(Vertices::Strip { vertices, triangles }),
        _ => {
            Err(Diagnostic::input(format!("a mesh of {} x {} vertices has too many triangles to draw", size.x, size.y))
                .at(chain.origin(), "this stage"))
        }
    }
}

fn grid_step<'c, 'a>(
    chain: &'c mut Chain<'a>,
    grid: &Grid<BufferId>,
    size: UVec2,
    label: &str,
    entry: &str,
    tiles: Option<BufferId>,
) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
    let sees_underside = chain.sees_underside();
    let threshold_px = grid.promise.map_or(0.0, |promise| promise.told_px(chain.data));
    let kernel = chain.kernel("picture/rasterize_grid.wgsl")?;
    Ok(chain
        .step(label, &kernel, entry)
        .constant("PROVEN", f64::from(grid.promise.is_some_and(|promise| promise.proven)))
        .constant("LED", f64::from(tiles.is_some()))
        .constant("DISCARD", f64::from(sees_underside))
        .set("grid", size.to_array())
        .set("threshold_px", threshold_px as f32)
        .set("snap_px", PROOF_SNAP_PX))
}
