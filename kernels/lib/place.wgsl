// Columns and rows of numbered elements.

/// Column and row of an element in at most 2^23 rows of `width`. (A division of integers is slow where there are no vectors of them, and what
/// this one in floats may be off by one row is put right.)
fn place_of(index: u32, width: u32) -> vec2<u32> {
    let across = i32(width);
    var row = i32((f32(index) + 0.5) / f32(across));
    row -= select(0, 1, i32(index) < row * across);
    row += select(0, 1, i32(index) >= (row + 1) * across);
    return vec2<u32>(vec2(i32(index) - row * across, row));
}
