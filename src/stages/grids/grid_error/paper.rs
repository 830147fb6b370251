//! The paper's rule: an estimate at each grid point.

use super::Inputs;
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::Elem;
use crate::plan::product::{Grid, Mesh, PointErrors, Promise};
use crate::plan::{Chain, Spread};

pub fn plan(chain: &mut Chain, inputs: Inputs, threshold_px: f64, is_raised: bool) -> Result<(), Diagnostic> {
    let dims = [inputs.size.y, inputs.size.x];
    let meaning = "x east, y north, z up from the eye; w: normalised error";
    let moved = is_raised.then(|| chain.make("vertex", Elem::Vec4F32, &dims, "m", meaning));
    let errors = chain.make("grid_error", Elem::F32, &dims, "", "normalised error of each grid point (Eq. 4)");
    moved.into_iter().chain([errors]).for_each(|id| chain.set_spread(id, Spread::GridPoints));
    let scene = &chain.data.scene;
    let lambda = f64::from(scene.viewport.1) / scene.fov_deg.to_radians();
    inputs
        .step(chain, "grids/grid_error_paper.wgsl", "paper")?
        .set("threshold_px", threshold_px as f32)
        .set("lambda", lambda as f32)
        .constant("RAISED", f64::from(is_raised))
        .bind_or_leave("moved", moved)
        .bind_if_wanted("grid_error", errors, "WRITE_ERROR")
        .over(inputs.size)?;
    if let Some(vertex) = moved {
        let promise = Some(Promise { bound_px: threshold_px, proven: false });
        chain.offer(Mesh::Grid(Grid { vertex, cell_bound: None, promise }));
    }
    chain.offer(PointErrors { errors });
    Ok(())
}
