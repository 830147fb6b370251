use glam::UVec2;

use super::TriangleSplitting;
use crate::ground::pyramid::Layout;
use crate::plan::product::{Blocks, List, Mesh};
use crate::reference::{Absent, Buffers, Frame, Reference, Values};

impl Reference for TriangleSplitting {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let last = frame.lattice().size - 1;
        let layout = frame.lattice().cells();
        let known: Blocks<_> = buffers.latest()?;
        let (leaves, count, split) =
            (buffers.values(known.leaf), buffers.values(known.count), buffers.values(known.split));
        let mut triangles = Vec::new();
        for leaf in 0..count.value[3] as usize {
            let (centre, level) = (leaves.value[2 * leaf] as u32, leaves.value[2 * leaf + 1] as u32 >> 1);
            let at = UVec2::new(centre & 0xffff, centre >> 16) >> (level + 1);
            let blocks = Quadtree { last, layout, split: &split, splits: self.split };
            blocks.triangles(level, at, &mut triangles);
        }
        let is_open = count.bound[3] > 0.0;
        let bound = if is_open { f64::INFINITY } else { 0.0 };
        let mut triangle = Values::missing(&[self.capacity], 4);
        for (number, (corners, level)) in triangles.iter().enumerate() {
            for (at, corner) in corners.iter().enumerate() {
                triangle.set(4 * number + at, (corner.x | corner.y << 16).into(), bound);
            }
            triangle.set(4 * number + 3, (*level).into(), bound);
        }
        let mut vertices = Values::exact(&[4], 1, vec![3.0 * triangles.len() as f64, 1.0, 0.0, 0.0]);
        vertices.bound[0] = bound;
        triangle.in_any_order = leaves.in_any_order;
        let triangle = buffers.put("triangle", triangle);
        let count = buffers.put("triangle_count", vertices);
        let promise = frame.ground.detail().is_none().then_some(known.promise);
        buffers.offer(Mesh::List(List { triangle, count, promise }));
        Ok(())
    }
}

/// What the reference asks of the quadtree.
struct Quadtree<'a> {
    last: UVec2,
    layout: Layout,
    split: &'a Values,
    splits: bool,
}

impl Quadtree<'_> {
    /// Counterclockwise from above: north, west, south, east.
    fn triangles(&self, level: u32, at: UVec2, to: &mut Vec<([UVec2; 3], u32)>) {
        let low = at << level;
        let high = low + (1 << level);
        let (ne, sw) = (UVec2::new(high.x, low.y), UVec2::new(low.x, high.y));
        if level == 0 {
            to.push(([low, sw, ne], 0));
            to.push(([high, ne, sw], 0));
            return;
        }
        let centre = low + (1 << level) / 2;
        for (a, b, beyond) in [(ne, low, (0, -1)), (low, sw, (-1, 0)), (sw, high, (0, 1)), (high, ne, (1, 0))] {
            let mut parts = Vec::new();
            self.edge(level, at.as_ivec2() + glam::IVec2::from(beyond), a, b, &mut parts);
            // written from the north or the west on
            parts.sort_by_key(|(a, b)| (a.x.min(b.x), a.y.min(b.y)));
            for (a, b) in parts {
                let corners = [a, b, centre].map(|corner| corner.min(self.last));
                let [a, b, c] = corners.map(|corner| corner.as_ivec2());
                if (b - a).perp_dot(c - a) != 0 {
                    to.push((corners, level));
                }
            }
        }
    }

    /// The paper's recursion: split at the middle if the neighbour is.
    fn edge(&self, level: u32, neighbour: glam::IVec2, a: UVec2, b: UVec2, parts: &mut Vec<(UVec2, UVec2)>) {
        let is_there =
            neighbour.cmpge(glam::IVec2::ZERO).all() && neighbour.as_uvec2().cmplt(self.layout.size(level)).all();
        let is_split = |at: UVec2| {
            let index = self.layout.index(level, at.x, at.y);
            self.split.value[index / 32] as u32 >> (index % 32) & 1 != 0
        };
        if !self.splits || level == 0 || !is_there || !is_split(neighbour.as_uvec2()) {
            parts.push((a, b));
            return;
        }
        let middle = (a + b) / 2;
        for (a, b) in [(a, middle), (middle, b)] {
            if level == 1 {
                parts.push((a, b));
                continue;
            }
            // of the neighbour's children, the one that this half of the edge belongs to
            let half = 1 << (level - 1);
            let inside = |child: &UVec2| {
                let (low, high) = (*child * half, *child * half + half);
                [a, b].iter().all(|end| end.cmpge(low).all() && end.cmple(high).all())
            };
            let children = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| neighbour.as_uvec2() * 2 + UVec2::new(x, y));
            if let Some(child) = children.into_iter().find(inside) {
                self.edge(level - 1, child.as_ivec2(), a, b, parts);
            }
        }
    }
}
