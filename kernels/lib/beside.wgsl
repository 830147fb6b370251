// What a rasterized triangle says of a pixel whose ray passes beside it.

/// The sign of a distance: its ray passes beside the triangle.
const BESIDE: u32 = 0x80000000u;
