//! The square of ground that a sketch map is of (`kernels/lib/sketch.wgsl`).

use glam::{DVec2, I64Vec2, IVec2};

use crate::experiment::diagnostic::Diagnostic;
use crate::ground::Lattice;
use crate::kernel::Elem;
use crate::plan::{BufferId, Chain};
use crate::reference::Values;
use crate::stages::shared::rounding::EPSILON;

/// Texels along a side of a sketch map, of which a stage needs heights and square.
pub fn texels_of(chain: &Chain, heights: BufferId, square: BufferId) -> Result<u32, Diagnostic> {
    chain.check_own(square)?;
    chain.check_kind(square, Elem::I32, &[4])?;
    let texels = chain.buffer(heights).dims.first().copied().unwrap_or_default();
    chain.check_kind(heights, Elem::F32, &[texels; 2])?;
    Ok(texels)
}

/// Where the texels of a sketch map are among the terrain's samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Square {
    /// The north-west sample; it may be beyond the border.
    pub first: IVec2,
    /// Samples along a side.
    pub side: i32,
    /// Level of the mean pyramid whose nodes the texels are, or are becoming.
    pub level: u32,
    /// Texels along a side.
    pub texels: u32,
}

impl Square {
    /// As a sketch map leaves it.
    pub fn of(square: &Values, texels: u32) -> Self {
        let [column, row, side, level] = [0, 1, 2, 3].map(|at| square.value[at] as i32);
        Self { first: IVec2::new(column, row), side, level: level as u32, texels }
    }

    pub fn values(&self) -> Values {
        let numbers = [self.first.x, self.first.y, self.side, self.level as i32];
        Values::exact(&[4], 1, numbers.map(f64::from).to_vec())
    }

    /// Texels are whole nodes.
    pub fn is_of_nodes(&self) -> bool {
        i64::from(self.side) == i64::from(self.texels) << self.level
    }

    /// Samples along a side of a texel.
    pub fn texel_samples(&self) -> f64 {
        f64::from(self.side) / f64::from(self.texels)
    }

    /// The level of the pyramid that texels are as large as the nodes of, and its bound.
    pub fn texel_level(&self) -> (f64, f64) {
        let level = self.texel_samples().log2();
        // as Vulkan allows log2, and a division
        (level, if self.is_of_nodes() { 0.0 } else { 1e-6 + 8.0 * EPSILON * level.abs() })
    }

    /// Sample coordinates of the middle of a texel.
    pub fn middle(&self, texel: IVec2) -> DVec2 {
        self.first.as_dvec2() + (texel.as_dvec2() + 0.5) * self.texel_samples() - 0.5
    }

    /// The sample that a texel begins in.
    fn first_of(&self, texel: IVec2) -> I64Vec2 {
        self.first.as_i64vec2() + texel.as_i64vec2() * i64::from(self.side) / i64::from(self.texels)
    }

    /// The sample around the middle of one of `parts` x `parts` equal parts of a texel.
    pub fn sample(&self, texel: IVec2, part: IVec2, parts: i32) -> IVec2 {
        let along = 2 * i64::from(parts) * texel.as_i64vec2() + (2 * part + 1).as_i64vec2();
        let within = along * i64::from(self.side) / (2 * i64::from(parts) * i64::from(self.texels));
        self.first + within.as_ivec2()
    }

    /// A texel begins on the terrain.
    pub fn is_terrain(&self, texel: IVec2, lattice: Lattice) -> bool {
        let first = self.first_of(texel);
        first.cmpge(I64Vec2::ZERO).all() && first.cmplt(lattice.size.as_i64vec2()).all()
    }

    /// The first and the last texel that begin on the terrain, by columns and by rows.
    pub fn terrain(&self, lattice: Lattice) -> (IVec2, IVec2) {
        let is_in = |texel: i32| {
            let first = self.first_of(IVec2::splat(texel));
            (first.cmpge(I64Vec2::ZERO), first.cmplt(lattice.size.as_i64vec2()))
        };
        let (mut first, mut last) = (IVec2::ZERO, IVec2::splat(-1));
        for texel in 0..self.texels as i32 {
            let (begun, not_over) = is_in(texel);
            first += IVec2::select(begun, IVec2::ZERO, IVec2::ONE);
            last += IVec2::select(not_over, IVec2::ONE, IVec2::ZERO);
        }
        (first, last)
    }
}
