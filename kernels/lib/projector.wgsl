// The projector of a projected grid: Livny et al. 2008, Eq. 1.

/// Its eye and the base plane relative to the camera's eye, metres; the ray of grid point (u, v) is `corner + u right + v down`.
struct Projector {
    eye_m: vec3<f32>,
    base_m: f32,
    corner: vec3<f32>,
    right: vec3<f32>,
    down: vec3<f32>,
}

/// Where the ray through a grid point meets the base plane, in metres from the camera's eye.
fn ground(projector: Projector, uv: vec2<f32>) -> vec2<f32> {
    let ray = projector.corner + uv.x * projector.right + uv.y * projector.down;
    // the projector never looks at or above the horizon, so ray.z < 0
    let s = (projector.base_m - projector.eye_m.z) / ray.z;
    return projector.eye_m.xy + s * ray.xy;
}
