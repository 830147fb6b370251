// A block of the quadtree: a square of 2^level cells a side. Beyond the terrain's last column and row everything moves onto them,
// so that a terrain of any size has a whole quadtree, and the blocks at its border are narrower.

struct Block {
    /// Samples of its north-west corner, its centre and its south-east corner.
    low: vec2<u32>,
    middle: vec2<u32>,
    high: vec2<u32>,
}

/// Block `at` of a level of at least 1; `last` is the terrain's last sample.
fn block_of(level: u32, at: vec2<u32>, last: vec2<u32>) -> Block {
    let side = 1u << level;
    let low = at << vec2(level);
    return Block(low, min(low + side / 2u, last), min(low + side, last));
}
