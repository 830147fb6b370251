//!include lib/place.wgsl
// Stream compaction: the numbers of the elements above a value, in order, with their count and the workgroups it takes to
// visit them. The elements are looked at once, and leave a bit each; the counts of 32 of them are summed by scan.wgsl.
// Where several rows make one element, it is above the value if any of them is, and has the number of the first.

struct Params {
    length: u32,
    /// Columns and rows of what is looked at, if more than one row makes an element.
    size: vec2<u32>,
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

/// Rows that make one element.
override ROWS: u32 = 1;
/// A row is a whole number of four values.
override IS_ALIGNED: bool = true;

fn are_above(four: u32) -> vec4<bool> {
    if NUMBERS {
        return numbers[four] > vec4(params.above_number);
    }
    return values[four] > vec4(params.above);
}

fn is_above(at: u32) -> bool {
    if NUMBERS {
        return numbers[at / 4u][at % 4u] > params.above_number;
    }
    return values[at / 4u][at % 4u] > params.above;
}

/// Four elements of several rows.
fn are_columns_above(at: u32) -> vec4<bool> {
    var above = vec4(false);
    for (var i = 0u; i < select(4u, 1u, IS_ALIGNED); i++) {
        let first = place_of(min(4u * at + i, params.length - 1u), params.size.x);
        for (var row = first.y * ROWS; row < min(first.y * ROWS + ROWS, params.size.y); row++) {
            let value = row * params.size.x + first.x;
            if IS_ALIGNED {
                above |= are_above(value / 4u);
            } else {
                above[i] |= is_above(value);
            }
        }
    }
    return above;
}

fn bits_of(at: u32) -> u32 {
    var above: vec4<bool>;
    if ROWS == 1u {
        above = are_above(min(at, (params.length - 1u) / 4u));
    } else {
        above = are_columns_above(at);
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
        var number = 32u * word + firstTrailingBit(bits);
        if ROWS > 1u {
            number += place_of(number, params.size.x).y * (ROWS - 1u) * params.size.x;
        }
        list[at] = number;
        bits &= bits - 1u;
        at += 1u;
    }
}
