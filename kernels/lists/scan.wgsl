// Exclusive prefix sums by reduce-then-scan. A thread takes a run of elements: first all runs are summed, then the sums before
// each run are found the same way, a level up, and then each run is summed again from there. Nobody waits for anybody: there
// is no barrier, and no spinning on what another workgroup may not have done (Merrill, Garland 2016, compare the family).

struct Params {
    length: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> source: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> run_sum: array<u32>;
/// The sum of all runs before each run.
@group(0) @binding(3) var<storage, read> run_start: array<u32>;
@group(0) @binding(4) var<storage, read_write> sums: array<vec4<u32>>;
/// The sum of everything.
@group(0) @binding(5) var<storage, read_write> total: array<u32>;

/// The last run is shorter than the others.
override HAS_TAIL: bool = true;
/// There is one run only.
override IS_TOP: bool = false;

/// Elements of a run, and vectors of four.
const RUN: u32 = 32u;
const VECTORS: u32 = 8u;

/// Vector `at` of the source with nothing beyond its end.
fn load(at: u32) -> vec4<u32> {
    if !HAS_TAIL {
        return source[at];
    }
    let value = source[min(at, (params.length - 1u) / 4u)];
    return select(vec4(0u), value, vec4(4u * at) + vec4(0u, 1u, 2u, 3u) < vec4(params.length));
}

fn run_of(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.y * groups.x * 64u + id.x;
}

@compute @workgroup_size(64)
fn sum_runs(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = run_of(id, groups);
    if run * RUN >= params.length {
        return;
    }
    let first = run * VECTORS;
    let a = (load(first) + load(first + 1u)) + (load(first + 2u) + load(first + 3u));
    let b = (load(first + 4u) + load(first + 5u)) + (load(first + 6u) + load(first + 7u));
    let c = a + b;
    run_sum[run] = (c.x + c.y) + (c.z + c.w);
}

/// Writes the sums before a vector's elements, and adds the vector to the sum.
fn put(at: u32, sum: u32) -> u32 {
    let value = load(at);
    let inner = vec4(0u, value.x, value.x + value.y, value.x + value.y + value.z);
    if !HAS_TAIL {
        sums[at] = inner + sum;
    } else if 4u * at < params.length {
        sums[at] = inner + sum;
    }
    return sum + inner.w + value.w;
}

@compute @workgroup_size(64)
fn scan_runs(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = run_of(id, groups);
    if run * RUN >= params.length {
        return;
    }
    let first = run * VECTORS;
    var sum = 0u;
    if !IS_TOP {
        sum = run_start[run];
    }
    sum = put(first, sum);
    sum = put(first + 1u, sum);
    sum = put(first + 2u, sum);
    sum = put(first + 3u, sum);
    sum = put(first + 4u, sum);
    sum = put(first + 5u, sum);
    sum = put(first + 6u, sum);
    sum = put(first + 7u, sum);
    if IS_TOP {
        total[0] = sum;
    }
}
