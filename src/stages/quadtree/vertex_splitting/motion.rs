//! What a camera sees and how it moves, as the numbers that the kernel decides with.

use glam::DVec3;

use crate::camera::Camera;
use crate::plan::SceneData;

/// What a motion from camera to camera has added up to, at each frame of a path. From one frame to any other it is at most the
/// difference.
pub fn so_far(data: &SceneData, motion: impl Fn(&Camera, &Camera) -> f64) -> std::vec::IntoIter<f32> {
    let mut sum = 0.0;
    let steps = data.cameras.windows(2).map(|pair| motion(&pair[0], &pair[1]));
    let sums = std::iter::once(0.0).chain(steps).map(|step| {
        sum += step;
        sum as f32
    });
    sums.collect::<Vec<_>>().into_iter()
}

/// The angle in radians between two cameras.
pub fn turn(a: &Camera, b: &Camera) -> f64 {
    let between = a.world_from_view.transpose() * b.world_from_view;
    let trace = between.x_axis.x + between.y_axis.y + between.z_axis.z;
    // next to no turn, the cosine has no digits: the sine has
    let axis = DVec3::new(
        between.y_axis.z - between.z_axis.y,
        between.z_axis.x - between.x_axis.z,
        between.x_axis.y - between.y_axis.x,
    );
    (axis.length() / 2.0).atan2((trace - 1.0) / 2.0)
}

/// Inward normals of the picture's sides: left, right, top, bottom.
pub fn sides(camera: &Camera) -> [DVec3; 4] {
    let [right, up, forward] = [camera.world_from_view.x_axis, camera.world_from_view.y_axis, camera.forward()];
    let (across, high) = (forward * camera.half_tan.x, forward * camera.half_tan.y);
    [right + across, across - right, high - up, up + high].map(DVec3::normalize)
}

/// The largest value of a convex function of the picture's rays, which is at a corner.
pub fn most_of(camera: &Camera, value: impl Fn(DVec3) -> f64) -> f64 {
    let [right, down, corner] = camera.pixel_basis();
    let (width, high) = (f64::from(camera.viewport.0), f64::from(camera.viewport.1));
    let corners = [(0.0, 0.0), (width, 0.0), (0.0, high), (width, high)].map(|(x, y)| corner + right * x + down * y);
    corners.into_iter().map(value).fold(0.0, f64::max)
}
