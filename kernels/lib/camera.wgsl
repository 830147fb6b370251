// Camera of one frame, with the eye at the origin: world axes (x east, y north, z up), metres.

/// `corner + x right + y down` is the ray of image position (x, y) in pixels, with length 1 along the view
/// direction. Each vector is the sum of `_hi`, a multiple of 2^-22, and `_lo`, what is missing: the products
/// and sums of the `_hi` parts are exact in f32, so rays close to the horizon keep their digits.
struct Camera {
    corner_hi: vec3<f32>,
    corner_lo: vec3<f32>,
    right_hi: vec3<f32>,
    right_lo: vec3<f32>,
    down_hi: vec3<f32>,
    down_lo: vec3<f32>,
    viewport: vec2<u32>,
}

/// Not normalised.
fn view_ray(camera: Camera, pixel: vec2<f32>) -> vec3<f32> {
    let hi = camera.corner_hi + pixel.x * camera.right_hi + pixel.y * camera.down_hi;
    let lo = camera.corner_lo + pixel.x * camera.right_lo + pixel.y * camera.down_lo;
    return hi + lo;
}

fn view_ray_of_pixel(camera: Camera, pixel: vec2<u32>) -> vec3<f32> {
    return view_ray(camera, vec2<f32>(pixel) + 0.5);
}
