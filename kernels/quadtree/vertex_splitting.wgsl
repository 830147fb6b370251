//!include lib/terrain.wgsl
//!include lib/block.wgsl
//!include lib/node.wgsl
//!include lib/group_sum.wgsl
//!include lib/decision.wgsl
//!include lib/outlook.wgsl
// The quadtree without pointers (Lee, Shin 2011, section 2.3): a list of vertices, each the centre of a block. In each round a
// vertex is dropped, becomes a leaf, or is split into its four children. Four dispatches a round: `decide` looks at the
// vertices, `sums` and `offsets` find where each of them writes, `append` writes. Lengths stay on the GPU. With a tree that is kept
// from the frame before, `recall` to `append_tree` go over it once, and the rounds only have what is new.

struct Params {
    terrain: Terrain,
    view: View,
    motion: Motion,
    /// The last round, after which there are no vertices.
    is_last: u32,
    /// Level of the blocks that are regions.
    region_level: u32,
    /// Elements of the lists.
    live_capacity: u32,
    leaf_capacity: u32,
    tree_capacity: u32,
    /// Vectors of four words that the bits of all blocks take.
    split_vectors: u32,
    threshold_px: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> roughness: array<f32>;
@group(0) @binding(2) var<storage, read> live: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> live_out: array<vec2<u32>>;
/// Workgroups along x, y, z and length of a list.
@group(0) @binding(4) var<storage, read> live_count: array<u32>;
@group(0) @binding(5) var<storage, read_write> live_count_out: array<u32>;
/// What becomes of a vertex, and what it appends; then what those before it in its group of 64 append.
@group(0) @binding(6) var<storage, read_write> choice_out: array<u32>;
@group(0) @binding(7) var<storage, read> choice: array<u32>;
/// What each group of 64 appends, to the leaves, the vertices and the tree; then where.
@group(0) @binding(8) var<storage, read_write> wanted_out: array<vec4<u32>>;
@group(0) @binding(9) var<storage, read> wanted: array<vec4<u32>>;
@group(0) @binding(10) var<storage, read_write> place_out: array<vec4<u32>>;
@group(0) @binding(11) var<storage, read> place: array<vec4<u32>>;
@group(0) @binding(12) var<storage, read_write> leaf: array<vec2<u32>>;
@group(0) @binding(13) var<storage, read_write> leaf_count: array<u32>;
/// A bit for each block: it is split.
@group(0) @binding(14) var<storage, read_write> split: array<atomic<u32>>;
@group(0) @binding(15) var<storage, read_write> clear: array<vec4<u32>>;
/// For the leaves, the vertices and the tree: the most elements that were wanted.
@group(0) @binding(16) var<storage, read_write> needed: array<u32>;
/// All nodes of the tree, in the frame before and in this one. Behind `tree_capacity` of them, two elements for each: how long what
/// became of it holds, see `known_at`. (One array for both: some adapters bind eight.)
@group(0) @binding(17) var<storage, read> tree_last: array<vec2<u32>>;
@group(0) @binding(22) var<storage, read_write> tree_last_out: array<vec2<u32>>;
@group(0) @binding(29) var<storage, read_write> tree: array<vec2<u32>>;
/// Workgroups along x, y, z to visit the tree, and how many nodes it has.
@group(0) @binding(18) var<storage, read> tree_count_last: array<u32>;
@group(0) @binding(30) var<storage, read_write> tree_count: array<u32>;
/// A bit for each region of the terrain: in it, a block is split no more.
@group(0) @binding(20) var<storage, read_write> closing: array<atomic<u32>>;
@group(0) @binding(21) var<storage, read> closed: array<u32>;
/// Workgroups to clear the bits of all blocks.
@group(0) @binding(23) var<storage, read_write> clear_work: array<u32>;
/// Nodes of the frame before to look at again, and nodes that may be gone; with workgroups along x, y, z, and how many.
@group(0) @binding(24) var<storage, read_write> stale: array<u32>;
@group(0) @binding(25) var<storage, read_write> stale_work: array<atomic<u32>>;
@group(0) @binding(26) var<storage, read_write> suspects: array<u32>;
@group(0) @binding(27) var<storage, read_write> suspect_work: array<atomic<u32>>;
/// Of the list that is visited.
@group(0) @binding(28) var<storage, read> work: array<u32>;

/// A vertex that is a leaf is looked at no more.
override CARRY_FLAG: bool = true;
/// A vertex knows its level.
override CARRY_SIZE: bool = true;
/// The tree is kept for the next frame.
override KEEP: bool = false;

/// A leaf that goes through the next round like any other vertex.
const AGAIN: u32 = 3u;
/// Under a block that is not split any more.
const GONE: u32 = 4u;
/// Split in the frame before as well: its children are in the tree.
const STAYS: u32 = 5u;

fn level_of(node: vec2<u32>) -> u32 {
    if CARRY_SIZE {
        return level_carried(node);
    }
    return level_from_centre(node);
}

/// Children of a block that are on the terrain.
fn children_of(level: u32, at: vec2<u32>) -> vec2<u32> {
    return min(level_size(last_sample(), level - 1u) - 2u * at, vec2(2u));
}

/// What a vertex appends, and after `sums` what those before it in its group of 64 do: leaves and vertices in 10 bits each, nodes of
/// the tree in 8, and what becomes of the vertex.
fn wants_of(fate: u32, level: u32, at: vec2<u32>) -> u32 {
    var wants = 0u;
    if fate == LEAF {
        wants = 1u;
    } else if fate == AGAIN {
        wants = 1u << 10u;
    } else if fate == SPLIT || fate == STAYS {
        let children = children_of(level, at);
        // the children of the finest blocks are the surface's own cells, and leaves
        let shift = select(10u, 0u, level == 1u);
        wants = select(children.x * children.y << shift, 0u, fate == STAYS && level > 1u);
    }
    if KEEP && fate != GONE && fate != AGAIN {
        wants += 1u << 20u;
    }
    return wants;
}

const FATE_BIT: u32 = 28u;

fn unpacked(wants: u32) -> vec4<u32> {
    return vec4(wants & 1023u, (wants >> 10u) & 1023u, (wants >> 20u) & 255u, 0u);
}

fn bit_of(index: u32) -> u32 {
    return 1u << (index & 31u);
}

/// Clears the bits of all blocks.
@compute @workgroup_size(64)
fn clear_bits(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * GROUP + id.x;
    if at < arrayLength(&clear) {
        clear[at] = vec4(0u);
    }
}

fn put_work(next: vec4<u32>) {
    for (var i = 0u; i < 4u; i++) {
        live_count_out[i] = next[i];
    }
}

/// Starts with the root.
@compute @workgroup_size(1)
fn begin() {
    live_out[0] = node_of(GROUND_CELLS_TOP, vec2(0u));
    put_work(work_for(1u, 1u));
    for (var i = 0u; i < 4u; i++) {
        leaf_count[i] = 0u;
        needed[i] = 0u;
    }
}

/// Nodes of the frame before; none after a cut, when nobody knows how far the camera has come since they were looked at.
fn nodes_before() -> u32 {
    return select(tree_count_last[3], 0u, params.motion.is_cut != 0u);
}

/// Where what is known of a node stands in the tree: how far the nearest of it was, how much motion that allows, and where the
/// camera was (travelled, turned) when that was found.
fn known_at(node: u32) -> u32 {
    return params.tree_capacity + 2u * node;
}

fn known_before(node: u32) -> vec4<f32> {
    let at = known_at(node);
    return bitcast<vec4<f32>>(vec4(tree_last[at], tree_last[at + 1u]));
}

/// Starts with the tree of the frame before, or with the root where there is none.
@compute @workgroup_size(1)
fn begin_again() {
    let count = nodes_before();
    live_out[0] = node_of(GROUND_CELLS_TOP, vec2(0u));
    put_work(work_for(select(0u, 1u, count == 0u), 1u));
    // the bits of the frame before are this frame's, but for what changes
    let cleared = work_for(select(0u, params.split_vectors, count == 0u), 1u);
    for (var i = 0u; i < 4u; i++) {
        leaf_count[i] = 0u;
        needed[i] = 0u;
        clear_work[i] = cleared[i];
        let none = select(0u, 1u, i == 1u || i == 2u);
        atomicStore(&stale_work[i], none);
        atomicStore(&suspect_work[i], none);
    }
}

@compute @workgroup_size(64)
fn decide(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
          @builtin(local_invocation_index) lane: u32) {
    let thread = thread_number(group, groups, lane);
    if thread < live_count[3] {
        let node = live[thread];
        let level = level_of(node);
        let at = place_of(node, level);
        var fate = decide_on(level, at);
        if !CARRY_FLAG && fate == LEAF && params.is_last == 0u {
            fate = AGAIN;
        }
        choice_out[thread] = wants_of(fate, level, at) | fate << FATE_BIT;
    }
}

/// Sums up what 64 vertices append. (There are 64 times as many threads as there are groups: the dispatch is the one of `decide`.)
fn sum_up(group: u32, length: u32) {
    // (more threads than u32 counts elements: compared before it is multiplied)
    if group >= (length + GROUP - 1u) / GROUP {
        return;
    }
    let first = group * GROUP;
    let end = min(first + GROUP, length);
    var sum = 0u;
    for (var i = first; i < end; i++) {
        let own = choice_out[i];
        let fate = own >> FATE_BIT;
        choice_out[i] = sum | fate << FATE_BIT;
        // at most 64 times 4: no field runs over, and the whole sum stays below the fate
        sum += own - (fate << FATE_BIT);
    }
    wanted_out[group] = unpacked(sum);
}

@compute @workgroup_size(64)
fn sums(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) lane: u32) {
    sum_up(thread_number(group, groups, lane), live_count[3]);
}

var<workgroup> chunk_wants: array<vec4<u32>, 64>;

/// From what each workgroup appends to where; and the work of the next round.
@compute @workgroup_size(64)
fn offsets(@builtin(local_invocation_index) lane: u32) {
    var tree_before = 0u;
    if KEEP {
        tree_before = tree_count[3];
    }
    advance(lane, live_count[3], vec4(leaf_count[3], 0u, tree_before, 0u));
}

@compute @workgroup_size(64)
fn offsets_of_tree(@builtin(local_invocation_index) lane: u32) {
    // without a tree there is the root
    let count = nodes_before();
    advance(lane, count, vec4(0u, select(0u, 1u, count == 0u), 0u, 0u));
}

/// `start` is how many leaves, vertices of the next round and nodes of the tree there are already.
fn advance(lane: u32, visited: u32, start: vec4<u32>) {
    let groups = (visited + GROUP - 1u) / GROUP;
    let chunk = (groups + GROUP - 1u) / GROUP;
    let first = lane * chunk;
    let end = min(first + chunk, groups);
    var sum = vec4(0u);
    for (var i = first; i < end; i++) {
        sum += wanted[i];
    }
    chunk_wants[lane] = sum;
    workgroupBarrier();
    var before = vec4(0u);
    var total = vec4(0u);
    for (var i = 0u; i < GROUP; i++) {
        total += chunk_wants[i];
        before += select(vec4(0u), chunk_wants[i], i < lane);
    }
    var at = start + before;
    for (var i = first; i < end; i++) {
        place_out[i] = at;
        at += wanted[i];
    }
    // everybody has read the counts before they change
    storageBarrier();
    workgroupBarrier();
    if lane == 0u {
        let after = start + total;
        needed[0] = max(needed[0], after.x);
        needed[1] = max(needed[1], after.y);
        needed[2] = max(needed[2], after.z);
        let fits = after.x <= params.leaf_capacity && after.y <= params.live_capacity && after.z <= params.tree_capacity;
        // past a list's end there is no next round, and nothing is drawn
        put_work(work_for(select(0u, after.y, fits), 1u));
        let leaves = work_for(select(0u, after.x, fits && needed[3] == 0u), 4u);
        needed[3] = select(1u, needed[3], fits);
        for (var i = 0u; i < 4u; i++) {
            leaf_count[i] = leaves[i];
        }
        if KEEP {
            // a tree that did not fit is none
            let visits = work_for(select(0u, after.z, needed[3] == 0u), 1u);
            for (var i = 0u; i < 4u; i++) {
                tree_count[i] = visits[i];
            }
        }
    }
}

fn put_leaf(at: u32, node: vec2<u32>, level: u32) {
    if at < params.leaf_capacity {
        leaf[at] = vec2(node.x, level << 1u);
    }
}

fn put_live(at: u32, node: vec2<u32>) {
    if at < params.live_capacity {
        live_out[at] = select(vec2(node.x, 0u), node, CARRY_SIZE);
    }
}

/// Writes what a vertex has become. What was split in the frame before has its bit.
fn append_node(thread: u32, node: vec2<u32>, level: u32, known: vec4<f32>) {
    let chosen = choice[thread];
    let fate = chosen >> FATE_BIT;
    if fate == GONE {
        return;
    }
    let start = place[thread / GROUP] + unpacked(chosen);
    let at = place_of(node, level);
    let is_split = fate == SPLIT || fate == STAYS;
    if fate == LEAF {
        put_leaf(start.x, node, level);
    } else if fate == AGAIN {
        put_live(start.y, node);
    } else if is_split {
        if fate == SPLIT {
            let index = index_of(level, at);
            atomicOr(&split[index / 32u], bit_of(index));
        }
        let children = children_of(level, at);
        var next = 0u;
        for (var i = 0u; i < 4u; i++) {
            let offset = vec2(i & 1u, i >> 1u);
            if all(offset < children) {
                let child = node_of(level - 1u, 2u * at + offset);
                if level == 1u {
                    put_leaf(start.x + next, child, 0u);
                } else if fate == SPLIT {
                    put_live(start.y + next, child);
                }
                next += 1u;
            }
        }
    }
    if KEEP && fate != AGAIN {
        if start.z < params.tree_capacity {
            let carried = select(0u, FLAG, is_split) | select(0u, OUT_OF_SIGHT, fate == CULLED);
            tree[start.z] = vec2(node.x, level << 1u | carried);
            tree[known_at(start.z)] = bitcast<vec2<u32>>(known.xy);
            tree[known_at(start.z) + 1u] = bitcast<vec2<u32>>(known.zw);
        }
    }
}

@compute @workgroup_size(64)
fn append(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
          @builtin(local_invocation_index) lane: u32) {
    let thread = thread_number(group, groups, lane);
    if thread < live_count[3] {
        let node = live[thread];
        // nothing is known yet of how long that holds
        append_node(thread, node, level_of(node), vec4(0.0));
    }
}

/// Regions are at least that many levels below the root.
fn region_of(level: u32, at: vec2<u32>) -> u32 {
    var region = at >> vec2(max(params.region_level, level) - level);
    region = region << vec2(max(params.region_level, level) - params.region_level);
    return region.y * level_size(last_sample(), params.region_level).x + region.x;
}

fn unmark(level: u32, at: vec2<u32>) {
    let index = index_of(level, at);
    atomicAnd(&split[index / 32u], ~bit_of(index));
}

/// Notes in all regions under a block that it is split no more.
fn close(level: u32, at: vec2<u32>) {
    let regions = level_size(last_sample(), params.region_level);
    let side = 1u << (max(params.region_level, level) - params.region_level);
    let first = region_of(level, at);
    let columns = min(side, regions.x - first % regions.x);
    let rows = min(side, regions.y - first / regions.x);
    // by whole words of 32 regions: the root has more regions than an adapter may give one thread turns of its loops
    for (var row = 0u; row < rows; row++) {
        let start = first + row * regions.x;
        let end = start + columns;
        for (var word = start / 32u; word <= (end - 1u) / 32u; word++) {
            let low = max(start, 32u * word) - 32u * word;
            let high = min(end, 32u * word + 32u) - 32u * word;
            atomicOr(&closing[word], (0xffffffffu >> (32u - (high - low))) << low);
        }
    }
}

/// What became of a node, as far as it is known; as if all blocks above it were split.
fn put_fate(thread: u32, node: vec2<u32>, found: u32) {
    let level = level_carried(node);
    let at = place_of(node, level);
    let fate = select(found, STAYS, found == SPLIT && (node.y & FLAG) != 0u);
    choice_out[thread] = wants_of(fate, level, at) | fate << FATE_BIT;
}

/// Appends to a list in any order: what is done with it does not depend on it. Its first three numbers are the workgroups to visit it.
fn put_in_stale(thread: u32) {
    let at = atomicAdd(&stale_work[3], 1u);
    stale[at] = thread;
    let group = at / GROUP;
    atomicMax(&stale_work[0], min(group + 1u, MOST_GROUPS));
    atomicMax(&stale_work[1], group / MOST_GROUPS + 1u);
}

fn put_in_suspects(thread: u32) {
    let at = atomicAdd(&suspect_work[3], 1u);
    suspects[at] = thread;
    let group = at / GROUP;
    atomicMax(&suspect_work[0], min(group + 1u, MOST_GROUPS));
    atomicMax(&suspect_work[1], group / MOST_GROUPS + 1u);
}

/// Goes over all nodes of the frame before, and lists those of which it must be found out again what becomes of them. (Lists
/// and no conditions: software adapters go through both sides of those.)
@compute @workgroup_size(64)
fn recall(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
          @builtin(local_invocation_index) lane: u32) {
    let thread = thread_number(group, groups, lane);
    if thread >= nodes_before() {
        return;
    }
    let node = tree_last[thread];
    let was_split = (node.y & FLAG) != 0u;
    put_fate(thread, node, select(select(LEAF, SPLIT, was_split), CULLED, (node.y & OUT_OF_SIGHT) != 0u));
    if !is_settled(known_before(thread)) {
        put_in_stale(thread);
    }
}

/// Looks at those nodes again.
@compute @workgroup_size(64)
fn look(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) lane: u32) {
    let number = thread_number(group, groups, lane);
    if number >= work[3] {
        return;
    }
    let thread = stale[number];
    let node = tree_last_out[thread];
    let level = level_carried(node);
    let outlook = outlook_on(level, place_of(node, level));
    tree_last_out[known_at(thread)] = bitcast<vec2<u32>>(vec2(outlook.distance_m, outlook.motion));
    tree_last_out[known_at(thread) + 1u] = bitcast<vec2<u32>>(vec2(params.motion.travelled_m, params.motion.turned));
    put_fate(thread, node, outlook.fate);
}

/// Notes which of them are split no more. (A step of its own: `look` binds the ground as well, and some adapters bind eight buffers.)
@compute @workgroup_size(64)
fn close_split(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) lane: u32) {
    let number = thread_number(group, groups, lane);
    if number >= work[3] {
        return;
    }
    let thread = stale[number];
    let node = tree_last[thread];
    // what is split in both frames stays
    if (node.y & FLAG) != 0u && choice[thread] >> FATE_BIT != STAYS {
        let level = level_carried(node);
        let at = place_of(node, level);
        unmark(level, at);
        close(level, at);
    }
}

/// Lists the nodes in regions where a block is split no more.
@compute @workgroup_size(64)
fn suspect(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) lane: u32) {
    let thread = thread_number(group, groups, lane);
    if thread >= nodes_before() {
        return;
    }
    let node = tree_last[thread];
    let level = level_carried(node);
    let region = region_of(level, place_of(node, level));
    if (closed[region / 32u] & bit_of(region)) != 0u {
        put_in_suspects(thread);
    }
}

/// Whether all blocks above one are split.
fn is_reached(level: u32, at: vec2<u32>) -> bool {
    var reached = true;
    for (var above = level + 1u; above <= GROUND_CELLS_TOP && reached; above++) {
        let index = index_of(above, at >> vec2(above - level));
        reached = (atomicLoad(&split[index / 32u]) & bit_of(index)) != 0u;
    }
    return reached;
}

/// What is under a block that is split no more is gone, and its bit with it: that changes nothing for what is below, which is under
/// that block as well.
@compute @workgroup_size(64)
fn prune(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) lane: u32) {
    let number = thread_number(group, groups, lane);
    if number >= work[3] {
        return;
    }
    let thread = suspects[number];
    let node = tree_last[thread];
    let level = level_carried(node);
    let at = place_of(node, level);
    if !is_reached(level, at) {
        choice_out[thread] = GONE << FATE_BIT;
        unmark(level, at);
    }
}

@compute @workgroup_size(64)
fn sums_of_tree(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) lane: u32) {
    sum_up(thread_number(group, groups, lane), nodes_before());
}

@compute @workgroup_size(64)
fn append_tree(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) lane: u32) {
    let thread = thread_number(group, groups, lane);
    if thread < nodes_before() {
        let node = tree_last[thread];
        append_node(thread, node, level_carried(node), known_before(thread));
    }
}
