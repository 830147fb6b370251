//!include lib/terrain.wgsl
// The square of ground that a sketch map is of.
//
// A kernel that includes this binds `sketch_square`, and has `terrain: Terrain` and `texels`, the texels along a side of the map, in its
// parameters.

/// Whole nodes of one level of the mean pyramid.
struct Square {
    /// The node that the north-west texel is; it may be beyond the border.
    corner: vec2<i32>,
    level: u32,
}

fn square() -> Square {
    return Square(vec2(sketch_square[0], sketch_square[1]), u32(sketch_square[2]));
}

/// Samples along a side of a texel.
fn texel_samples(square: Square) -> f32 {
    return f32(1u << square.level);
}

/// Relative sample coordinates of the square's north-west corner: half a sample before its first one.
fn square_start(terrain: Terrain, square: Square) -> vec2<f32> {
    return relative_cells(terrain, square.corner << vec2(square.level)) - 0.5;
}
