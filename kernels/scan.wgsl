//!include lib/sum_before.wgsl
// Exclusive prefix sums by reduce-then-scan: a sum for each tile, the sums before each tile, then the tiles themselves. No
// workgroup waits for another (Merrill, Garland 2016, describe the family; their single pass has to spin, which not every
// adapter survives).

struct Params {
    /// Elements, and tiles of TILE of them.
    length: u32,
    tiles: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> source: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> tile_sum: array<u32>;
/// The sum of all tiles before each tile.
@group(0) @binding(3) var<storage, read> tile_start: array<u32>;
@group(0) @binding(4) var<storage, read_write> sums: array<vec4<u32>>;
/// The sum of everything.
@group(0) @binding(5) var<storage, read_write> total: array<u32>;
@group(0) @binding(6) var<storage, read> summed: array<u32>;
@group(0) @binding(7) var<storage, read_write> before: array<u32>;

/// Vectors of four a thread takes; they stand next to each other.
const RUN: u32 = 8u;

/// Vector `at` of the source with nothing beyond its end.
fn load(at: u32) -> vec4<u32> {
    let left = params.length - min(4u * at, params.length);
    if left >= 4u {
        return source[at];
    }
    if left == 0u {
        return vec4(0u);
    }
    return source[at] * vec4<u32>(vec4(0u, 1u, 2u, 3u) < vec4(left));
}

@compute @workgroup_size(64)
fn reduce(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let first = (group.x * THREADS + thread) * RUN;
    var sum = vec4(0u);
    for (var i = 0u; i < RUN; i++) {
        sum += load(first + i);
    }
    let own = sum.x + sum.y + sum.z + sum.w;
    let all = sum_before(thread, own) + own;
    if thread == THREADS - 1u {
        tile_sum[group.x] = all;
    }
}

/// One workgroup: the sums before each tile, and the total.
@compute @workgroup_size(64)
fn scan_tiles(@builtin(local_invocation_index) thread: u32) {
    let run = (params.tiles + THREADS - 1u) / THREADS;
    let first = min(thread * run, params.tiles);
    let end = min(first + run, params.tiles);
    var own = 0u;
    for (var i = first; i < end; i++) {
        own += summed[i];
    }
    var sum = sum_before(thread, own);
    for (var i = first; i < end; i++) {
        before[i] = sum;
        sum += summed[i];
    }
    if thread == THREADS - 1u {
        total[0] = sum;
    }
}

@compute @workgroup_size(64)
fn scan(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let first = (group.x * THREADS + thread) * RUN;
    var values: array<vec4<u32>, 8>;
    var own = 0u;
    for (var i = 0u; i < RUN; i++) {
        let value = load(first + i);
        values[i] = value;
        own += value.x + value.y + value.z + value.w;
    }
    var sum = tile_start[group.x] + sum_before(thread, own);
    for (var i = 0u; i < RUN; i++) {
        let value = values[i];
        let inner = vec4(0u, value.x, value.x + value.y, value.x + value.y + value.z);
        if 4u * (first + i) < params.length {
            sums[first + i] = inner + sum;
        }
        sum += inner.w + value.w;
    }
}
