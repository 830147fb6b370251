//!include ground/surface.wgsl
//!include ground/nodes.wgsl
// The ground as an image of height samples, row 0 in the north: software adapters fetch four samples of an image at once.

@group(1) @binding(0) var ground_image: texture_2d<f32>;
/// Clamped to the edge.
@group(1) @binding(1) var ground_nearest: sampler;

/// Height of a sample of the terrain.
fn ground_height(sample: vec2<u32>) -> f32 {
    return textureLoad(ground_image, sample, 0).x;
}

/// Heights of the corners of a cell of the terrain.
fn ground_corners(cell: vec2<i32>) -> vec4<f32> {
    return ground_four(cell);
}

/// The four samples from (x, y) on: upper left, upper right, lower left, lower right. Beyond the border the last ones repeat.
fn ground_four(first: vec2<i32>) -> vec4<f32> {
    // one gather at the point between the four (signed: processors turn u32 into floats slowly)
    let middle = vec2<f32>(first + 1) / vec2<f32>(ground_size());
    return textureGather(0, ground_image, ground_nearest, middle).wzxy;
}
