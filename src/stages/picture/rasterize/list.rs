//! A list of triangles between samples, as many as the GPU has counted.

use glam::UVec2;

use super::step;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::scene::Surface;
use crate::kernel::Elem;
use crate::plan::product::{Drawn, List, Mesh};
use crate::plan::{BufferId, Chain, StepBuilder};
use crate::stages::shared::drawn::make_distance;
use crate::stages::shared::pyramid::bounds_layout;
use crate::stages::shared::traversal::Traversed;

/// Nothing nearer than this is drawn, in metres along the view direction: an eye can stand on a mesh of samples.
pub(super) const NEAR_M: f32 = 1e-4;

pub(super) fn plan(chain: &mut Chain, list: List<BufferId>) -> Result<Drawn<BufferId>, Diagnostic> {
    let size = chain.data.terrain.size;
    let height = chain.read_as("height", Elem::F32, &[size.y, size.x])?;
    for id in [list.triangle, list.count] {
        chain.check_own(id)?;
    }
    chain.check_kind(list.count, Elem::U32, &[4])?;
    let meaning = "distance of the nearest triangle as the bits of an f32, negative beside it; 0 is none";
    let drawn = chain.make_target("drawn", Elem::U32, meaning);
    let distance = make_distance(chain);
    let is_proven = list.promise.is_some_and(|promise| promise.proven);
    let traversed = if is_proven { Some(Traversed::read(chain)?) } else { None };
    let draw = list_step(chain, "draw", is_proven)?;
    draw.bind("triangle", list.triangle).bind("samples", height).draw_list(list.count, drawn, "keep")?;
    let (columns, rows) = chain.data.scene.viewport;
    let resolve =
        list_step(chain, "resolve", is_proven)?.bind("height", height).bind("drawn", drawn).bind("distance", distance);
    let resolve = match traversed {
        Some(known) => resolve.bind("height_max", known.highest).bind("height_min", known.lowest),
        None => resolve.leave_unbound("height_max").leave_unbound("height_min"),
    };
    resolve.over(UVec2::new(columns, rows))?;
    Ok(Drawn { distance, error: None, mesh: Some(Mesh::List(list)), promise: list.promise })
}

fn list_step<'c, 'a>(
    chain: &'c mut Chain<'a>,
    entry: &str,
    is_proven: bool,
) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
    let layout = bounds_layout(chain.data.terrain.size);
    let is_bilinear = f64::from(chain.data.scene.surface == Surface::Bilinear);
    let sees_underside = f64::from(chain.data.sees_underside);
    Ok(step(chain, entry, "picture/rasterize_list.wgsl", entry, NEAR_M)?
        .constant("PROVEN", f64::from(is_proven))
        .constant("BILINEAR", is_bilinear)
        .constant("UNDERSIDE", sees_underside)
        .set("stride", layout.stride)
        .set("tall_pow2", layout.tall_pow2)
        .set("top", layout.top))
}
