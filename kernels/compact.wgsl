//!include lib/sum_before.wgsl
// Stream compaction: the numbers of the elements above a value, in order, with their count and the workgroups it takes to
// visit them. Reduce-then-scan as in scan.wgsl, with one bit an element.

struct Params {
    length: u32,
    tiles: u32,
    /// Elements above this are listed.
    above: f32,
    above_number: u32,
    /// Elements a workgroup of the kernel that visits the list takes, and the most workgroups a side of a dispatch can have.
    visitors: u32,
    most_groups: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> values: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> numbers: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> tile_count: array<u32>;
@group(0) @binding(4) var<storage, read> counted: array<u32>;
@group(0) @binding(5) var<storage, read_write> before: array<u32>;
@group(0) @binding(6) var<storage, read> tile_start: array<u32>;
@group(0) @binding(7) var<storage, read_write> list: array<u32>;
/// Workgroups along x, y and z, and the length of the list.
@group(0) @binding(8) var<storage, read_write> count: array<u32>;

/// The elements are u32 and not f32.
override NUMBERS: bool = false;

/// Vectors of four a thread takes; they stand next to each other. Their bits fill a word.
const RUN: u32 = 8u;

/// One bit for each of the four elements of a vector: is it listed?
fn listed(at: u32) -> u32 {
    let left = params.length - min(4u * at, params.length);
    if left == 0u {
        return 0u;
    }
    var above: vec4<bool>;
    if NUMBERS {
        above = numbers[at] > vec4(params.above_number);
    } else {
        above = values[at] > vec4(params.above);
    }
    let bits = vec4<u32>(above) * vec4(1u, 2u, 4u, 8u);
    return (bits.x | bits.y | bits.z | bits.w) & ((1u << min(left, 4u)) - 1u);
}

/// The bits of a thread's elements.
fn mask(first: u32) -> u32 {
    var bits = 0u;
    for (var i = 0u; i < RUN; i++) {
        bits |= listed(first + i) << (4u * i);
    }
    return bits;
}

@compute @workgroup_size(64)
fn reduce(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let own = countOneBits(mask((group.x * THREADS + thread) * RUN));
    let all = sum_before(thread, own) + own;
    if thread == THREADS - 1u {
        tile_count[group.x] = all;
    }
}

/// One workgroup: how many are listed before each tile, and the workgroups to visit all of them.
@compute @workgroup_size(64)
fn scan_tiles(@builtin(local_invocation_index) thread: u32) {
    let run = (params.tiles + THREADS - 1u) / THREADS;
    let first = min(thread * run, params.tiles);
    let end = min(first + run, params.tiles);
    var own = 0u;
    for (var i = first; i < end; i++) {
        own += counted[i];
    }
    var sum = sum_before(thread, own);
    for (var i = first; i < end; i++) {
        before[i] = sum;
        sum += counted[i];
    }
    if thread == THREADS - 1u {
        let groups = (sum + params.visitors - 1u) / params.visitors;
        let wide = min(groups, params.most_groups);
        count[0] = wide;
        count[1] = (groups + max(wide, 1u) - 1u) / max(wide, 1u);
        count[2] = min(groups, 1u);
        count[3] = sum;
    }
}

@compute @workgroup_size(64)
fn scatter(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let first = (group.x * THREADS + thread) * RUN;
    var bits = mask(first);
    var at = tile_start[group.x] + sum_before(thread, countOneBits(bits));
    while bits != 0u {
        list[at] = 4u * first + firstTrailingBit(bits);
        bits &= bits - 1u;
        at += 1u;
    }
}
