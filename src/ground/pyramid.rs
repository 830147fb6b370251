//! Where the nodes of a pyramid are in its buffer.

use glam::UVec2;

/// Where the levels of a pyramid are; the layout of `kernels/lib/pyramid.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layout {
    pub base: UVec2,
    /// Row stride: the width of level 1.
    pub stride: u32,
    /// The power of two not below the height of the base.
    pub tall_pow2: u32,
    /// The coarsest level, the first with a single node.
    pub top: u32,
}

impl Layout {
    pub fn new(base: UVec2) -> Self {
        let base = base.max(UVec2::ONE);
        let top = base.max_element().next_power_of_two().trailing_zeros().max(1);
        Self { base, stride: base.x.div_ceil(2), tall_pow2: base.y.next_power_of_two(), top }
    }

    /// Nodes of a level.
    pub fn size(&self, level: u32) -> UVec2 {
        UVec2::new(self.base.x.div_ceil(1 << level), self.base.y.div_ceil(1 << level))
    }

    pub fn index(&self, level: u32, x: u32, y: u32) -> usize {
        ((self.tall_pow2 - (self.tall_pow2 >> (level - 1)) + level - 1 + y) * self.stride + x) as usize
    }

    /// Rows and columns of the buffer.
    pub fn dims(&self) -> [u32; 2] {
        let last = self.index(self.top, 0, 0) as u32 / self.stride;
        [last + self.size(self.top).y, self.stride]
    }
}
