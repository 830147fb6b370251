// Layout of a pyramid in one buffer: level k >= 1 stands below level k - 1, all with the same row stride.
// (Each level starts a row later than it must, so that levels of a single row do not meet.)
// Level k of a base of (w, h) has ceil(w / 2^k) x ceil(h / 2^k) nodes.

/// Index of node `at` of `level`. `stride` is the width of level 1, `tall` the power of two not below the
/// height of the base.
fn pyramid_index(stride: u32, tall: u32, level: u32, at: vec2<u32>) -> u32 {
    return (tall - (tall >> (level - 1u)) + level - 1u + at.y) * stride + at.x;
}

fn level_size(base: vec2<u32>, level: u32) -> vec2<u32> {
    return (base + (1u << level) - 1u) >> vec2<u32>(level);
}
