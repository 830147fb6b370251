mod blocks;
mod lists;
mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::experiment::scene::Surface;
use crate::kernel::Elem;
use crate::plan::product::{Blocks, NodeRanges, Promise, Roughness, what};
use crate::plan::{BufferId, Chain, StepBuilder};
use crate::stages::shared::prefix_sums::over_runs;
use crate::stages::{Example, Info, Stage, read_as};
use lists::{Lists, Tree, region_level};

pub const INFO: Info = Info {
    name: "VertexSplitting",
    summary: "the quadtree's blocks that are fine enough for this view: a vertex a block, split round by round",
    formula: "split if the eye is in the block's sphere and s > 0, or if max_k |project(v_k) - project(v_k + s z)| >= threshold",
    source: "Lee, Shin 2011, sections 2.1 (Eq. 2), 2.3 and 3; Proven and LastFrame are ours",
    reads: &["roughness"],
    writes: &["leaf", "leaf_count", "split"],
    needs: &[what::<NodeRanges<()>>(), what::<Roughness<()>>()],
    offers: &[what::<Blocks<()>>()],
    parameters: schema::<VertexSplitting>,
    read: read_as::<VertexSplitting>,
    examples: &[
        Example::new("[HeightPyramid, Roughness, VertexSplitting(threshold_px: 5)]")
            .in_benches(&[("VertexSplitting.threshold_px", "2")]),
        Example::new(
            "[HeightPyramid, Roughness(error: Proven), VertexSplitting(threshold_px: 8, carry_flag: false, carry_size: false)]",
        )
        .only_on(Surface::Triangles)
        .in_benches(&[("VertexSplitting.threshold_px", "2")]),
        Example::new("[HeightPyramid, Roughness, VertexSplitting(threshold_px: 5, start: LastFrame)]")
            .in_benches(&[("VertexSplitting.threshold_px", "2")]),
    ],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
enum Start {
    /// from the root in every frame
    #[default]
    Root,
    /// from the tree of the frame before, to the same leaves
    LastFrame,
}

#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct VertexSplitting {
    /// the error that a block may have; a roughness that is a bound makes it a promise
    #[schemars(range(min = 0, max = 1e9))]
    threshold_px: f64,
    /// where a frame begins
    start: Start,
    /// drop blocks outside the picture
    cull: bool,
    /// a vertex that is a leaf is looked at once; without, in every round that follows
    carry_flag: bool,
    /// a vertex knows the size of its block; without, it is found from its place
    carry_size: bool,
    /// elements of the lists at first; one that overflows is made larger between frames
    #[schemars(range(min = 1, max = 67108864))]
    capacity: u32,
}

impl Default for VertexSplitting {
    fn default() -> Self {
        Self {
            threshold_px: 1.0,
            start: Start::Root,
            cull: true,
            carry_flag: true,
            carry_size: true,
            capacity: 1 << 17,
        }
    }
}

impl VertexSplitting {
    fn promise(&self, proven: bool) -> Promise {
        Promise { bound_px: self.threshold_px, proven }
    }

    fn step<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        lists: &Lists,
        label: &str,
        entry: &str,
        round: u32,
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        let kernel = chain.kernel("quadtree/vertex_splitting.wgsl")?;
        let [leaves, live, nodes] = lists.capacities;
        let split_vectors = vectors(chain, lists.split);
        let threshold_px = self.promise(lists.proven).told_px(chain.data);
        Ok(chain
            .step(label, &kernel, entry)
            .constant("PROVEN", f64::from(lists.proven))
            .constant("CULL", f64::from(self.cull))
            .constant("CARRY_FLAG", f64::from(self.carry_flag))
            .constant("CARRY_SIZE", f64::from(self.carry_size))
            .constant("KEEP", f64::from(lists.tree.is_some()))
            .set("region_level", region_level(lists.layout))
            .set("is_last", u32::from(round + 1 == lists.layout.top))
            .set("live_capacity", live)
            .set("leaf_capacity", leaves)
            .set("tree_capacity", nodes)
            .set("split_vectors", split_vectors)
            .set("threshold_px", threshold_px as f32))
    }

    /// One round, or the first look at the tree of the frame before: decide, find the places, append.
    fn round(&self, chain: &mut Chain, lists: &Lists, round: u32, counts: [BufferId; 2]) -> Result<(), Diagnostic> {
        let [live, next] = if round.is_multiple_of(2) { lists.live } else { [lists.live[1], lists.live[0]] };
        self.step(chain, lists, &format!("decide {round}"), "decide", round)?
            .bind("roughness", lists.roughness)
            .bind("live", live)
            .bind("live_count", counts[0])
            .bind("choice_out", lists.choice)
            .over_indirect(counts[0])?;
        self.step(chain, lists, &format!("sums {round}"), "sums", round)?
            .bind("live_count", counts[0])
            .bind("choice_out", lists.choice)
            .bind("wanted_out", lists.wanted)
            .over_indirect(counts[0])?;
        self.offsets(chain, lists, &format!("offsets {round}"), "offsets", counts[1])?
            .bind("live_count", counts[0])
            .over(UVec2::ONE)?;
        self.append(chain, lists, &format!("append {round}"), "append", next)?
            .bind("live", live)
            .bind("live_count", counts[0])
            .over_indirect(counts[0])
    }

    fn offsets<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        lists: &Lists,
        label: &str,
        entry: &str,
        next_count: BufferId,
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        let step = self.step(chain, lists, label, entry, 0)?;
        let step = step
            .bind("wanted", lists.wanted)
            .bind("place_out", lists.place)
            .bind("leaf_count", lists.leaf_count)
            .bind("live_count_out", next_count)
            .bind("needed", lists.needed);
        Ok(match &lists.tree {
            Some(tree) => step.bind("tree_count", tree.count.next),
            None => step.leave_unbound("tree_count"),
        })
    }

    fn append<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        lists: &Lists,
        label: &str,
        entry: &str,
        next: BufferId,
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        let step = self.step(chain, lists, label, entry, 0)?;
        let step = step
            .bind("choice", lists.choice)
            .bind("place", lists.place)
            .bind("leaf", lists.leaf)
            .bind("live_out", next)
            .bind("split", lists.split);
        Ok(match &lists.tree {
            Some(tree) => step.bind("tree", tree.nodes.next),
            None => step.leave_unbound("tree"),
        })
    }

    /// Goes over the tree of the frame before; what it splits anew is the first round's.
    fn settle(&self, chain: &mut Chain, lists: &Lists, tree: &Tree, first_count: BufferId) -> Result<(), Diagnostic> {
        self.step(chain, lists, "recall", "recall", 0)?
            .bind("tree_last", tree.nodes.last)
            .bind("tree_count_last", tree.count.last)
            .bind("choice_out", lists.choice)
            .bind("stale", tree.stale)
            .bind("stale_work", tree.stale_work)
            .over_indirect(tree.count.last)?;
        self.step(chain, lists, "look", "look", 0)?
            .bind("tree_last_out", tree.nodes.last)
            .bind("roughness", lists.roughness)
            .bind("choice_out", lists.choice)
            .bind("stale", tree.stale)
            .bind("work", tree.stale_work)
            .over_indirect(tree.stale_work)?;
        self.step(chain, lists, "close", "close_split", 0)?
            .bind("tree_last", tree.nodes.last)
            .bind("choice", lists.choice)
            .bind("split", lists.split)
            .bind("closing", tree.closed)
            .bind("stale", tree.stale)
            .bind("work", tree.stale_work)
            .over_indirect(tree.stale_work)?;
        self.step(chain, lists, "suspect", "suspect", 0)?
            .bind("tree_last", tree.nodes.last)
            .bind("tree_count_last", tree.count.last)
            .bind("closed", tree.closed)
            .bind("suspects", tree.suspects)
            .bind("suspect_work", tree.suspect_work)
            .over_indirect(tree.count.last)?;
        self.step(chain, lists, "prune", "prune", 0)?
            .bind("tree_last", tree.nodes.last)
            .bind("choice_out", lists.choice)
            .bind("split", lists.split)
            .bind("suspects", tree.suspects)
            .bind("work", tree.suspect_work)
            .over_indirect(tree.suspect_work)?;
        self.append_tree(chain, lists, tree, first_count)
    }

    /// Appends what has become of the tree of the frame before.
    fn append_tree(
        &self,
        chain: &mut Chain,
        lists: &Lists,
        tree: &Tree,
        first_count: BufferId,
    ) -> Result<(), Diagnostic> {
        self.step(chain, lists, "sums_of_tree", "sums_of_tree", 0)?
            .bind("tree_count_last", tree.count.last)
            .bind("choice_out", lists.choice)
            .bind("wanted_out", lists.wanted)
            .over_indirect(tree.count.last)?;
        self.offsets(chain, lists, "offsets of tree", "offsets_of_tree", first_count)?
            .bind("tree_count_last", tree.count.last)
            .over(UVec2::ONE)?;
        self.append(chain, lists, "append tree", "append_tree", lists.live[0])?
            .bind("tree_last", tree.nodes.last)
            .bind("tree_count_last", tree.count.last)
            .over_indirect(tree.count.last)
    }

    fn clear<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        lists: &Lists,
        bits: BufferId,
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        Ok(self.step(chain, lists, "clear", "clear_bits", 0)?.bind("clear", bits))
    }

    fn begin(&self, chain: &mut Chain, lists: &Lists, count: BufferId) -> Result<(), Diagnostic> {
        let entry = if lists.tree.is_some() { "begin_again" } else { "begin" };
        let step = self.step(chain, lists, "begin", entry, 0)?;
        let step = step
            .bind("live_out", lists.live[0])
            .bind("live_count_out", count)
            .bind("leaf_count", lists.leaf_count)
            .bind("needed", lists.needed);
        let Some(tree) = &lists.tree else {
            step.over(UVec2::ONE)?;
            let all = vectors(chain, lists.split);
            return over_runs(self.clear(chain, lists, lists.split)?, all);
        };
        step.bind("tree_count_last", tree.count.last)
            .bind("clear_work", tree.clear_work)
            .bind("stale_work", tree.stale_work)
            .bind("suspect_work", tree.suspect_work)
            .over(UVec2::ONE)?;
        let regions = vectors(chain, tree.closed);
        over_runs(self.clear(chain, lists, tree.closed)?, regions)?;
        self.clear(chain, lists, lists.split)?.over_indirect(tree.clear_work)?;
        self.settle(chain, lists, tree, count)
    }
}

/// Vectors of four words in a buffer of bits.
fn vectors(chain: &Chain, bits: BufferId) -> u32 {
    chain.buffer(bits).dims[0] / 4
}

impl Stage for VertexSplitting {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let lists = Lists::make(self, chain)?;
        if lists.proven {
            chain.check_bound(self.threshold_px)?;
        }
        let rounds = lists.layout.top;
        let meaning = "workgroups along x, y, z; how many vertices there are";
        let counts: Vec<BufferId> = (0..=rounds)
            .map(|round| chain.make(&format!("live_count_{round}"), Elem::U32, &[4], "", meaning))
            .collect();
        self.begin(chain, &lists, counts[0])?;
        for round in 0..rounds {
            self.round(chain, &lists, round, [counts[round as usize], counts[round as usize + 1]])?;
        }
        let promise = self.promise(lists.proven);
        chain.offer(Blocks { leaf: lists.leaf, count: lists.leaf_count, split: lists.split, promise });
        Ok(())
    }
}
