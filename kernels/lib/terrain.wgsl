// Where the height samples are, seen from the eye.

/// Sample coordinates are (column, row), row 0 in the north. Positions relative to the eye are the exact
/// difference of integers minus a fraction of at most a half, so they keep their digits on any terrain, and next to the eye all of them.
struct Terrain {
    /// Columns and rows of samples.
    size: vec2<u32>,
    /// Column and row of the sample nearest to the eye; outside the terrain for an eye outside it.
    eye_cell: vec2<i32>,
    /// The eye's position from that sample, in [-0.5, 0.5].
    eye_fraction: vec2<f32>,
    /// Metres between columns and between rows.
    cell_m: vec2<f32>,
    /// The eye's height in metres as the sum of two f32.
    /// (Sized so that the structure can stand anywhere in a uniform one.)
    @size(16) eye_height_m: vec2<f32>,
}

/// A distance no terrain has: the surface was not hit. Dumped as NaN.
const NO_SURFACE: f32 = -1.0;

/// Sample coordinates relative to the eye, in cells.
fn relative_cells(terrain: Terrain, sample: vec2<i32>) -> vec2<f32> {
    return vec2<f32>(sample - terrain.eye_cell) - terrain.eye_fraction;
}

/// Camera-relative x (east) and y (north) in metres of relative sample coordinates.
fn world_from_cells(terrain: Terrain, cells: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(cells.x, -cells.y) * terrain.cell_m;
}

/// Relative sample coordinates of a camera-relative position.
fn cells_from_world(terrain: Terrain, position_m: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(position_m.x, -position_m.y) / terrain.cell_m;
}

/// Height above the eye in metres.
fn relative_height(terrain: Terrain, height_m: f32) -> f32 {
    return (height_m - terrain.eye_height_m.x) - terrain.eye_height_m.y;
}

/// Sample coordinates of a position, as the exact cell and what is left of it.
fn cell_of(terrain: Terrain, cells: vec2<f32>) -> vec2<i32> {
    // far outside, integers would overflow; the border is as good
    let reach = vec2<f32>(vec2<i32>(terrain.size) + abs(terrain.eye_cell) + 2);
    return vec2<i32>(floor(clamp(cells + terrain.eye_fraction, -reach, reach))) + terrain.eye_cell;
}
