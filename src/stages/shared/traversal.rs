//! What every stage that casts rays through the maximum pyramid needs (`kernels/lib/traverse.wgsl`).

use std::sync::Arc;

use glam::UVec2;

use super::octaves;
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Kernel};
use crate::plan::product::NodeRanges;
use crate::plan::{BufferId, Chain, Spread, StepBuilder};

/// Pixels a side of the tiles whose rays are led to the surface together; `TILE` of the kernel.
pub const TILE: u32 = 8;

/// An adapter may end the loops of a thread after so many turns in all, in silence.
pub const MOST_TURNS: u32 = 65_535;

/// The most turns that the loops of one ray take over a terrain of that many samples. Each node that it goes through is left across a
/// column or row of samples that it crosses once (but for rounding), and a node is opened only after a border of two nodes was crossed, which
/// every other one is; on top of that there are the cells next to the eye.
pub fn most_turns(size: UVec2) -> u32 {
    let lines = size.x.saturating_add(size.y);
    lines.saturating_add(lines / 2).saturating_add(lines / 64 + 64)
}

/// Says what a traversal leaves out, and refuses a chain without the pyramids that it needs.
pub fn check(chain: &mut Chain) -> Result<(), Diagnostic> {
    chain.latest::<NodeRanges<BufferId>>()?;
    if !chain.sees_underside() {
        chain.leave_out("the way under the surface", "no camera is under it or outside the terrain", 0, 0);
    }
    octaves::note(chain);
    if !has_foreground(chain) {
        let reason = match chain.is_scene_ground() {
            true => "no camera is so close to it that they would move a hit by a 500th of a pixel",
            false => "they are those of the scene's ground, and a kernel has made another one",
        };
        chain.leave_out("the formulas of the cells next to the eye", reason, 0, 0);
    }
    Ok(())
}

/// Rays need the formulas of the cells next to the eye, and they are known: a kernel that makes another ground makes it on the device.
fn has_foreground(chain: &Chain) -> bool {
    chain.is_scene_ground() && chain.data.has_foreground
}

/// A step whose kernel casts rays.
pub fn step<'c, 'a>(chain: &'c mut Chain<'a>, label: &str, kernel: &Arc<Kernel>, entry: &str) -> StepBuilder<'c, 'a> {
    let underside = chain.sees_underside();
    let has_foreground = has_foreground(chain);
    let step = chain.step(label, kernel, entry).constant("UNDERSIDE", f64::from(underside));
    let step = step.constant("HAS_FOREGROUND", f64::from(has_foreground));
    if underside { step } else { step.leave_unbound("ground_min") }
}

fn tiles(chain: &Chain) -> UVec2 {
    let (width_px, height_px) = chain.data.scene.viewport;
    UVec2::new(width_px.div_ceil(TILE), height_px.div_ceil(TILE))
}

/// What `LeadRays` has found out.
pub fn known_tiles(chain: &Chain) -> Result<BufferId, Diagnostic> {
    let tiles = tiles(chain);
    chain.read_of_ground("clear_until", Elem::F32, &[tiles.y, tiles.x])
}

/// For each tile of pixels, how far its rays can be led at once. A bundle that may start under the surface is not led past anything: there
/// is nothing to know then.
pub fn lead_tiles(chain: &mut Chain) -> Result<Option<BufferId>, Diagnostic> {
    if chain.sees_underside() {
        return Ok(None);
    }
    if chain.find("clear_until").is_some() {
        return known_tiles(chain).map(Some);
    }
    let tiles = tiles(chain);
    let start =
        chain.make("clear_until", Elem::F32, &[tiles.y, tiles.x], "", "a t all rays of a tile reach without a hit");
    chain.set_spread(start, Spread::Tiles(TILE));
    let kernel = chain.kernel("rays/ray_cast.wgsl")?;
    step(chain, "coarse", &kernel, "coarse").bind("clear_until", start).over(tiles)?;
    Ok(Some(start))
}
