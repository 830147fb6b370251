//! A list of triangles between samples, as many as the GPU has counted.

use glam::UVec2;

use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::Elem;
use crate::plan::product::{Drawn, List, Mesh};
use crate::plan::{BufferId, Chain};
use crate::stages::shared::drawn::make_distance;
use crate::stages::shared::traversal;

/// Nothing nearer than this is drawn, in metres along the view direction: an eye can stand on a mesh of samples.
pub(super) const NEAR_M: f32 = 1e-4;

pub(super) fn plan(chain: &mut Chain, list: List<BufferId>) -> Result<Drawn<BufferId>, Diagnostic> {
    for id in [list.triangle, list.count] {
        chain.check_own(id)?;
    }
    chain.check_kind(list.count, Elem::U32, &[4])?;
    let meaning = "distance of the nearest triangle as the bits of an f32, negative beside it; 0 is none";
    let drawn = chain.make_target("drawn", Elem::U32, meaning);
    let distance = make_distance(chain);
    let is_proven = list.promise.is_some_and(|promise| promise.proven);
    if is_proven {
        traversal::check(chain)?;
    }
    let kernel = chain.kernel("picture/rasterize_list.wgsl")?;
    let draw = chain.step("draw", &kernel, "draw").constant("PROVEN", f64::from(is_proven));
    draw.set("near_m", NEAR_M).bind("triangle", list.triangle).draw_list(list.count, drawn, "keep")?;
    let (columns, rows) = chain.data.scene.viewport;
    let kernel = chain.kernel("picture/rasterize_list_resolve.wgsl")?;
    let resolve = traversal::step(chain, "resolve", &kernel, "resolve")
        .constant("PROVEN", f64::from(is_proven))
        .bind("drawn", drawn)
        .bind("distance", distance);
    // without a bound, no ray is cast
    let resolve = if is_proven { resolve } else { resolve.leave_unbound("ground_max").leave_unbound("ground_min") };
    resolve.over(UVec2::new(columns, rows))?;
    Ok(Drawn { distance, error: None, mesh: Some(Mesh::List(list)), promise: list.promise })
}
