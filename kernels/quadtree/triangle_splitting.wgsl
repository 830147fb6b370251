//!include lib/pyramid.wgsl
//!include lib/block.wgsl
//!include lib/node.wgsl
//!include lib/group_sum.wgsl
// Blocks to triangles (Lee, Shin 2011, section 2.4): a block is four triangles around its centre, one an edge. Where the neighbour
// across an edge is split, so is the triangle, and its halves where the neighbour's children are, until no vertex of a neighbour
// lies inside an edge. A thread takes one edge of one block and walks along it. The finest blocks are the cells of the surface.

struct Params {
    pyramid: Pyramid,
    /// Columns and rows of samples.
    size: vec2<u32>,
    capacity: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> leaf: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> leaf_count: array<u32>;
/// A bit for each block: it is split.
@group(0) @binding(3) var<storage, read> split: array<u32>;
/// Triangles of each edge; then of those before it in its group of 64.
@group(0) @binding(4) var<storage, read_write> before_out: array<u32>;
@group(0) @binding(5) var<storage, read> before: array<u32>;
/// Triangles of 64 edges each, and where the first one is.
@group(0) @binding(6) var<storage, read_write> wanted_out: array<u32>;
@group(0) @binding(7) var<storage, read> wanted: array<u32>;
@group(0) @binding(8) var<storage, read_write> place_out: array<u32>;
@group(0) @binding(9) var<storage, read> place: array<u32>;
/// Three samples, column and row in 16 bits each, counterclockwise from above; and the block's level.
@group(0) @binding(10) var<storage, read_write> triangle: array<vec4<u32>>;
/// Vertices, instances, first vertex, first instance.
@group(0) @binding(11) var<storage, read_write> triangle_count: array<u32>;
@group(0) @binding(12) var<storage, read_write> needed: array<u32>;

/// Split triangles towards finer neighbours; without, there are cracks.
override SPLIT: bool = true;

const NORTH: u32 = 0u;
const WEST: u32 = 1u;
const SOUTH: u32 = 2u;
const EAST: u32 = 3u;

fn last_sample() -> vec2<u32> {
    return params.size - 1u;
}

/// An edge of a block, walked along from north to south or from west to east.
struct Edge {
    level: u32,
    side: u32,
    block: Block,
    /// The edge's first sample as a place in an endless grid, and the samples that it has.
    start: vec2<u32>,
    cells: u32,
    is_upright: bool,
}

fn edge_of(thread: u32) -> Edge {
    let node = leaf[thread / 4u];
    let level = level_carried(node);
    let side = thread % 4u;
    let at = place_of(node, level);
    let block = block_of(level, at, last_sample());
    let low = at << vec2(level);
    let is_upright = side == WEST || side == EAST;
    var start = low;
    start.x += select(0u, 1u << level, side == EAST);
    start.y += select(0u, 1u << level, side == SOUTH);
    let size = block.high - block.low;
    return Edge(level, side, block, start, select(size.x, size.y, is_upright), is_upright);
}

/// A sample of the edge.
fn place_on(edge: Edge, at: u32) -> vec2<u32> {
    return min(edge.start + select(vec2(at, 0u), vec2(0u, at), edge.is_upright), last_sample());
}

/// Whether the edge's triangles have an area: its line is not where the terrain's border has put the centre.
fn has_area(edge: Edge) -> bool {
    let first = place_on(edge, 0u);
    let apart = select(edge.block.middle.y != first.y, edge.block.middle.x != first.x, edge.is_upright);
    return apart;
}

/// Whether the neighbour of a level at a place of the edge is there and split.
fn is_split(edge: Edge, level: u32, at: u32) -> bool {
    let along = edge.start + select(vec2(at, 0u), vec2(0u, at), edge.is_upright);
    var node = along >> vec2(level);
    // towards the north and the west the neighbour ends where the edge is
    let is_there = (edge.side != NORTH || node.y > 0u) && (edge.side != WEST || node.x > 0u);
    node -= select(vec2(0u), vec2(select(0u, 1u, edge.side == WEST), select(0u, 1u, edge.side == NORTH)), is_there);
    if !is_there || any(node >= level_size(last_sample(), level)) {
        return false;
    }
    let index = pyramid_index(params.pyramid, level, node);
    return (split[index / 32u] >> (index & 31u) & 1u) != 0u;
}

/// Where the part of the edge that starts at a place ends: the largest block that starts there and is not split.
fn part_end(edge: Edge, at: u32) -> u32 {
    var level = min(edge.level, countTrailingZeros(at));
    while SPLIT && level > 0u && is_split(edge, level, at) {
        level -= 1u;
    }
    return min(at + (1u << level), edge.cells);
}

/// Triangles at an edge.
fn triangles_at(edge: Edge) -> u32 {
    if edge.level == 0u {
        // the surface's own two triangles
        return select(0u, 1u, edge.side < 2u);
    }
    if !has_area(edge) {
        return 0u;
    }
    var count = 0u;
    var at = 0u;
    while at < edge.cells {
        at = part_end(edge, at);
        count += 1u;
    }
    return count;
}

@compute @workgroup_size(64)
fn count(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) lane: u32) {
    let thread = thread_number(group, groups, lane);
    if thread < 4u * leaf_count[3] {
        before_out[thread] = triangles_at(edge_of(thread));
    }
}

/// From the triangles of 64 edges to those of the edges before.
@compute @workgroup_size(64)
fn sums(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) lane: u32) {
    let number = thread_number(group, groups, lane);
    // (more threads than u32 counts edges: compared before it is multiplied)
    if number >= (4u * leaf_count[3] + GROUP - 1u) / GROUP {
        return;
    }
    let first = number * GROUP;
    let end = min(first + GROUP, 4u * leaf_count[3]);
    var sum = 0u;
    for (var i = first; i < end; i++) {
        let own = before_out[i];
        before_out[i] = sum;
        sum += own;
    }
    wanted_out[number] = sum;
}

/// Threads that go over the sums: as many as any adapter has, for the loops of each are bounded by its share.
const LANES: u32 = 256u;

var<workgroup> chunk_wants: array<u32, LANES>;

@compute @workgroup_size(LANES)
fn offsets(@builtin(local_invocation_index) lane: u32) {
    let groups = (4u * leaf_count[3] + GROUP - 1u) / GROUP;
    let chunk = (groups + LANES - 1u) / LANES;
    let first = lane * chunk;
    let end = min(first + chunk, groups);
    var sum = 0u;
    for (var i = first; i < end; i++) {
        sum += wanted[i];
    }
    chunk_wants[lane] = sum;
    workgroupBarrier();
    var at = 0u;
    var total = 0u;
    for (var i = 0u; i < LANES; i++) {
        total += chunk_wants[i];
        at += select(0u, chunk_wants[i], i < lane);
    }
    for (var i = first; i < end; i++) {
        place_out[i] = at;
        at += wanted[i];
    }
    if lane == 0u {
        needed[0] = total;
        // a mesh that does not fit is not drawn
        triangle_count[0] = select(0u, 3u * total, total <= params.capacity);
        triangle_count[1] = 1u;
        triangle_count[2] = 0u;
        triangle_count[3] = 0u;
    }
}

fn packed(sample: vec2<u32>) -> u32 {
    return sample.x | sample.y << 16u;
}

fn put(at: u32, a: vec2<u32>, b: vec2<u32>, c: vec2<u32>, level: u32) {
    if at < params.capacity {
        triangle[at] = vec4(packed(a), packed(b), packed(c), level);
    }
}

@compute @workgroup_size(64)
fn write(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) lane: u32) {
    let thread = thread_number(group, groups, lane);
    if thread >= 4u * leaf_count[3] {
        return;
    }
    let edge = edge_of(thread);
    var to = place[thread / GROUP] + before[thread];
    if edge.level == 0u {
        let low = edge.block.low;
        let high = edge.block.high;
        let ne = vec2(high.x, low.y);
        let sw = vec2(low.x, high.y);
        if edge.side < 2u {
            put(to, select(high, low, edge.side == 0u), select(ne, sw, edge.side == 0u), select(sw, ne, edge.side == 0u), 0u);
        }
        return;
    }
    if !has_area(edge) {
        return;
    }
    let is_turned = edge.side == NORTH || edge.side == EAST;
    var at = 0u;
    while at < edge.cells {
        let end = part_end(edge, at);
        let a = place_on(edge, select(at, end, is_turned));
        let b = place_on(edge, select(end, at, is_turned));
        put(to, a, b, edge.block.middle, edge.level);
        to += 1u;
        at = end;
    }
}
