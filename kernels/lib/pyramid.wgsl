// Layout of a pyramid in one buffer: level k >= 1 stands below level k - 1, all with the same row stride.
// (Each level starts a row later than it must, so that levels of a single row do not meet.)
// Level k of a base of (w, h) has ceil(w / 2^k) x ceil(h / 2^k) nodes.

/// Where the levels of a pyramid are.
struct Pyramid {
    /// Width of level 1.
    @align(16) stride: u32,
    /// The power of two not below the height of the base.
    tall_pow2: u32,
    /// The coarsest level, the first with a single node.
    top: u32,
}

/// Index of node `at` of `level`.
fn pyramid_index(pyramid: Pyramid, level: u32, at: vec2<u32>) -> u32 {
    let tall_pow2 = pyramid.tall_pow2;
    return (tall_pow2 - (tall_pow2 >> (level - 1u)) + level - 1u + at.y) * pyramid.stride + at.x;
}

fn level_size(base: vec2<u32>, level: u32) -> vec2<u32> {
    return (base + (1u << level) - 1u) >> vec2<u32>(level);
}

/// The four nodes around a place in a level, and the place between the first (north-west) and the last of them.
struct Around {
    low: vec2<i32>,
    high: vec2<i32>,
    w: vec2<f32>,
}

/// `cell` and `fraction` are the place in sample coordinates; a node of the level stands `middle` samples from its first one;
/// `last` is the level's last node: beyond the outermost nodes everything stays as it is there.
fn around(level: u32, cell: vec2<i32>, fraction: vec2<f32>, middle: f32, last: vec2<i32>) -> Around {
    // whole cells and fraction apart: far from the origin a sum of both would lose the fraction
    let node = (cell - vec2(i32(middle))) >> vec2(level);
    let inside = vec2<f32>(cell - (node << vec2(level))) - middle;
    let place = (inside + fraction) / f32(1u << level);
    let carry = vec2<i32>(floor(place));
    let low = node + carry;
    return Around(clamp(low, vec2(0), last), clamp(low + 1, vec2(0), last), place - vec2<f32>(carry));
}
