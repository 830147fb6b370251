//! The paper's rule: an estimate at each grid point.

use super::Inputs;
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::Elem;
use crate::plan::product::{Grid, Mesh, PointErrors, Promise};
use crate::plan::{Chain, Spread};

pub fn plan(chain: &mut Chain, inputs: Inputs, threshold_px: f64) -> Result<(), Diagnostic> {
    let dims = [inputs.size.y, inputs.size.x];
    let meaning = "x east, y north, z up from the eye; w: normalised error";
    let moved = chain.make("vertex", Elem::Vec4F32, &dims, "m", meaning);
    let errors = chain.make("grid_error", Elem::F32, &dims, "", "normalised error of each grid point (Eq. 4)");
    [moved, errors].into_iter().for_each(|id| chain.set_spread(id, Spread::GridPoints));
    let scene = &chain.data.scene;
    let lambda = f64::from(scene.viewport.1) / scene.fov_deg.to_radians();
    inputs
        .step(chain, "grids/grid_error_paper.wgsl", "paper")?
        .set("threshold_px", threshold_px as f32)
        .set("lambda", lambda as f32)
        .bind("moved", moved)
        .bind_if_wanted("grid_error", errors, "WRITE_ERROR")
        .over(inputs.size)?;
    let promise = Some(Promise { bound_px: threshold_px, proven: false });
    chain.offer(Mesh::Grid(Grid { vertex: moved, cell_bound: None, promise }));
    chain.offer(PointErrors { errors });
    Ok(())
}
