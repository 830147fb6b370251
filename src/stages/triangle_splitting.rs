use glam::UVec2;
use serde::Deserialize;

use super::height_pyramid::{Layout, bounds_layout};
use super::{Info, Stage};
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Kernel};
use crate::plan::Chain;
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "TriangleSplitting",
    summary: "blocks to triangles without cracks: an edge is split wherever a finer neighbour has a vertex",
    formula: "four triangles a block; (A, B, C) becomes (A, T, C) and (T, B, C) if the neighbour across AB is split at T",
    source: "Lee, Shin 2011, section 2.4, Fig. 6 to 9",
    reads: &["leaf", "leaf_count", "split"],
    writes: &["triangle", "triangle_count"],
    kernels: &["triangle_splitting.wgsl"],
    params: &[
        ("split", "true", "without, blocks keep their four triangles and the mesh has cracks"),
        ("capacity", "524288", "triangles at first; a list that overflows is made larger between frames"),
    ],
    read: |node, _| {
        let stage: TriangleSplitting = node.parse_fields()?;
        if !(1..=1 << 26).contains(&stage.capacity) {
            let place = node.field("capacity").unwrap_or(node);
            return Err(
                Diagnostic::input("no list can have that many triangles").at(&place.origin, "expected 1 to 67108864")
            );
        }
        Ok(Box::new(stage))
    },
};

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TriangleSplitting {
    split: bool,
    capacity: u32,
}

impl Default for TriangleSplitting {
    fn default() -> Self {
        Self { split: true, capacity: 1 << 19 }
    }
}

/// Threads of a workgroup, four a leaf.
const GROUP: u32 = 64;

impl Stage for TriangleSplitting {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let size = chain.data.terrain.size;
        let layout = bounds_layout(size);
        let words = layout.dims().iter().product::<u32>().div_ceil(32).next_multiple_of(4);
        let leaf_count = chain.read_own("leaf_count", Elem::U32, &[4])?;
        let split = chain.read_own("split", Elem::U32, &[words])?;
        let leaf = chain.read("leaf")?;
        let leaf = chain.read_own("leaf", Elem::Vec2U32, &chain.buffer(leaf).dims.clone())?;
        let threads = (4 * chain.buffer(leaf).dims[0]).next_multiple_of(GROUP);
        let capacity = chain.capacity("triangle", self.capacity);
        let needed = chain.make_kept("triangle_needed", Elem::U32, &[1], "", "triangles that the mesh has");
        chain.guard("triangle", capacity, needed, 0);
        let mut make = |name: &str, length: u32, meaning: &str| chain.make(name, Elem::U32, &[length], "", meaning);
        let before = make("triangles_before", threads, "triangles of the edges before in the workgroup");
        let wanted = make("triangles_wanted", threads / GROUP, "triangles of each workgroup");
        let place = make("triangles_place", threads / GROUP, "triangles of all workgroups before");
        let count = make("triangle_count", 4, "vertices, instances, first vertex, first instance");
        let meaning = "three samples, 16 bits a column and a row, counterclockwise from above; level of the block";
        let triangle = chain.make("triangle", Elem::Vec4U32, &[capacity], "", meaning);
        if let Some(promise) = chain.promise_of(leaf) {
            chain.promise(promise, triangle);
        }
        let kernel = Kernel::built_in("triangle_splitting.wgsl")?;
        for entry in ["count", "sums", "offsets", "write"] {
            let step = chain
                .step(entry, &kernel, entry)
                .constant("SPLIT", f64::from(self.split))
                .bind("leaf_count", leaf_count)
                .set("size", size.to_array())
                .set("stride", layout.stride)
                .set("tall", layout.tall)
                .set("capacity", capacity);
            match entry {
                "count" => {
                    step.bind("leaf", leaf).bind("split", split).bind("before_out", before).over_indirect(leaf_count)?
                }
                "sums" => step.bind("before_out", before).bind("wanted_out", wanted).over_indirect(leaf_count)?,
                "offsets" => step
                    .bind("wanted", wanted)
                    .bind("place_out", place)
                    .bind("triangle_count", count)
                    .bind("needed", needed)
                    .over(UVec2::ONE)?,
                _ => step
                    .bind("leaf", leaf)
                    .bind("split", split)
                    .bind("before", before)
                    .bind("place", place)
                    .bind("triangle", triangle)
                    .over_indirect(leaf_count)?,
            }
        }
        Ok(())
    }

    fn reference(&self, frame: &Frame, buffers: &mut Buffers) {
        let last = frame.data.terrain.size - 1;
        let layout = bounds_layout(frame.data.terrain.size);
        let (leaves, count, split) = (buffers.get("leaf"), buffers.get("leaf_count"), buffers.get("split"));
        let mut triangles = Vec::new();
        for leaf in 0..count.value[3] as usize {
            let (centre, level) = (leaves.value[2 * leaf] as u32, leaves.value[2 * leaf + 1] as u32 >> 1);
            let at = UVec2::new(centre & 0xffff, centre >> 16) >> (level + 1);
            let blocks = Blocks { last, layout, split: &split, splits: self.split };
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
        buffers.put("triangle", triangle);
        buffers.put("triangle_count", vertices);
    }
}

/// What the reference asks of the quadtree.
struct Blocks<'a> {
    last: UVec2,
    layout: Layout,
    split: &'a Values,
    splits: bool,
}

impl Blocks<'_> {
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
