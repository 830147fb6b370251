//! What every stage that casts rays through the maximum pyramid needs (`kernels/lib/traverse.wgsl`).

use std::sync::Arc;

use glam::UVec2;

use super::pyramid::bounds_layout;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::scene::Surface;
use crate::kernel::{Elem, Kernel};
use crate::plan::{BufferId, Chain, StepBuilder};

/// Pixels a side of the tiles whose rays are led to the surface together; `TILE` of the kernel.
pub const TILE: u32 = 8;

/// What the traversal of `kernels/lib/traverse.wgsl` needs.
pub struct Traversed {
    pub height: BufferId,
    pub highest: BufferId,
    pub lowest: BufferId,
}

impl Traversed {
    pub fn read(chain: &mut Chain) -> Result<Self, Diagnostic> {
        let layout = bounds_layout(chain.data.terrain.size);
        let height = chain.read("height")?;
        let highest = chain.read_as("height_max", Elem::F32, &layout.dims())?;
        if chain.data.sees_underside {
            let lowest = chain.read_as("height_min", Elem::F32, &layout.dims())?;
            return Ok(Self { height, highest, lowest });
        }
        chain.leave_out("the way under the surface", "no camera is under it or outside the terrain", 0, 0);
        Ok(Self { height, highest, lowest: highest })
    }

    /// A step with what every traversal is told.
    pub fn step<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        label: &str,
        kernel: &Arc<Kernel>,
        entry: &str,
    ) -> StepBuilder<'c, 'a> {
        let layout = bounds_layout(chain.data.terrain.size);
        let bilinear = chain.data.scene.surface == Surface::Bilinear;
        let underside = chain.data.sees_underside;
        chain
            .step(label, kernel, entry)
            .bind("height_max", self.highest)
            .constant("BILINEAR", f64::from(bilinear))
            .constant("UNDERSIDE", f64::from(underside))
            .set_camera()
            .set_terrain()
            .set("stride", layout.stride)
            .set("tall_pow2", layout.tall_pow2)
            .set("top", layout.top)
    }

    fn tiles(chain: &Chain) -> UVec2 {
        let (width_px, height_px) = chain.data.scene.viewport;
        UVec2::new(width_px.div_ceil(TILE), height_px.div_ceil(TILE))
    }

    /// What `LeadRays` has found out.
    pub fn known_tiles(chain: &Chain) -> Result<BufferId, Diagnostic> {
        let tiles = Self::tiles(chain);
        chain.read_as("clear_until", Elem::F32, &[tiles.y, tiles.x])
    }

    /// For each tile of pixels, how far its rays can be led at once. A bundle that may start under the surface is not led past
    /// anything; some buffer has to be bound all the same.
    pub fn lead_tiles(&self, chain: &mut Chain) -> Result<BufferId, Diagnostic> {
        if chain.data.sees_underside {
            return Ok(self.highest);
        }
        if chain.find("clear_until").is_some() {
            return Self::known_tiles(chain);
        }
        let tiles = Self::tiles(chain);
        let start =
            chain.make("clear_until", Elem::F32, &[tiles.y, tiles.x], "", "a t all rays of a tile reach without a hit");
        let kernel = Kernel::built_in("rays/ray_cast.wgsl")?;
        let step = self.step(chain, "coarse", &kernel, "coarse");
        step.bind("height_min", self.lowest).bind("clear_until", start).over(tiles)?;
        Ok(start)
    }
}
