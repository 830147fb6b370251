//!include ground/surface.wgsl
// Lowest and highest of the ground over a node of 2^level cells a side, the samples on its border included; `HeightPyramid` makes them.

@group(1) @binding(2) var<storage, read> ground_max: array<f32>;
@group(1) @binding(3) var<storage, read> ground_min: array<f32>;

/// Where node `at` of a level is in everything that is kept for each node over cells.
fn ground_node(level: u32, at: vec2<u32>) -> u32 {
    return pyramid_index(ground_cells(), level, at);
}

fn ground_highest(node: u32) -> f32 {
    return ground_max[node];
}

fn ground_lowest(node: u32) -> f32 {
    return ground_min[node];
}
