//! The buffers of the stage, and what its steps have in common.

use super::{Start, VertexSplitting};
use crate::experiment::diagnostic::Diagnostic;
use crate::ground::pyramid::Layout;
use crate::kernel::Elem;
use crate::plan::product::{NodeRanges, Roughness};
use crate::plan::spread::Part;
use crate::plan::{BufferId, Chain, History};

/// Threads of a workgroup; `GROUP` of the kernel.
pub(super) const GROUP: u32 = 64;

pub(super) struct Lists {
    pub roughness: BufferId,
    pub live: [BufferId; 2],
    pub choice: BufferId,
    pub wanted: BufferId,
    pub place: BufferId,
    pub leaf: BufferId,
    pub leaf_count: BufferId,
    pub split: BufferId,
    pub needed: BufferId,
    pub tree: Option<Tree>,
    pub capacities: [u32; 3],
    pub layout: Layout,
    pub proven: bool,
}

/// What lasts from frame to frame.
pub(super) struct Tree {
    pub nodes: History,
    pub count: History,
    pub closed: BufferId,
    pub clear_work: BufferId,
    pub stale: BufferId,
    pub stale_work: BufferId,
    pub suspects: BufferId,
    pub suspect_work: BufferId,
}

/// How many levels below the root the regions are in which something may be split no more.
const REGIONS_BELOW: u32 = 9;

pub(super) fn region_level(layout: Layout) -> u32 {
    layout.top.saturating_sub(REGIONS_BELOW).max(1)
}

impl Lists {
    pub fn make(stage: &VertexSplitting, chain: &mut Chain) -> Result<Self, Diagnostic> {
        let layout = chain.lattice().cells();
        let has_history = stage.start == Start::LastFrame;
        let roughness = roughness(chain, layout, has_history)?;
        let is_known = |known: &Roughness<BufferId>| known.roughness == roughness;
        let proven = chain.products().find(is_known).is_some_and(|known| known.is_bound);
        let meaning = "longest lists of leaves, vertices, tree; did one overflow";
        let needed = chain.make_for_host("splitting_needed", Elem::U32, &[4], "", meaning);
        let names = ["leaf", "live", "tree"];
        // whole workgroups write what they found, past the list's end as well
        let capacities = names.map(|list| chain.capacity(list, stage.capacity).next_multiple_of(GROUP));
        for (at, list) in names.into_iter().enumerate().take(if has_history { 3 } else { 2 }) {
            chain.guard(list, capacities[at], needed, at);
        }
        let [leaves, live, nodes] = capacities;
        let visited = if has_history { live.max(nodes) } else { live };
        let vertices = "centre of a block in half cells, 16 bits each; flag and level";
        let words = layout.dims().iter().product::<u32>().div_ceil(32).next_multiple_of(4);
        let tree = has_history.then(|| Tree::make(chain, layout, nodes));
        let mut make =
            |name: &str, elem: Elem, length: u32, meaning: &str| chain.make(name, elem, &[length], "", meaning);
        let choice = "what becomes of each vertex, and what those before append";
        let live = ["live_a", "live_b"].map(|name| make(name, Elem::Vec2U32, live, vertices));
        let leaf = make("leaf", Elem::Vec2U32, leaves, vertices);
        [live[0], live[1], leaf].into_iter().for_each(|id| chain.set_parts(id, NODE));
        let mut make =
            |name: &str, elem: Elem, length: u32, meaning: &str| chain.make(name, elem, &[length], "", meaning);
        Ok(Self {
            roughness,
            live,
            choice: make("choice", Elem::U32, visited, choice),
            wanted: make("wanted", Elem::Vec4U32, visited / GROUP, "what each workgroup appends"),
            place: make("place", Elem::Vec4U32, visited / GROUP, "where each workgroup appends"),
            leaf,
            leaf_count: make("leaf_count", Elem::U32, 4, "workgroups along x, y, z; how many leaves"),
            split: match has_history {
                true => chain.make_kept("split", Elem::U32, &[words], "", SPLIT),
                false => chain.make("split", Elem::U32, &[words], "", SPLIT),
            },
            needed,
            tree,
            capacities,
            layout,
            proven,
        })
    }
}

/// The centre of a block in half cells, and what a node carries beside it.
const NODE: &[Part] = &[
    Part::new("column_halves", 0, 0, 16),
    Part::new("row_halves", 0, 16, 16),
    Part::new("flag", 1, 0, 1),
    Part::new("level", 1, 1, 4),
    Part::new("out_of_sight", 1, 5, 1),
];

const SPLIT: &str = "a bit for each block: it is split";

/// How far the surface is from each block.
fn roughness(chain: &Chain, layout: Layout, has_history: bool) -> Result<BufferId, Diagnostic> {
    let ranges: NodeRanges<BufferId> = chain.latest()?;
    let roughness = chain.read_of_ground("roughness", Elem::F32, &layout.dims())?;
    if has_history {
        // what is left for the next frame holds as long as these do not change
        for id in [ranges.lowest, ranges.highest, roughness] {
            chain.check_own(id)?;
        }
        if !chain.is_scene_ground() {
            return Err(Diagnostic::input("a tree of the frame before is for a ground that never changes")
                .at(chain.origin(), "this stage")
                .help("`start: Root`, or no kernel that makes another ground"));
        }
    }
    Ok(roughness)
}

impl Tree {
    fn make(chain: &mut Chain, layout: Layout, nodes: u32) -> Self {
        let regions = layout.size(region_level(layout)).element_product().div_ceil(32).next_multiple_of(4);
        let all = "all nodes of the quadtree; behind them two elements for each, how long what became of it holds";
        let work = "workgroups along x, y, z; how many nodes";
        Self {
            nodes: chain.make_history("tree", Elem::Vec2U32, &[nodes.saturating_mul(3)], "", all),
            count: chain.make_history("tree_count", Elem::U32, &[4], "", work),
            stale: chain.make("stale", Elem::U32, &[nodes], "", "nodes to look at again, in any order"),
            stale_work: chain.make("stale_work", Elem::U32, &[4], "", "workgroups along x, y, z; how many"),
            suspects: chain.make("suspects", Elem::U32, &[nodes], "", "nodes that may be gone, in any order"),
            suspect_work: chain.make("suspect_work", Elem::U32, &[4], "", "workgroups along x, y, z; how many"),
            clear_work: chain.make("clear_work", Elem::U32, &[4], "", "workgroups along x, y, z; vectors to clear"),
            closed: chain.make("closed", Elem::U32, &[regions], "", "a bit for each region: a block is split no more"),
        }
    }
}
