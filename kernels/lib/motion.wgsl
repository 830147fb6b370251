// How the camera came to where it is.

struct Motion {
    /// The way that the eye has come since the first frame, in metres, and what the camera has turned, in radians.
    @align(16) travelled_m: f32,
    turned: f32,
    /// 1 where the frame before is not what was there a moment ago: nothing of it counts.
    is_cut: u32,
}
