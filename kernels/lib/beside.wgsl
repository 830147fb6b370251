// What a rasterized triangle says of a pixel whose ray passes beside it.

/// The sign of a distance: its ray passes beside the triangle, or so close to its rim that rounding decides.
const BESIDE: u32 = 0x80000000u;
