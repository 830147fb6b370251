//! The proven rule: a bound over each cell, and the grid raised until it is nowhere under the surface (docs/proven_bound.md).

use super::Inputs;
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::Elem;
use crate::plan::product::{Grid, Mesh, Promise};
use crate::plan::{Chain, Spread};
use crate::stages::shared::rounding::PROOF_SNAP_PX;

const KERNEL: &str = "grids/grid_error_proven.wgsl";

pub fn plan(chain: &mut Chain, inputs: Inputs, threshold_px: f64) -> Result<(), Diagnostic> {
    chain.check_scene_ground()?;
    chain.check_bound(threshold_px)?;
    let layout = chain.lattice().cells();
    let planes = chain.read_of_ground("height_plane", Elem::Vec2F32, &layout.dims())?;
    let slopes = chain.read_of_ground("plane_slope", Elem::U32, &layout.dims())?;
    let cells = [inputs.size.y - 1, inputs.size.x - 1];
    let meaning = "lowest and highest of surface minus plane, for both triangles of each cell";
    let bounds = chain.make("cell_bound", Elem::Vec4F32, &cells, "m", meaning);
    let raises = chain.make("cell_raise", Elem::F32, &cells, "m", "how far a cell's corners have to rise");
    [bounds, raises].into_iter().for_each(|id| chain.set_spread(id, Spread::GridCells));
    inputs
        .step(chain, KERNEL, "bound")?
        .set("snap_px", PROOF_SNAP_PX)
        .bind("height_plane", planes)
        .bind("plane_slope", slopes)
        .bind("cell_bound", bounds)
        .bind("cell_raise", raises)
        .over(inputs.size - 1)?;
    let meaning = "x east, y north, z up from the eye; w: metres it was raised";
    let moved = chain.make("vertex", Elem::Vec4F32, &[inputs.size.y, inputs.size.x], "m", meaning);
    chain.set_spread(moved, Spread::GridPoints);
    inputs
        .step(chain, KERNEL, "raise")?
        .set("snap_px", PROOF_SNAP_PX)
        .bind("raises", raises)
        .bind("moved", moved)
        .over(inputs.size)?;
    let promise = Some(Promise { bound_px: threshold_px, proven: true });
    chain.offer(Mesh::Grid(Grid { vertex: moved, cell_bound: Some(bounds), promise }));
    Ok(())
}
