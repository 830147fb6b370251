// Stream compaction: the numbers of the elements above a value, in order, with their count and the workgroups it takes to
// visit them. The elements are looked at once, and leave a bit each; the counts of 32 of them are summed by scan.wgsl.

struct Params {
    length: u32,
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
/// For 32 elements each: which are listed, and how many.
@group(0) @binding(3) var<storage, read_write> masks_out: array<u32>;
@group(0) @binding(4) var<storage, read_write> counts: array<u32>;
@group(0) @binding(5) var<storage, read> masks: array<u32>;
/// How many are listed before them.
@group(0) @binding(6) var<storage, read> starts: array<u32>;
@group(0) @binding(7) var<storage, read_write> list: array<u32>;
@group(0) @binding(8) var<storage, read> total: array<u32>;
/// Workgroups along x, y and z, and the length of the list.
@group(0) @binding(9) var<storage, read_write> count: array<u32>;

/// The elements are u32 and not f32.
override NUMBERS: bool = false;
/// There is no whole number of 32 elements.
override HAS_TAIL: bool = true;

fn bits_of(at: u32) -> u32 {
    let place = min(at, (params.length - 1u) / 4u);
    var above: vec4<bool>;
    if NUMBERS {
        above = numbers[place] > vec4(params.above_number);
    } else {
        above = values[place] > vec4(params.above);
    }
    let bits = select(vec4(0u), vec4(1u, 2u, 4u, 8u), above);
    return (bits.x | bits.y) | (bits.z | bits.w);
}

fn word_of(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.y * groups.x * 64u + id.x;
}

@compute @workgroup_size(64)
fn look(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let word = word_of(id, groups);
    if word * 32u >= params.length {
        return;
    }
    let first = word * 8u;
    let low = (bits_of(first) | bits_of(first + 1u) << 4u) | (bits_of(first + 2u) << 8u | bits_of(first + 3u) << 12u);
    let high = (bits_of(first + 4u) | bits_of(first + 5u) << 4u) | (bits_of(first + 6u) << 8u | bits_of(first + 7u) << 12u);
    var mask = low | high << 16u;
    if HAS_TAIL {
        let left = min(params.length - word * 32u, 32u);
        mask &= 0xffffffffu >> (32u - left);
    }
    masks_out[word] = mask;
    counts[word] = countOneBits(mask);
}

@compute @workgroup_size(1)
fn plan_visit() {
    let groups = (total[0] + params.visitors - 1u) / params.visitors;
    let wide = min(groups, params.most_groups);
    count[0] = wide;
    count[1] = (groups + max(wide, 1u) - 1u) / max(wide, 1u);
    count[2] = min(groups, 1u);
    count[3] = total[0];
}

@compute @workgroup_size(64)
fn scatter(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let word = word_of(id, groups);
    if word * 32u >= params.length {
        return;
    }
    var bits = masks[word];
    var at = starts[word];
    while bits != 0u {
        list[at] = 32u * word + firstTrailingBit(bits);
        bits &= bits - 1u;
        at += 1u;
    }
}
