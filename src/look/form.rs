//! The ways in which a buffer can be seen. They follow from what it is spread over and from the products that it is part of, so that a new
//! stage has them without a line here.

use serde::{Deserialize, Serialize};

use crate::kernel::{Elem, Packing};
use crate::plan::product::{Blocks, Mesh, Picture, Product, Products};
use crate::plan::{Buffer, BufferId, Chain, Plan, Spread, Work};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Form {
    /// A colour for each element, row by row.
    Image,
    /// The same of one level of a pyramid.
    Levels,
    /// Values over their numbers.
    Plot,
    /// Values as text.
    Table,
    /// Points of a grid as a plane figure, with lines between neighbours.
    Figure,
    /// On the ground plane, north up.
    Above,
    /// In the picture of the camera.
    View,
    /// From any side.
    Orbit,
}

impl Form {
    pub const ALL: [Form; 8] =
        [Form::Image, Form::Levels, Form::Plot, Form::Table, Form::Figure, Form::Above, Form::View, Form::Orbit];

    /// What a button for it says.
    pub fn name(self) -> &'static str {
        match self {
            Form::Image => "image",
            Form::Levels => "levels",
            Form::Plot => "plot",
            Form::Table => "table",
            Form::Figure => "figure",
            Form::Above => "above",
            Form::View => "view",
            Form::Orbit => "orbit",
        }
    }

    /// It is drawn over the ground or in space, and not element by element.
    pub fn is_in_space(self) -> bool {
        matches!(self, Form::Above | Form::View | Form::Orbit)
    }
}

/// The mesh that a buffer is drawn on, and how it colours it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    /// The mesh itself, coloured by a number of its own points, or by level.
    Own(OnMesh),
    /// Values for each point of a grid.
    Points(BufferId),
    /// Values for each of its cells.
    Cells(BufferId),
    /// Values over the unit square: the grid, and where its points are in it.
    UnitSquare { vertex: BufferId, places: BufferId },
    /// A map over the ground.
    Map,
}

/// A mesh as it is drawn here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OnMesh {
    Grid(BufferId),
    Triangles(BufferId),
    Blocks(BufferId),
}

/// What is known of a chain's buffers.
#[derive(Clone, Copy)]
pub struct Known<'a> {
    pub buffers: &'a [Buffer],
    pub products: &'a Products<BufferId>,
}

impl<'a> Known<'a> {
    pub fn of_chain(chain: &'a Chain) -> Self {
        Self { buffers: chain.buffers(), products: chain.products() }
    }
}

impl Plan {
    pub fn known(&self) -> Known<'_> {
        Known { buffers: &self.buffers, products: &self.products }
    }

    /// What a buffer is a copy of, if it is one that somebody keeps to look at.
    pub fn source_of(&self, id: BufferId) -> BufferId {
        let copied = |step: &crate::plan::Step| match step.work {
            Work::Copy { from, to } if to == id => Some(from),
            _ => None,
        };
        self.steps.iter().find_map(copied).unwrap_or(id)
    }
}

impl Known<'_> {
    fn buffer(&self, id: BufferId) -> &Buffer {
        &self.buffers[id.0]
    }

    /// The ways to see a buffer, the most telling first.
    pub fn forms(&self, id: BufferId) -> Vec<Form> {
        let buffer = self.buffer(id);
        let is_map = matches!(buffer.dims[..], [rows, columns] if rows > 1 && columns > 1);
        let in_space = [Form::Above, Form::View, Form::Orbit];
        let mut forms = Vec::new();
        match self.surface(id) {
            Some(Surface::Own(_)) => forms.extend(in_space),
            Some(Surface::Map) | None => {}
            Some(_) => forms.extend(in_space),
        }
        if self.is_figure(id) {
            forms.insert(0, Form::Figure);
        }
        match buffer.spread {
            Spread::Nodes(_) => forms.extend([Form::Levels, Form::Image]),
            // a map of numbers is seen as one before it is seen on a mesh
            _ if is_map && buffer.elem.components() == 1 => forms.insert(0, Form::Image),
            _ if is_map => forms.push(Form::Image),
            _ => {}
        }
        if self.surface(id) == Some(Surface::Map) {
            forms.push(Form::Above);
        }
        let is_line = !is_map && (buffer.elem.is_float() || buffer.packing == Packing::Halves);
        if is_line {
            forms.push(Form::Plot);
        }
        forms.push(Form::Table);
        if !is_map && !is_line && buffer.parts.is_empty() && buffer.elements() > 1 {
            forms.push(Form::Plot);
        }
        forms
    }

    /// Points that are places in a plane, so that lines between neighbours are a figure.
    fn is_figure(&self, id: BufferId) -> bool {
        let buffer = self.buffer(id);
        buffer.elem == Elem::Vec2F32 && matches!(buffer.spread, Spread::GridPoints | Spread::UnitSquareCorners)
    }

    /// The mesh that a buffer is drawn on.
    pub fn surface(&self, id: BufferId) -> Option<Surface> {
        let meshes = Mesh::all(self.products);
        for mesh in meshes {
            match mesh {
                Mesh::Grid(grid) if grid.vertex == id => return Some(Surface::Own(OnMesh::Grid(id))),
                Mesh::List(list) if list.triangle == id => return Some(Surface::Own(OnMesh::Triangles(id))),
                _ => {}
            }
        }
        if Blocks::all(self.products).iter().any(|blocks: &Blocks<BufferId>| blocks.leaf == id) {
            return Some(Surface::Own(OnMesh::Blocks(id)));
        }
        let buffer = self.buffer(id);
        let dims = match buffer.dims[..] {
            [rows, columns] => (rows, columns),
            _ => return None,
        };
        let grid = |rows: u32, columns: u32| {
            let vertices = meshes.iter().rev().filter_map(|mesh| match mesh {
                Mesh::Grid(grid) => Some(grid.vertex),
                Mesh::List(_) => None,
            });
            vertices.into_iter().find(|vertex| self.buffer(*vertex).dims == [rows, columns])
        };
        match buffer.spread {
            Spread::GridPoints if buffer.elem == Elem::Vec2F32 => None,
            Spread::GridPoints => grid(dims.0, dims.1).map(Surface::Points),
            Spread::GridCells => grid(dims.0 + 1, dims.1 + 1).map(Surface::Cells),
            Spread::UnitSquare => {
                let is_place = |at: &usize| {
                    let buffer = &self.buffers[*at];
                    buffer.spread == Spread::GridPoints && buffer.elem == Elem::Vec2F32
                };
                let places = (0..self.buffers.len()).rev().find(is_place).map(BufferId)?;
                let &[rows, columns] = &self.buffer(places).dims[..] else { return None };
                Some(Surface::UnitSquare { vertex: grid(rows, columns)?, places })
            }
            Spread::Samples => Some(Surface::Map),
            _ => None,
        }
    }

    /// The buffers that the forms of a buffer need besides it.
    pub fn companions(&self, id: BufferId) -> Vec<BufferId> {
        match self.surface(id) {
            None | Some(Surface::Map) => Vec::new(),
            Some(Surface::Own(_)) => Vec::new(),
            Some(Surface::Points(vertex) | Surface::Cells(vertex)) => vec![vertex],
            Some(Surface::UnitSquare { vertex, places }) => vec![vertex, places],
        }
    }

    /// The picture that a chain makes is shown in its own colours.
    pub fn is_picture(&self, id: BufferId) -> bool {
        Picture::all(self.products).iter().any(|picture: &Picture<BufferId>| picture.pixels == id)
    }

    /// The numbers above which elements are listed, to be cast again for instance.
    pub fn listed_above(&self, id: BufferId) -> Option<f64> {
        use crate::plan::product::Listing;
        Listing::all(self.products)
            .iter()
            .find(|listing: &&Listing<BufferId>| listing.of == id)
            .map(|found| found.above)
    }
}
