// How a camera sees, beside the rays of its pixels: its axes, its sides, and what it makes of a metre.

struct View {
    /// World axes of the view, as rows: right, up, forward.
    right: vec3<f32>,
    /// Pixels from the middle of the picture to where a ray leaves it at 45 degrees.
    focal_px: f32,
    up: vec3<f32>,
    /// Of all rays with length 1 along the view direction: the longest.
    ray_most: f32,
    forward: vec3<f32>,
    /// The most that a metre of height moves such a ray, at a distance of 1.
    tilt_most: f32,
    /// Inward normals of the picture's sides.
    side_left: vec3<f32>,
    side_right: vec3<f32>,
    side_top: vec3<f32>,
    side_bottom: vec3<f32>,
    /// Tangents of half the field of view.
    half_tan: vec2<f32>,
    /// Nothing of the surface is nearer along the view direction, unless it is closer to the eye than any is on foot.
    @size(8) near_m: f32,
}
