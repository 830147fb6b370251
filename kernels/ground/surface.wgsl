//!include lib/pyramid.wgsl
// What the surface is between height samples. Nothing else in WGSL knows it; its half in f64 is `src/ground/cell.rs`.
//
// A place in a cell is in [0, 1]^2 from its north-west corner: columns to the east, rows to the south. Heights of a cell's corners are
// north-west, north-east, south-west, south-east.

/// The surface in a cell is one bilinear patch. Otherwise it is two triangles, which meet on the diagonal from north-east to south-west.
override BILINEAR: bool = false;

// How many samples there are is part of the pipeline, so that it costs nothing where it is used; the plan fills it in. (Lengths in metres
// are not: there are adapters that divide by a constant with other bits than by a number.)
override GROUND_COLUMNS: u32 = 2u;
override GROUND_ROWS: u32 = 2u;
// levels over cells (lowest and highest), and over samples (means)
override GROUND_CELLS_STRIDE: u32 = 1u;
override GROUND_CELLS_TALL_POW2: u32 = 1u;
override GROUND_CELLS_TOP: u32 = 1u;
override GROUND_MEANS_STRIDE: u32 = 1u;
override GROUND_MEANS_TALL_POW2: u32 = 2u;
override GROUND_MEANS_TOP: u32 = 1u;

/// Columns and rows of samples.
fn ground_size() -> vec2<u32> {
    return vec2(GROUND_COLUMNS, GROUND_ROWS);
}

/// Levels over cells: lowest and highest heights.
fn ground_cells() -> Pyramid {
    return Pyramid(GROUND_CELLS_STRIDE, GROUND_CELLS_TALL_POW2, GROUND_CELLS_TOP);
}

/// Levels over samples: means.
fn ground_means() -> Pyramid {
    return Pyramid(GROUND_MEANS_STRIDE, GROUND_MEANS_TALL_POW2, GROUND_MEANS_TOP);
}

/// Positive south-east of the diagonal, negative north-west of it.
fn ground_past_diagonal(place: vec2<f32>) -> f32 {
    return place.x + place.y - 1.0;
}

/// Which of the two triangles a place is on; the diagonal itself belongs to this one.
fn ground_is_north_west(place: vec2<f32>) -> bool {
    return place.x + place.y <= 1.0;
}

/// Height of the surface of triangles, whatever the scene's surface is.
fn ground_on_triangles(h: vec4<f32>, place: vec2<f32>) -> f32 {
    let north_west = h.x + (h.y - h.x) * place.x + (h.z - h.x) * place.y;
    let south_east = h.w + (h.z - h.w) * (1.0 - place.x) + (h.y - h.w) * (1.0 - place.y);
    return select(south_east, north_west, ground_is_north_west(place));
}

/// Height of the patch.
fn ground_on_patch(h: vec4<f32>, place: vec2<f32>) -> f32 {
    return mix(mix(h.x, h.y, place.x), mix(h.z, h.w, place.x), place.y);
}

/// Height of the surface at a place in a cell.
fn ground_surface(h: vec4<f32>, place: vec2<f32>) -> f32 {
    if BILINEAR {
        return ground_on_patch(h, place);
    }
    return ground_on_triangles(h, place);
}

/// Height of the surface on the diagonal, where triangles meet; `place` is on it.
fn ground_on_diagonal(h: vec4<f32>, place: vec2<f32>) -> f32 {
    return mix(h.z, h.y, place.x);
}

/// Slope of one of the triangles, in metres a cell.
fn ground_slope(h: vec4<f32>, is_north_west: bool) -> vec2<f32> {
    return select(vec2(h.w - h.z, h.w - h.y), vec2(h.y - h.x, h.z - h.x), is_north_west);
}

/// By how much a cell is not flat: what the patch is twisted by, and twice the distance of its two diagonals.
fn ground_twist(h: vec4<f32>) -> f32 {
    return h.x - h.y - h.z + h.w;
}
