//! What stages hand on to each other and to the measures, by type instead of by a buffer's name.
//!
//! A plan and the f64 reference have the same products. They differ in what stands for a buffer: `B` is a
//! [`BufferId`](super::BufferId) in the one and a [`ValuesId`](crate::reference::ValuesId) in the other.

use serde::{Deserialize, Serialize};

use crate::scene::SceneData;

/// What a method says of its picture: nothing that the mesh shows, or fails to show, is further off than this.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Promise {
    pub bound_px: f64,
    /// The bound follows from an argument (`docs/proven_*.md`); otherwise it rests on estimates.
    pub proven: bool,
}

impl Promise {
    /// What kernels are told to keep to, so that the bound holds with what rounding moves; up to `ROUNDING_PX` of that they have room for.
    pub fn told_px(&self, data: &SceneData) -> f64 {
        match self.proven {
            true => self.bound_px - (data.rounding_px() - ROUNDING_PX).max(0.0),
            false => self.bound_px,
        }
    }
}

/// What kernels keep of a bound for rounding, in pixels; of a small bound, half.
const ROUNDING_PX: f64 = 0.02;

/// Triangles that approximate the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mesh<B> {
    Grid(Grid<B>),
    List(List<B>),
}

/// Two triangles for each cell of a grid of vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid<B> {
    /// `[rows, columns]`: x, y, z in metres from the eye. With a promise, w is the normalised error of an estimate, or the metres by
    /// which a proven grid was raised; without one, w is the pyramid level.
    pub vertex: B,
    /// Of a proven grid, `[rows - 1, columns - 1]`: lowest and highest of surface minus plane, for both triangles of each cell.
    pub cell_bound: Option<B>,
    pub promise: Option<Promise>,
}

/// A list of triangles between height samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct List<B> {
    /// Three packed samples a triangle, and its level.
    pub triangle: B,
    /// Vertices, instances, first vertex, first instance: what an indirect draw reads.
    pub count: B,
    pub promise: Option<Promise>,
}

impl<B> Mesh<B> {
    pub fn promise(&self) -> Option<Promise> {
        match self {
            Mesh::Grid(grid) => grid.promise,
            Mesh::List(list) => list.promise,
        }
    }
}

/// The surface as the pixels show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn<B> {
    /// Metres along each pixel's ray, negative where there is no surface.
    pub distance: B,
    /// Normalised error of each pixel; above 0, the pixel is over its bound.
    pub error: Option<B>,
    /// What was rasterized; `None` for rays.
    pub mesh: Option<Mesh<B>>,
    pub promise: Option<Promise>,
}

/// Which octaves the mesh holds at each pixel of what was drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshLevel<B> {
    /// The pyramid level of the mesh, or, where it holds octaves, its split octave with a minus.
    pub level: B,
    /// What was drawn.
    pub distance: B,
}

/// A shaded picture, red in the lowest byte of each pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picture<B> {
    pub pixels: B,
}

/// Numbers of the elements of a buffer that are above a value, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Listing<B> {
    pub numbers: B,
    /// Workgroups along x, y, z that visit the list; how many numbers there are.
    pub count: B,
    /// The buffer whose elements are listed.
    pub of: B,
    pub above: f64,
    /// So many rows of the buffer make one element, which has the number of the first.
    pub rows: u32,
}

/// Blocks of the quadtree that are fine enough for the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocks<B> {
    /// Packed centre and level of each block.
    pub leaf: B,
    /// Workgroups along x, y, z; how many blocks there are.
    pub count: B,
    /// A bit for each block of the quadtree: it is split.
    pub split: B,
    pub promise: Promise,
}

/// Lowest and highest of the surface over each node of the pyramid over cells, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeRanges<B> {
    pub lowest: B,
    pub highest: B,
}

/// How far the surface is from each block of the quadtree, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roughness<B> {
    pub roughness: B,
    /// No sample is farther away; otherwise it is an estimate.
    pub is_bound: bool,
}

/// The normalised error of each point of a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointErrors<B> {
    pub errors: B,
}

/// How densely grid points are asked for in the square of a sketch map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted<B> {
    /// Grid points a metre, for each texel.
    pub importance: B,
    /// Where the square is.
    pub square: B,
}

/// How densely the points of a grid were asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand<B> {
    /// Grid points a metre, over equal parts of the unit square.
    pub importance: B,
    /// Where the grid's points are in that square.
    pub places: B,
    /// Where they are from the eye, in metres.
    pub vertex: B,
    /// Where the square is among the terrain's samples.
    pub square: B,
}

/// What has become of a warp that would have folded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Warped<B> {
    /// How often each corner of its map gave way.
    pub gave_way: B,
    /// The fourth number is how much of the warp is left, as the bits of an f32.
    pub share: B,
}

/// Everything that was offered so far, in order.
#[derive(Clone, Debug)]
pub struct Products<B> {
    meshes: Vec<Mesh<B>>,
    drawn: Vec<Drawn<B>>,
    mesh_levels: Vec<MeshLevel<B>>,
    pictures: Vec<Picture<B>>,
    listings: Vec<Listing<B>>,
    blocks: Vec<Blocks<B>>,
    node_ranges: Vec<NodeRanges<B>>,
    roughness: Vec<Roughness<B>>,
    point_errors: Vec<PointErrors<B>>,
    demands: Vec<Demand<B>>,
    warped: Vec<Warped<B>>,
    wanted: Vec<Wanted<B>>,
}

impl<B> Default for Products<B> {
    fn default() -> Self {
        Self {
            meshes: Vec::new(),
            drawn: Vec::new(),
            pictures: Vec::new(),
            mesh_levels: Vec::new(),
            listings: Vec::new(),
            blocks: Vec::new(),
            node_ranges: Vec::new(),
            roughness: Vec::new(),
            point_errors: Vec::new(),
            demands: Vec::new(),
            warped: Vec::new(),
            wanted: Vec::new(),
        }
    }
}

/// A type that stages hand on.
pub trait Product<B>: Copy {
    /// What messages and the registry call it.
    const WHAT: &'static str;
    fn all(products: &Products<B>) -> &Vec<Self>;
    fn all_mut(products: &mut Products<B>) -> &mut Vec<Self>;
}

macro_rules! product {
    ($kind:ident, $field:ident, $what:literal) => {
        impl<B: Copy> Product<B> for $kind<B> {
            const WHAT: &'static str = $what;
            fn all(products: &Products<B>) -> &Vec<Self> {
                &products.$field
            }
            fn all_mut(products: &mut Products<B>) -> &mut Vec<Self> {
                &mut products.$field
            }
        }
    };
}
product!(Mesh, meshes, "a mesh");
product!(Drawn, drawn, "something drawn");
product!(Picture, pictures, "a picture");
product!(MeshLevel, mesh_levels, "the level of a mesh at each pixel");
product!(Listing, listings, "a list of numbers");
product!(Blocks, blocks, "blocks of a quadtree");
product!(NodeRanges, node_ranges, "the lowest and highest of each node");
product!(Roughness, roughness, "the roughness of blocks");
product!(PointErrors, point_errors, "errors of grid points");
product!(Demand, demands, "a density that was asked for");
product!(Warped, warped, "a warp");
product!(Wanted, wanted, "an importance of a sketch map");

/// What messages and the registry call a product.
pub const fn what<P: Product<()>>() -> &'static str {
    P::WHAT
}

impl<B: Copy> Products<B> {
    pub fn offer<P: Product<B>>(&mut self, product: P) {
        P::all_mut(self).push(product);
    }

    pub fn latest<P: Product<B>>(&self) -> Option<P> {
        P::all(self).last().copied()
    }

    /// The latest one that fits.
    pub fn find<P: Product<B>>(&self, fits: impl Fn(&P) -> bool) -> Option<P> {
        P::all(self).iter().rfind(|product| fits(product)).copied()
    }
}

/// Where the GPU says how long a list is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Length<B> {
    pub count: B,
    /// Which u32 of the count.
    pub at: usize,
    /// What is counted, for one element of the list.
    pub per_element: u32,
}

impl<B: Copy + PartialEq> Products<B> {
    /// The length of a buffer that is a list.
    pub fn length_of(&self, buffer: B) -> Option<Length<B>> {
        let triangles = self.meshes.iter().filter_map(|mesh| match mesh {
            Mesh::List(list) => Some((list.triangle, Length { count: list.count, at: 0, per_element: 3 })),
            Mesh::Grid(_) => None,
        });
        let numbers = self.listings.iter().map(|l| (l.numbers, Length { count: l.count, at: 3, per_element: 1 }));
        let leaves = self.blocks.iter().map(|b| (b.leaf, Length { count: b.count, at: 3, per_element: 1 }));
        triangles.chain(numbers).chain(leaves).find(|(list, _)| *list == buffer).map(|(_, length)| length)
    }
}
