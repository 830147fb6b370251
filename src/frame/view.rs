//! How a camera sees: `View` of `kernels/lib/view.wgsl`.

use glam::DVec3;

use super::Block;
use crate::camera::Camera;
use crate::ground::{Ground, foreground};
use crate::kernel::FieldKind::F32;

pub const BLOCK: Block = Block {
    name: "View",
    fields: &[
        ("right", F32(3)),
        ("focal_px", F32(1)),
        ("up", F32(3)),
        ("ray_most", F32(1)),
        ("forward", F32(3)),
        ("tilt_most", F32(1)),
        ("side_left", F32(3)),
        ("side_right", F32(3)),
        ("side_top", F32(3)),
        ("side_bottom", F32(3)),
        ("half_tan", F32(2)),
        ("near_m", F32(1)),
    ],
    changes: true,
    fill: |frame, values| {
        let camera = &frame.camera;
        let forward = camera.forward();
        let axes = [camera.world_from_view.x_axis, camera.world_from_view.y_axis, forward];
        let numbers = [
            camera.focal_px(),
            camera.most_of(|ray| ray.length()),
            camera.most_of(|ray| (ray * forward.z - DVec3::Z).length()),
        ];
        for (axis, number) in axes.into_iter().zip(numbers) {
            values.add(axis.as_vec3().to_array()).add(number as f32);
        }
        for side in sides(camera) {
            values.add(side.as_vec3().to_array());
        }
        values.add(camera.half_tan.as_vec2().to_array()).add(near_m(frame.data.ground.as_ref(), camera) as f32);
    },
};

/// From where on a mesh is drawn, in metres along the view direction: half the distance that the surface has at least, so that nothing of
/// it is cut away. Depths are this over the forward distance: the nearer it begins, the fewer digits they have for a triangle that reaches
/// from the eye far away, and no eye in the air has to pay for those on foot.
pub fn near_m(ground: &dyn Ground, camera: &Camera) -> f64 {
    let least_m = foreground::least_distance_m(ground, camera.eye_m);
    (0.5 * least_m / camera.most_of(|ray| ray.length())).clamp(NEAREST_M, FARTHEST_M)
}

const NEAREST_M: f64 = 1e-4;
const FARTHEST_M: f64 = 0.1;

/// Inward normals of the picture's sides: left, right, top, bottom.
pub fn sides(camera: &Camera) -> [DVec3; 4] {
    let [right, up, forward] = [camera.world_from_view.x_axis, camera.world_from_view.y_axis, camera.forward()];
    let (across, high) = (forward * camera.half_tan.x, forward * camera.half_tan.y);
    [right + across, across - right, high - up, up + high].map(DVec3::normalize)
}
