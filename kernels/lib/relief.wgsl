// How high the ground is, seen from the eye.

struct Relief {
    /// Lowest height of the ground above the eye, and from there to the highest, in metres.
    @align(16) low_m: f32,
    range_m: f32,
}
