//! What the elements of a buffer are of, and what is in one: all that somebody needs to know who looks at it.

use glam::UVec2;

use super::{BufferId, Chain};
use crate::ground::pyramid::Layout;
use crate::kernel::Elem;

/// What the elements of a buffer are spread over.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Spread {
    /// Over nothing: a list, a count, sums.
    #[default]
    Numbers,
    /// The picture's pixels; row 0 is the top.
    Pixels,
    /// Square tiles of so many pixels a side.
    Tiles(u32),
    /// The ground's samples; row 0 is north.
    Samples,
    /// The nodes of a pyramid over the ground, level by level in one buffer.
    Nodes(Layout),
    /// The points of the grid that is drawn; row 0 is the farthest.
    GridPoints,
    /// The cells between those points.
    GridCells,
    /// Equal parts of the unit square in which the points of a grid have their places: the projector's image, or the square of a sketch map.
    UnitSquare,
    /// The corners of such parts.
    UnitSquareCorners,
    /// Rows of numbers; what each is of, the meaning says.
    Rows,
}

/// A number in an element that has several in its bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    pub name: &'static str,
    /// Which u32 of the element, the lowest of its bits, and how many.
    pub word: usize,
    pub shift: u32,
    pub bits: u32,
}

impl Part {
    pub const fn new(name: &'static str, word: usize, shift: u32, bits: u32) -> Self {
        Self { name, word, shift, bits }
    }

    /// The number in the words of one element.
    pub fn of(&self, words: &[u32]) -> u32 {
        let word = words.get(self.word).copied().unwrap_or_default() >> self.shift;
        if self.bits >= 32 { word } else { word & ((1 << self.bits) - 1) }
    }
}

/// A level of a pyramid in its buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Level {
    pub level: u32,
    /// The row of the buffer that its first row is.
    pub row: u32,
    pub columns: u32,
    pub rows: u32,
    /// Samples (or cells) of the ground along a side of a node.
    pub side: u32,
}

impl Spread {
    /// The levels of a pyramid, finest first, up to the coarsest that is made.
    pub fn levels(&self, top: Option<u32>) -> Vec<Level> {
        let Spread::Nodes(layout) = self else { return Vec::new() };
        let level = |level: u32| {
            let UVec2 { x: columns, y: rows } = layout.size(level);
            let row = layout.index(level, 0, 0) as u32 / layout.stride;
            Level { level, row, columns, rows, side: 1 << level }
        };
        (1..=top.unwrap_or(layout.top).min(layout.top)).map(level).collect()
    }
}

impl Chain<'_> {
    /// Makes a buffer with an element for each pixel, sample or node.
    pub fn make_over(&mut self, name: &str, elem: Elem, spread: Spread, unit: &'static str, meaning: &str) -> BufferId {
        let size = |size: UVec2| vec![size.y, size.x];
        let dims = match spread {
            Spread::Pixels => size(UVec2::from(self.data.scene.viewport)),
            Spread::Nodes(layout) => layout.dims().to_vec(),
            _ => size(self.lattice().size),
        };
        let id = self.make(name, elem, &dims, unit, meaning);
        self.set_spread(id, spread);
        id
    }

    /// Says what a buffer is spread over, whose size does not follow from the scene.
    pub fn set_spread(&mut self, buffer: BufferId, spread: Spread) {
        self.buffers[buffer.0].spread = spread;
    }

    /// Says which numbers are in the bits of each element.
    pub fn set_parts(&mut self, buffer: BufferId, parts: &'static [Part]) {
        self.buffers[buffer.0].parts = parts;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_lie_where_the_layout_says() {
        let layout = Layout::new(UVec2::new(5, 3));
        let levels = Spread::Nodes(layout).levels(None);
        assert_eq!(
            levels.iter().map(|level| (level.columns, level.rows)).collect::<Vec<_>>(),
            [(3, 2), (2, 1), (1, 1)]
        );
        for level in &levels {
            assert_eq!(layout.index(level.level, 0, 0) as u32, level.row * layout.stride);
        }
        assert_eq!(Spread::Nodes(layout).levels(Some(1)).len(), 1);
        assert!(Spread::Samples.levels(None).is_empty());
    }

    #[test]
    fn parts_are_cut_out_of_their_word() {
        let words = [0xabcd_1234, 0x0000_0017];
        assert_eq!(Part::new("row", 0, 16, 16).of(&words), 0xabcd);
        assert_eq!(Part::new("level", 1, 1, 4).of(&words), 0xb);
        assert_eq!(Part::new("all", 0, 0, 32).of(&words), 0xabcd_1234);
        assert_eq!(Part::new("absent", 2, 0, 8).of(&words), 0);
    }
}
