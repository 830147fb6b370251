//! The triangles of a mesh, and what can be said of them by looking at their corners: cracks, folds, the largest one.

use glam::{DVec2, DVec3, UVec2};

use crate::camera::Camera;
use crate::ground::Ground;

/// A mesh as it is drawn: three corners a triangle, each with its own position.
#[derive(Clone, Debug, Default)]
pub struct Triangles {
    /// Camera-relative metres.
    pub corners: Vec<[[f32; 3]; 3]>,
    /// Edges that may belong to one triangle only, as bit patterns of their ends.
    pub border: Vec<Edge>,
}

/// Both ends by bit pattern, the smaller first.
pub type Edge = [[u32; 3]; 2];

pub fn edge(a: [f32; 3], b: [f32; 3]) -> Edge {
    let (a, b) = (a.map(f32::to_bits), b.map(f32::to_bits));
    if a <= b { [a, b] } else { [b, a] }
}

/// The two triangles of each cell of a grid of vertices `[rows, columns]`, as `Rasterize` draws them.
pub fn grid_triangles(vertices: &[[f32; 4]], columns: usize) -> Triangles {
    let rows = vertices.len() / columns.max(1);
    let at = |x: usize, y: usize| {
        let [px, py, pz, _] = vertices[y * columns + x];
        [px, py, pz]
    };
    let mut mesh = Triangles::default();
    for y in 0..rows.saturating_sub(1) {
        for x in 0..columns - 1 {
            mesh.corners.push([at(x, y), at(x, y + 1), at(x + 1, y)]);
            mesh.corners.push([at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)]);
        }
    }
    let along_x = (1..columns).flat_map(|x| [(x - 1, 0, x, 0), (x - 1, rows - 1, x, rows - 1)]);
    let along_y = (1..rows).flat_map(|y| [(0, y - 1, 0, y), (columns - 1, y - 1, columns - 1, y)]);
    mesh.border = along_x.chain(along_y).map(|(x0, y0, x1, y1)| edge(at(x0, y0), at(x1, y1))).collect();
    mesh.border.sort_unstable();
    mesh
}

/// Edges that belong to one triangle and are not on the border: the neighbour across it, if any, has other
/// end points, and a ray can pass between. Compared bit for bit.
pub fn cracks(mesh: &Triangles) -> usize {
    let mut edges: Vec<Edge> =
        mesh.corners.iter().flat_map(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)]).collect();
    edges.retain(|[a, b]| a != b);
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).filter(|same| same.len() == 1 && mesh.border.binary_search(&same[0]).is_err()).count()
}

/// Triangles that are turned against most of the others, seen from above the ground. `eye_m` is where positions are relative to.
pub fn folds(mesh: &Triangles, ground: &dyn Ground, eye_m: DVec3) -> usize {
    let area = |corners: &[[f32; 3]; 3]| {
        let [a, b, c] = corners.map(|corner| DVec3::from(corner.map(f64::from)));
        (b - a).cross(c - a).dot(ground.up(a + eye_m))
    };
    let up = mesh.corners.iter().filter(|corners| area(corners) > 0.0).count();
    let down = mesh.corners.iter().filter(|corners| area(corners) < 0.0).count();
    up.min(down)
}

/// Longest edge in pixels of the triangles that are entirely in the picture.
pub fn largest_px(mesh: &Triangles, camera: &Camera) -> Option<f64> {
    let size = DVec2::new(f64::from(camera.viewport.0), f64::from(camera.viewport.1));
    let place = |point: [f32; 3]| {
        let point = DVec3::from(point.map(f64::from)) + camera.eye_m;
        camera.pixel(point).filter(|pixel| pixel.cmpge(DVec2::ZERO).all() && pixel.cmple(size).all())
    };
    let longest = |&[a, b, c]: &[[f32; 3]; 3]| {
        let (a, b, c) = (place(a)?, place(b)?, place(c)?);
        Some(a.distance(b).max(b.distance(c)).max(c.distance(a)))
    };
    mesh.corners.iter().filter_map(longest).reduce(f64::max)
}

/// A list of triangles between samples of the terrain, as `TriangleSplitting` leaves it.
#[derive(Clone, Debug, Default)]
pub struct Listed {
    /// Column and row of each corner. Equal ones are one point: a corner's position is computed from nothing else.
    pub corners: Vec<[UVec2; 3]>,
}

impl Listed {
    /// From three packed samples a triangle; `vertices` is how many corners were drawn.
    pub fn new(keys: &[[u32; 4]], vertices: u32) -> Self {
        let sample = |key: u32| UVec2::new(key & 0xffff, key >> 16);
        let corners = keys.iter().take(vertices as usize / 3).map(|&[a, b, c, _]| [a, b, c].map(sample));
        Self { corners: corners.collect() }
    }

    /// With their positions relative to the eye.
    pub fn placed(&self, ground: &dyn Ground, camera: &Camera) -> Triangles {
        let place = |sample: UVec2| (ground.sample_m(sample) - camera.eye_m).as_vec3().to_array();
        let corners = self.corners.iter().map(|corners| corners.map(place)).collect();
        Triangles { corners, border: Vec::new() }
    }

    /// Edges along which two triangles meet that do not share both ends, so that a ray can pass between them, and edges with
    /// more than two triangles. Where the picture ends there are edges with one triangle, and that is no crack: there is nothing
    /// on their other side.
    pub fn cracks(&self) -> usize {
        let (odd, open) = self.open_edges();
        let mut cracks = odd;
        for line in open.chunk_by(|a, b| (a.is_upright, a.line) == (b.is_upright, b.line)) {
            let mut reached = [0, 0];
            for edge in line {
                // the other side has an edge that ends after this one begins
                cracks += usize::from(reached[usize::from(!edge.side)] > edge.from);
                let own = &mut reached[usize::from(edge.side)];
                *own = (*own).max(edge.to);
            }
        }
        cracks
    }

    /// What is open between two edges of a crack: they are over each other, and a ray that passes between them meets one of these triangles,
    /// which stand upright and are no part of the mesh. Relative to the eye.
    pub fn gaps(&self, ground: &dyn Ground, camera: &Camera) -> Triangles {
        let (_, open) = self.open_edges();
        let place = |edge: &Open, at: u32| {
            let end = |along: u32| {
                let sample = if edge.is_upright { UVec2::new(edge.line, along) } else { UVec2::new(along, edge.line) };
                ground.sample_m(sample) - camera.eye_m
            };
            end(edge.from).lerp(end(edge.to), f64::from(at - edge.from) / f64::from(edge.to - edge.from))
        };
        let mut gaps = Triangles::default();
        for line in open.chunk_by(|a, b| (a.is_upright, a.line) == (b.is_upright, b.line)) {
            let (mut these, mut others) =
                (line.iter().filter(|edge| edge.side).peekable(), line.iter().filter(|edge| !edge.side).peekable());
            while let (Some(this), Some(other)) = (these.peek(), others.peek()) {
                let (from, to) = (this.from.max(other.from), this.to.min(other.to));
                if from < to {
                    let [a, b, c, d] = [(this, from), (this, to), (other, to), (other, from)]
                        .map(|(edge, at)| place(edge, at).as_vec3().to_array());
                    gaps.corners.extend([[a, b, c], [a, c, d]]);
                }
                if this.to <= other.to {
                    these.next()
                } else {
                    others.next()
                };
            }
        }
        gaps
    }

    /// How many edges have two triangles on one side or cross a block with a triangle on one side only, and the edges along a block that have
    /// a triangle on one side only, in the order of their lines.
    fn open_edges(&self) -> (usize, Vec<Open>) {
        let key = |sample: UVec2| sample.to_array();
        let directed = self.corners.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        // both ends, and which side the triangle is on
        let mut edges: Vec<([u32; 2], [u32; 2], bool)> = directed
            .filter(|(a, b)| a != b)
            .map(|(a, b)| if key(a) <= key(b) { (key(a), key(b), true) } else { (key(b), key(a), false) })
            .collect();
        edges.sort_unstable();
        let (mut odd, mut open) = (0, Vec::new());
        for same in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let ([ax, ay], [bx, by], side) = same[0];
            match same {
                [_] if ax == bx => open.push(Open { is_upright: true, line: ax, from: ay, to: by, side }),
                [_] if ay == by => open.push(Open { is_upright: false, line: ay, from: ax, to: bx, side }),
                [first, second] if first.2 != second.2 => {}
                _ => odd += 1,
            }
        }
        open.sort_unstable();
        (odd, open)
    }
}

/// An edge with a triangle on one side only, along a column or a row of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Open {
    is_upright: bool,
    /// The column, or the row.
    line: u32,
    from: u32,
    to: u32,
    side: bool,
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::experiment::scene::Surface;
    use crate::ground::Samples;
    use crate::terrain::HeightField;

    /// A grid of 3 x 3 vertices a metre apart.
    fn grid(moved: impl Fn(usize, [f32; 4]) -> [f32; 4]) -> Vec<[f32; 4]> {
        (0..9).map(|at| moved(at, [(at % 3) as f32, -((at / 3) as f32), 0.0, 0.0])).collect()
    }

    fn flat_folds(mesh: &Triangles) -> usize {
        let field = HeightField { size: UVec2::splat(2), cell_m: DVec2::ONE, heights_m: vec![0.0; 4] };
        folds(mesh, &Samples::new(Arc::new(field), Surface::Triangles), DVec3::ZERO)
    }

    #[test]
    fn a_crack_is_an_edge_whose_ends_differ() {
        let whole = grid_triangles(&grid(|_, vertex| vertex), 3);
        assert_eq!((whole.corners.len(), cracks(&whole), flat_folds(&whole)), (8, 0, 0));
        // a corner of one triangle is moved by the last bit of a coordinate: its two inner edges have no partner, nor have their partners
        let mut torn = whole.clone();
        torn.corners[1][1][2] = f32::from_bits(1);
        assert_eq!(cracks(&torn), 4);
        // an edge of the border may belong to one triangle
        let mut open = whole.clone();
        open.border.clear();
        assert_eq!(cracks(&open), 8);
    }

    #[test]
    fn a_fold_is_a_triangle_that_is_turned_over() {
        // the vertex in the middle goes past its neighbour to the east
        let folded =
            grid_triangles(&grid(|at, [x, y, z, w]| if at == 4 { [x + 1.5, y, z, w] } else { [x, y, z, w] }), 3);
        assert!(flat_folds(&folded) >= 2, "{}", flat_folds(&folded));
    }
}
