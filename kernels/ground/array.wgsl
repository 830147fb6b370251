//!include ground/surface.wgsl
//!include ground/nodes.wgsl
// The ground as an array of height samples, row by row, row 0 in the north.

@group(1) @binding(0) var<storage, read> ground_samples: array<f32>;

/// Height of a sample of the terrain.
fn ground_height(sample: vec2<u32>) -> f32 {
    return ground_samples[sample.y * GROUND_COLUMNS + sample.x];
}

/// Heights of the corners of a cell of the terrain.
fn ground_corners(cell: vec2<i32>) -> vec4<f32> {
    let at = u32(cell.y) * GROUND_COLUMNS + u32(cell.x);
    let below = at + GROUND_COLUMNS;
    return vec4(ground_samples[at], ground_samples[at + 1u], ground_samples[below], ground_samples[below + 1u]);
}

/// The four samples from (x, y) on: upper left, upper right, lower left, lower right. Beyond the border the last ones repeat.
fn ground_four(first: vec2<i32>) -> vec4<f32> {
    let last = vec2<i32>(ground_size()) - 1;
    let low = vec2<u32>(clamp(first, vec2(0), last));
    let high = vec2<u32>(clamp(first + 1, vec2(0), last));
    return vec4(ground_height(low), ground_height(vec2(high.x, low.y)), ground_height(vec2(low.x, high.y)), ground_height(high));
}
