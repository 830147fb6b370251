// Nodes of the quadtree as the vertices that are split (Lee, Shin 2011, section 2.3): a block is known by its centre. In half cells
// from the north-west sample the centre of a block of 2^level cells is an odd multiple of 2^level, so it tells the level as well.

/// What a vertex carries beside its place ("temporary buffer", section 3).
const FLAG: u32 = 1u;
/// Ours: outside the picture.
const OUT_OF_SIGHT: u32 = 32u;

/// x: column and row of the centre in half cells, 16 bits each; y: the flag, above it four bits of level.
fn node_of(level: u32, at: vec2<u32>) -> vec2<u32> {
    let centre = (2u * at + 1u) << vec2(level);
    return vec2(centre.x | centre.y << 16u, level << 1u);
}

fn level_from_centre(node: vec2<u32>) -> u32 {
    return countTrailingZeros(node.x);
}

fn level_carried(node: vec2<u32>) -> u32 {
    return (node.y >> 1u) & 15u;
}

/// Column and row of the block among those of its level.
fn place_of(node: vec2<u32>, level: u32) -> vec2<u32> {
    return vec2(node.x & 0xffffu, node.x >> 16u) >> vec2(level + 1u);
}
