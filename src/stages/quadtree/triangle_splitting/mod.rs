mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::Chain;
use crate::plan::product::{Blocks, List, Mesh, Promise, what};
use crate::plan::spread::Part;
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "TriangleSplitting",
    summary: "blocks to triangles without cracks: an edge is split wherever a finer neighbour has a vertex",
    formula: "four triangles a block; (A, B, C) becomes (A, T, C) and (T, B, C) if the neighbour across AB is split at T",
    source: "Lee, Shin 2011, section 2.4, Fig. 6 to 9",
    writes: &["triangle", "triangle_count"],
    needs: &[what::<Blocks<()>>()],
    offers: &[what::<Mesh<()>>()],
    parameters: schema::<TriangleSplitting>,
    read: read_as::<TriangleSplitting>,
    examples: &[
        Example::new("[HeightPyramid, Roughness, VertexSplitting(threshold_px: 5), TriangleSplitting]")
            .in_benches(&[("VertexSplitting.threshold_px", "2")]),
        Example::new("[HeightPyramid, Roughness, VertexSplitting(threshold_px: 5, start: LastFrame), TriangleSplitting(split: false)]")
            .in_benches(&[("VertexSplitting.threshold_px", "2")]),
    ],
    ..Info::EMPTY
};

#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TriangleSplitting {
    /// without, blocks keep their four triangles and the mesh has cracks
    split: bool,
    /// triangles at first; a list that overflows is made larger between frames
    #[schemars(range(min = 1, max = 67108864))]
    capacity: u32,
}

impl Default for TriangleSplitting {
    fn default() -> Self {
        Self { split: true, capacity: 1 << 19 }
    }
}

/// Threads of a workgroup, four a leaf.
const GROUP: u32 = 64;

/// Three samples, and the level of the block that the triangle is of.
const TRIANGLE: &[Part] = &[
    Part::new("column_a", 0, 0, 16),
    Part::new("row_a", 0, 16, 16),
    Part::new("column_b", 1, 0, 16),
    Part::new("row_b", 1, 16, 16),
    Part::new("column_c", 2, 0, 16),
    Part::new("row_c", 2, 16, 16),
    Part::new("level", 3, 0, 32),
];

impl Stage for TriangleSplitting {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let size = chain.lattice().size;
        let layout = chain.lattice().cells();
        let words = layout.dims().iter().product::<u32>().div_ceil(32).next_multiple_of(4);
        let Blocks { leaf, count: leaf_count, split, promise } = chain.latest()?;
        for id in [leaf, leaf_count, split] {
            chain.check_own(id)?;
        }
        chain.check_kind(split, Elem::U32, &[words])?;
        let threads = (4 * chain.buffer(leaf).dims[0]).next_multiple_of(GROUP);
        let capacity = chain.capacity("triangle", self.capacity);
        let needed = chain.make_for_host("triangle_needed", Elem::U32, &[1], "", "triangles that the mesh has");
        chain.guard("triangle", capacity, needed, 0);
        let mut make = |name: &str, length: u32, meaning: &str| chain.make(name, Elem::U32, &[length], "", meaning);
        let before = make("triangles_before", threads, "triangles of the edges before in the workgroup");
        let wanted = make("triangles_wanted", threads / GROUP, "triangles of each workgroup");
        let place = make("triangles_place", threads / GROUP, "triangles of all workgroups before");
        let count = make("triangle_count", 4, "vertices, instances, first vertex, first instance");
        let meaning = "three samples, 16 bits a column and a row, counterclockwise from above; level of the block";
        let triangle = chain.make("triangle", Elem::Vec4U32, &[capacity], "", meaning);
        chain.set_parts(triangle, TRIANGLE);
        // the argument for a bound is one of a closed mesh
        let promise = Promise { proven: promise.proven && self.split, ..promise };
        // what is between samples, no block knows of
        let promise = chain.octaves().is_none().then_some(promise);
        chain.offer(Mesh::List(List { triangle, count, promise }));
        let kernel = chain.kernel("quadtree/triangle_splitting.wgsl")?;
        for entry in ["count", "sums", "offsets", "write"] {
            let step = chain
                .step(entry, &kernel, entry)
                .constant("SPLIT", f64::from(self.split))
                .bind("leaf_count", leaf_count)
                .set("size", size.to_array())
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
}
