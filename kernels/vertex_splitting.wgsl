//!include lib/terrain.wgsl
//!include lib/pyramid.wgsl
//!include lib/block.wgsl
//!include lib/node.wgsl
//!include lib/group_sum.wgsl
// The quadtree without pointers (Lee, Shin 2011, section 2.3): a list of vertices, each the centre of a block. In each round a
// vertex is dropped, becomes a leaf, or is split into its four children. Four dispatches a round: `decide` looks at the
// vertices, `sums` and `offsets` find where each of them writes, `append` writes. Lengths stay on the GPU. With a tree that is kept
// from the frame before, `look`, `sums_of_tree` and `append_tree` go over it once, and the rounds only have what is new.

struct Params {
    terrain: Terrain,
    /// Layout of the pyramids; `top` is the level of the root.
    stride: u32,
    tall: u32,
    top: u32,
    /// The last round, after which there are no vertices.
    is_last: u32,
    /// Level of the blocks that are regions.
    region_level: u32,
    /// Elements of the lists.
    live_capacity: u32,
    leaf_capacity: u32,
    tree_capacity: u32,
    threshold_px: f32,
    /// Pixels from the middle of the picture to where a ray leaves it at 45 degrees.
    focal_px: f32,
    /// World axes of the view: right, up, forward.
    view_right: vec3<f32>,
    view_up: vec3<f32>,
    view_forward: vec3<f32>,
    /// Inward normals of the picture's sides.
    side_left: vec3<f32>,
    side_right: vec3<f32>,
    side_top: vec3<f32>,
    side_bottom: vec3<f32>,
    /// Of all rays with length 1 along the view direction: the longest, and the most that a metre of height moves one, at a distance of 1.
    ray_most: f32,
    tilt_most: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> height: array<f32>;
@group(0) @binding(2) var<storage, read> height_min: array<f32>;
@group(0) @binding(3) var<storage, read> height_max: array<f32>;
@group(0) @binding(4) var<storage, read> roughness: array<f32>;
@group(0) @binding(5) var<storage, read> live: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> live_out: array<vec2<u32>>;
/// Workgroups along x, y, z and length of a list.
@group(0) @binding(7) var<storage, read> live_count: array<u32>;
@group(0) @binding(8) var<storage, read_write> live_count_out: array<u32>;
/// What becomes of a vertex, and what it appends; then what those before it in its group of 64 append.
@group(0) @binding(9) var<storage, read_write> choice_out: array<u32>;
@group(0) @binding(10) var<storage, read> choice: array<u32>;
/// What each group of 64 appends, to the leaves, the vertices and the tree; then where.
@group(0) @binding(11) var<storage, read_write> wanted_out: array<vec4<u32>>;
@group(0) @binding(12) var<storage, read> wanted: array<vec4<u32>>;
@group(0) @binding(13) var<storage, read_write> place_out: array<vec4<u32>>;
@group(0) @binding(14) var<storage, read> place: array<vec4<u32>>;
@group(0) @binding(15) var<storage, read_write> leaf: array<vec2<u32>>;
@group(0) @binding(16) var<storage, read_write> leaf_count: array<u32>;
/// A bit for each block: it is split.
@group(0) @binding(17) var<storage, read_write> split: array<atomic<u32>>;
@group(0) @binding(18) var<storage, read_write> clear: array<vec4<u32>>;
/// For the leaves, the vertices and the tree: the most elements that were wanted.
@group(0) @binding(19) var<storage, read_write> needed: array<u32>;
/// All nodes of the tree, in two halves: that of the frame before and this frame's.
@group(0) @binding(20) var<storage, read_write> tree: array<vec2<u32>>;
/// Nodes of the frame before, which half is this frame's, and its nodes so far.
@group(0) @binding(21) var<storage, read_write> tree_count: array<u32>;
/// Workgroups to visit the tree of the frame before.
@group(0) @binding(22) var<storage, read_write> tree_work: array<u32>;
/// A bit for each region of the terrain: in it, a block is split no more.
@group(0) @binding(23) var<storage, read_write> closed: array<atomic<u32>>;

/// The roughness is a bound, and the decision keeps it.
override PROVEN: bool = false;
override CULL: bool = true;
/// A vertex that is a leaf is looked at no more.
override CARRY_FLAG: bool = true;
/// A vertex knows its level.
override CARRY_SIZE: bool = true;
/// The tree is kept for the next frame.
override KEEP: bool = false;

const CULLED: u32 = 0u;
const LEAF: u32 = 1u;
const SPLIT: u32 = 2u;
/// A leaf that goes through the next round like any other vertex.
const AGAIN: u32 = 3u;
/// Under a block that is not split any more.
const GONE: u32 = 4u;
/// Split in the frame before as well: its children are in the tree.
const STAYS: u32 = 5u;

/// An error in pixels that rounding may add to a proven bound.
const SLACK_PX: f32 = 0.02;

fn level_of(node: vec2<u32>) -> u32 {
    if CARRY_SIZE {
        return level_carried(node);
    }
    return level_from_centre(node);
}

fn last_sample() -> vec2<u32> {
    return params.terrain.size - 1u;
}

fn index_of(level: u32, at: vec2<u32>) -> u32 {
    return pyramid_index(params.stride, params.tall, level, at);
}

struct Box {
    low: vec3<f32>,
    high: vec3<f32>,
}

/// A block's extent relative to the eye.
fn box_of(level: u32, at: vec2<u32>, index: u32) -> Box {
    let block = block_of(level, at, last_sample());
    let a = world_from_cells(params.terrain, relative_cells(params.terrain, vec2<i32>(block.low)));
    let b = world_from_cells(params.terrain, relative_cells(params.terrain, vec2<i32>(block.high)));
    // rows run south
    return Box(vec3(a.x, b.y, relative_height(params.terrain, height_min[index])),
               vec3(b.x, a.y, relative_height(params.terrain, height_max[index])));
}

/// The largest of `n . p` over a box, by a little more than rounding can take from it.
fn farthest_along(n: vec3<f32>, box: Box) -> f32 {
    let far = max(n * box.low, n * box.high);
    let reach = abs(far);
    return far.x + far.y + far.z + 1.0e-6 * (reach.x + reach.y + reach.z);
}

fn is_visible(box: Box) -> bool {
    if !CULL {
        return true;
    }
    let sides = min(min(farthest_along(params.side_left, box), farthest_along(params.side_right, box)),
                    min(farthest_along(params.side_top, box), farthest_along(params.side_bottom, box)));
    return min(sides, farthest_along(params.view_forward, box)) >= 0.0;
}

/// Pixels between a point and the one `rise_m` above it. What is behind the eye counts as if it were in front.
fn error_px(point: vec3<f32>, rise_m: f32) -> f32 {
    let p = vec3(dot(params.view_right, point), dot(params.view_up, point), dot(params.view_forward, point));
    let up = vec3(params.view_right.z, params.view_up.z, params.view_forward.z);
    let moved = length(p.xy * up.z - up.xy * p.z) * rise_m;
    return params.focal_px * moved / abs(p.z * (p.z + rise_m * up.z));
}

fn point_at(sample: vec2<u32>) -> vec3<f32> {
    let ground = world_from_cells(params.terrain, relative_cells(params.terrain, vec2<i32>(sample)));
    return vec3(ground, relative_height(params.terrain, height[sample.y * params.terrain.size.x + sample.x]));
}

/// Eq. 2: inside the block's sphere, or with an error of at least the threshold at one of its five points.
fn is_rough(level: u32, at: vec2<u32>, box: Box, rise_m: f32) -> bool {
    let centre = 0.5 * (box.low + box.high);
    let half = box.high - centre;
    if dot(centre, centre) < dot(half, half) {
        return true;
    }
    let block = block_of(level, at, last_sample());
    var most = error_px(point_at(block.middle), rise_m);
    most = max(most, error_px(point_at(vec2(block.middle.x, block.low.y)), rise_m));
    most = max(most, error_px(point_at(vec2(block.middle.x, block.high.y)), rise_m));
    most = max(most, error_px(point_at(vec2(block.low.x, block.middle.y)), rise_m));
    most = max(most, error_px(point_at(vec2(block.high.x, block.middle.y)), rise_m));
    return most >= params.threshold_px;
}

/// Whether a point of the block that is in the picture can be off by the threshold: no such point is nearer, along the view
/// direction, than the nearest corner of the box, nor than the box is from the eye, seen along the longest ray.
fn may_break(box: Box, rise_m: f32) -> bool {
    let near = min(params.view_forward * box.low, params.view_forward * box.high);
    let beside = max(max(box.low, -box.high), vec3(0.0));
    let depth = max(near.x + near.y + near.z, length(beside) / params.ray_most) * (1.0 - 1.0e-5);
    let room = depth - rise_m * abs(params.view_forward.z);
    let allowed_px = max(params.threshold_px - SLACK_PX, 0.5 * params.threshold_px);
    return room <= 0.0 || params.focal_px * params.tilt_most * rise_m >= allowed_px * room;
}

/// What becomes of a vertex.
fn decide_on(level: u32, at: vec2<u32>) -> u32 {
    let index = index_of(level, at);
    let box = box_of(level, at, index);
    if !is_visible(box) {
        return CULLED;
    }
    let rise_m = roughness[index];
    if rise_m == 0.0 {
        return LEAF;
    }
    var split_it: bool;
    if PROVEN {
        split_it = may_break(box, rise_m);
    } else {
        split_it = is_rough(level, at, box, rise_m);
    }
    return select(LEAF, SPLIT, split_it);
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

fn put_work(work: vec4<u32>) {
    for (var i = 0u; i < 4u; i++) {
        live_count_out[i] = work[i];
    }
}

/// Starts with the root.
@compute @workgroup_size(1)
fn begin() {
    live_out[0] = node_of(params.top, vec2(0u));
    put_work(work_for(1u, 1u));
    for (var i = 0u; i < 4u; i++) {
        leaf_count[i] = 0u;
        needed[i] = 0u;
    }
}

/// Starts with the tree of the frame before, or with the root where there is none.
@compute @workgroup_size(1)
fn begin_again() {
    let count = tree_count[NODES_NOW];
    tree_count[NODES_BEFORE] = count;
    tree_count[HALF] = 1u - min(tree_count[HALF], 1u);
    tree_count[NODES_NOW] = 0u;
    live_out[0] = node_of(params.top, vec2(0u));
    put_work(work_for(select(0u, 1u, count == 0u), 1u));
    let work = work_for(count, 1u);
    for (var i = 0u; i < 4u; i++) {
        leaf_count[i] = 0u;
        needed[i] = 0u;
        tree_work[i] = work[i];
    }
}

/// Where in `tree_count` things are.
const NODES_BEFORE: u32 = 0u;
const HALF: u32 = 1u;
const NODES_NOW: u32 = 2u;

/// A node of the frame before.
fn node_before(at: u32) -> vec2<u32> {
    return tree[(1u - tree_count[HALF]) * params.tree_capacity + at];
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
    let first = group * GROUP;
    if first >= length {
        return;
    }
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
    advance(lane, live_count[3], 0u);
}

@compute @workgroup_size(64)
fn offsets_of_tree(@builtin(local_invocation_index) lane: u32) {
    // without a tree there is the root
    let count = tree_count[NODES_BEFORE];
    advance(lane, count, select(0u, 1u, count == 0u));
}

/// `live_before` vertices are in the next round's list already.
fn advance(lane: u32, visited: u32, live_before: u32) {
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
    var tree_before = 0u;
    if KEEP {
        tree_before = tree_count[NODES_NOW];
    }
    let start = vec4(leaf_count[3], live_before, tree_before, 0u);
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
            tree_count[NODES_NOW] = select(0u, after.z, needed[3] == 0u);
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

/// Writes what a vertex has become. The bits of the frame before's tree are set already.
fn append_node(thread: u32, node: vec2<u32>, level: u32, is_marked: bool) {
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
        if !is_marked {
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
            tree[tree_count[HALF] * params.tree_capacity + start.z] = vec2(node.x, level << 1u | select(0u, FLAG, is_split));
        }
    }
}

@compute @workgroup_size(64)
fn append(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
          @builtin(local_invocation_index) lane: u32) {
    let thread = thread_number(group, groups, lane);
    if thread < live_count[3] {
        let node = live[thread];
        append_node(thread, node, level_of(node), false);
    }
}

/// Regions are at least that many levels below the root.
fn region_of(level: u32, at: vec2<u32>) -> u32 {
    var region = at >> vec2(max(params.region_level, level) - level);
    region = region << vec2(max(params.region_level, level) - params.region_level);
    return region.y * level_size(last_sample(), params.region_level).x + region.x;
}

/// Notes in all regions under a block that it is split no more.
fn close(level: u32, at: vec2<u32>) {
    let regions = level_size(last_sample(), params.region_level);
    let side = 1u << (max(params.region_level, level) - params.region_level);
    let first = region_of(level, at);
    for (var i = 0u; i < side * side; i++) {
        let offset = vec2(i % side, i / side);
        if all(vec2(first % regions.x, first / regions.x) + offset < regions) {
            let region = first + offset.y * regions.x + offset.x;
            atomicOr(&closed[region / 32u], bit_of(region));
        }
    }
}

/// Looks at all nodes of the frame before, as if all blocks above them were split.
@compute @workgroup_size(64)
fn look(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) lane: u32) {
    let thread = thread_number(group, groups, lane);
    if thread >= tree_count[NODES_BEFORE] {
        return;
    }
    let node = node_before(thread);
    let level = level_carried(node);
    let at = place_of(node, level);
    var fate = decide_on(level, at);
    let was_split = (node.y & FLAG) != 0u;
    if fate == SPLIT {
        let index = index_of(level, at);
        atomicOr(&split[index / 32u], bit_of(index));
        fate = select(SPLIT, STAYS, was_split);
    }
    // (a loop and no condition: software adapters go through both sides of those)
    var closes = was_split && fate != STAYS;
    while closes {
        close(level, at);
        closes = false;
    }
    choice_out[thread] = wants_of(fate, level, at) | fate << FATE_BIT;
}

/// Whether all blocks above one are split.
fn is_reached(level: u32, at: vec2<u32>) -> bool {
    var reached = true;
    for (var above = level + 1u; above <= params.top && reached; above++) {
        let index = index_of(above, at >> vec2(above - level));
        reached = (atomicLoad(&split[index / 32u]) & bit_of(index)) != 0u;
    }
    return reached;
}

/// Sums up what 64 nodes append that are still there. What is under a block that is split no more is gone, and its bit with it:
/// that changes nothing for what is below, which is under that block as well.
@compute @workgroup_size(64)
fn sums_of_tree(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) lane: u32) {
    let number = thread_number(group, groups, lane);
    let first = number * GROUP;
    let count = tree_count[NODES_BEFORE];
    if first >= count {
        return;
    }
    let end = min(first + GROUP, count);
    for (var i = first; i < end; i++) {
        let node = node_before(i);
        let level = level_carried(node);
        let at = place_of(node, level);
        let region = region_of(level, at);
        var may_be_gone = (atomicLoad(&closed[region / 32u]) & bit_of(region)) != 0u;
        while may_be_gone {
            if !is_reached(level, at) {
                let index = index_of(level, at);
                choice_out[i] = GONE << FATE_BIT;
                atomicAnd(&split[index / 32u], ~bit_of(index));
            }
            may_be_gone = false;
        }
    }
    sum_up(number, count);
}

@compute @workgroup_size(64)
fn append_tree(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) lane: u32) {
    let thread = thread_number(group, groups, lane);
    if thread < tree_count[NODES_BEFORE] {
        let node = node_before(thread);
        append_node(thread, node, level_carried(node), true);
    }
}
