// The surface in the cells next to the eye, as formulas whose origin is the eye.
//
// Between samples in f32 the surface is known to a part of what its corners are apart, and next to the eye that is more than what the eye
// stands above it. There the formulas come from f64, with what has to cancel already cancelled.

/// Cells a side, around the sample nearest to the eye.
const FOREGROUND: i32 = 4;

/// Of each cell, by rows from the north-west: height above the eye at the eye's place, and metres more for each cell to the east and to
/// the south. The cell's surface is this plane, in and beyond the cell.
struct Foreground {
    /// Of the north-west triangle; w is where the diagonal is, as the sum of the places on it. Of a patch, w times the product of the
    /// place's columns and rows is added.
    @align(16) north_west: array<vec4<f32>, 16>,
    /// Of the south-east triangle.
    south_east: array<vec4<f32>, 16>,
    /// No height in these cells is lower or higher above the eye; a little more than that, so that rounding elsewhere cannot undo it.
    @size(16) range_m: vec2<f32>,
}

/// The number of a cell in the foreground; `from_eye` is in cells from the sample nearest to the eye.
fn foreground_number(from_eye: vec2<i32>) -> i32 {
    let at = from_eye + FOREGROUND / 2;
    let is_inside = all(at >= vec2(0)) && all(at < vec2(FOREGROUND));
    return select(-1, at.y * FOREGROUND + at.x, is_inside);
}
