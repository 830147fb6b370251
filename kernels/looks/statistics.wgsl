//!include lib/look.wgsl
// What the values of a buffer are like: lowest, highest, sum, what is no number, and how many fall into each part of a range.
// Each thread walks over its own part and leaves what it found; the host adds the threads up.

struct Params {
    format: Format,
    minus: Format,
    scale: Scale,
    first: u32,
    stride: u32,
    minus_first: u32,
    minus_stride: u32,
    extent: vec2<u32>,
    threads: u32,
    /// Bins of keys: what they begin with, and by how many bits a key is shortened.
    first_key: u32,
    key_shift: u32,
    bins: u32,
    by_key: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> data: array<u32>;
@group(0) @binding(2) var<storage, read> other: array<u32>;
/// Eight words a thread: lowest, highest, sum, numbers, missing, NaN, infinite, negative infinite.
@group(0) @binding(3) var<storage, read_write> found: array<u32>;
@group(0) @binding(4) var<storage, read_write> bins: array<atomic<u32>>;

fn shown_at(element: u32) -> Shown {
    let place = vec2(element % params.extent.x, element / params.extent.x);
    let index = params.first + place.y * params.stride + place.x;
    let word = data[index * params.format.words + params.format.word];
    if !IS_DIFFERENCE {
        return shown_of(word, params.format, KIND);
    }
    let other_index = params.minus_first + place.y * params.minus_stride + place.x;
    let other_word = other[other_index * params.minus.words + params.minus.word];
    if KIND == COLOUR {
        return Shown(colour_difference(word, other_word), NUMBER);
    }
    return difference(shown_of(word, params.format, KIND), shown_of(other_word, params.minus, MINUS_KIND));
}

@compute @workgroup_size(64)
fn sum(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.threads {
        return;
    }
    let elements = params.extent.x * params.extent.y;
    var lowest = bitcast<f32>(0x7f7fffffu);
    var highest = -lowest;
    var total = 0.0;
    var lost = 0.0;
    var counts = array<u32, 5>(0u, 0u, 0u, 0u, 0u);
    for (var element = id.x; element < elements; element += params.threads) {
        let shown = shown_at(element);
        counts[shown.kind] += 1u;
        if shown.kind == NUMBER {
            lowest = min(lowest, shown.value);
            highest = max(highest, shown.value);
            let term = shown.value - lost;
            let next = total + term;
            lost = (next - total) - term;
            total = next;
        }
    }
    let at = id.x * 8u;
    found[at] = bitcast<u32>(lowest);
    found[at + 1u] = bitcast<u32>(highest);
    found[at + 2u] = bitcast<u32>(total);
    for (var kind = 0u; kind < 5u; kind++) {
        found[at + 3u + kind] = counts[kind];
    }
}

/// A number that is larger for a larger value.
fn key_of(value: f32) -> u32 {
    let bits = bitcast<u32>(value);
    return select(bits | 0x80000000u, ~bits, (bits >> 31u) == 1u);
}

@compute @workgroup_size(64)
fn count(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.threads {
        return;
    }
    let elements = params.extent.x * params.extent.y;
    for (var element = id.x; element < elements; element += params.threads) {
        let shown = shown_at(element);
        if shown.kind != NUMBER {
            continue;
        }
        if params.by_key != 0u {
            let key = key_of(shown.value);
            let bin = (key - params.first_key) >> params.key_shift;
            if key >= params.first_key && bin < params.bins {
                atomicAdd(&bins[bin], 1u);
            }
        } else if shown.value >= params.scale.low && shown.value <= params.scale.high {
            let bin = u32(share_of(shown.value, params.scale) * f32(params.bins));
            atomicAdd(&bins[min(bin, params.bins - 1u)], 1u);
        }
    }
}
