//!include lib/terrain.wgsl
// The square of ground that a sketch map is of.
//
// A kernel that includes this binds `sketch_square`, and has `terrain: Terrain` and `texels`, the texels along a side of the map, in its
// parameters.

/// Texels are whole nodes of a level of the mean pyramid, or, while the level changes by degrees, equal parts that are smaller than those.
struct Square {
    /// The north-west sample; it may be beyond the border.
    first: vec2<i32>,
    /// Samples along a side.
    side: i32,
    level: u32,
}

fn square() -> Square {
    return Square(vec2(sketch_square[0], sketch_square[1]), sketch_square[2], u32(sketch_square[3]));
}

/// Samples along a side of a texel.
fn texel_samples(square: Square) -> f32 {
    return f32(square.side) / f32(params.texels);
}

/// The level of the pyramid that texels are as large as the nodes of.
fn texel_level(square: Square) -> f32 {
    return select(log2(texel_samples(square)), f32(square.level), square.side == i32(params.texels << square.level));
}

/// The sample that a texel begins in.
fn texel_first(square: Square, texel: vec2<i32>) -> vec2<i32> {
    return square.first + (texel * square.side) / i32(params.texels);
}

/// The first and the last of the map's texels that begin on terrain, by columns and by rows.
fn first_terrain(square: Square) -> vec2<i32> {
    let before = vec2<u32>(max(-square.first, vec2(0)));
    return vec2<i32>((before * params.texels + u32(square.side) - 1u) / u32(square.side));
}

fn last_terrain(square: Square) -> vec2<i32> {
    let samples = vec2<u32>(max(vec2<i32>(params.terrain.size) - square.first, vec2(0)));
    let texels = vec2<i32>((samples * params.texels + u32(square.side) - 1u) / u32(square.side));
    return min(texels, vec2(i32(params.texels))) - 1;
}

/// Relative sample coordinates of a texel's middle.
fn texel_middle(square: Square, texel: vec2<i32>) -> vec2<f32> {
    let first = texel_first(square, texel);
    let rest = texel * square.side - (first - square.first) * i32(params.texels);
    let half = (vec2<f32>(rest) + 0.5 * f32(square.side)) / f32(params.texels);
    return relative_cells(params.terrain, first) + (half - 0.5);
}

/// Relative sample coordinates of the square's north-west corner: half a sample before its first one.
fn square_start(terrain: Terrain, square: Square) -> vec2<f32> {
    return relative_cells(terrain, square.first) - 0.5;
}
