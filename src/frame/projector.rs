//! The projector: the second camera that a projected grid hangs from (Johanson 2004, "projection camera";
//! Livny et al. 2008, section 3.2, Eq. 2 and 3; Loeffler et al. 2009, section 3).
//!
//! The projector stands at the camera's eye, never looks at or above the horizon, so that no ray fires backwards,
//! and its image is just as wide as it takes to hold the ground under everything the camera can see: peaks that
//! stand outside the camera's footprint on the base plane reach into the picture and must not be lost. It is `Projector` of
//! `kernels/lib/projector.wgsl`.

use glam::{DVec2, DVec3};

use super::{Block, visible_ground};
use crate::camera::Camera;
use crate::kernel::FieldKind::F32;
use crate::scene::SceneData;

/// Ray of grid point (u, v): `corner + u right + v down`; all relative to the camera's eye, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projector {
    pub eye_m: DVec3,
    pub base_m: f64,
    pub corner: DVec3,
    pub right: DVec3,
    pub down: DVec3,
}

impl Projector {
    pub fn new(data: &SceneData, camera: &Camera) -> Self {
        let base_m = data.ground.range_m().0 - camera.eye_m.z;
        let cell_m = data.ground.lattice().cell_m.min_element();
        // from below or on the base plane nothing can be projected down to it
        let eye_m = DVec3::new(0.0, 0.0, (base_m + 0.5 * cell_m).max(0.0));
        let mut ground = visible_ground::points_m(data, camera);
        if ground.is_empty() {
            // only sky: any grid will do
            ground = vec![DVec2::splat(-cell_m), DVec2::splat(cell_m)];
        }
        let points: Vec<DVec3> = ground.iter().map(|point| point.extend(base_m) - eye_m).collect();
        let heading = camera.forward().truncate().try_normalize();
        // looking straight down, up is where the top of the picture points
        let heading = heading.unwrap_or_else(|| camera.world_from_view.y_axis.truncate().normalize_or(DVec2::Y));
        let axes = Axes::facing(&points, heading, camera);
        let image = |point: &DVec3| DVec2::new(point.dot(axes.right), point.dot(axes.up)) / point.dot(axes.forward);
        let low = points.iter().map(image).fold(DVec2::MAX, DVec2::min);
        let high = points.iter().map(image).fold(DVec2::MIN, DVec2::max);
        let corner = axes.forward + axes.right * low.x + axes.up * high.y;
        Self { eye_m, base_m, corner, right: axes.right * (high.x - low.x), down: axes.up * (low.y - high.y) }
    }

    /// Where the ray of a grid point meets the base plane, from the camera's eye, and the ray.
    pub fn ground_m(&self, uv: DVec2) -> (DVec2, DVec3) {
        let ray = self.corner + self.right * uv.x + self.down * uv.y;
        let s = (self.base_m - self.eye_m.z) / ray.z;
        ((self.eye_m + ray * s).truncate(), ray)
    }
}

pub const BLOCK: Block = Block {
    name: "Projector",
    fields: &[("eye_m", F32(3)), ("base_m", F32(1)), ("corner", F32(3)), ("right", F32(3)), ("down", F32(3))],
    changes: true,
    fill: |frame, values| {
        let projector = Projector::new(frame.data, &frame.camera);
        let vector = |vector: DVec3| vector.as_vec3().to_array();
        values.add(vector(projector.eye_m)).add(projector.base_m as f32);
        values.add(vector(projector.corner)).add(vector(projector.right)).add(vector(projector.down));
    },
};

struct Axes {
    right: DVec3,
    up: DVec3,
    forward: DVec3,
}

impl Axes {
    fn at_depression(heading: DVec2, angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        let right = DVec3::new(heading.y, -heading.x, 0.0);
        let forward = (heading * cos).extend(-sin);
        Self { right, up: right.cross(forward), forward }
    }

    /// No point may be closer to the image plane's horizon than this, as a cosine: the grid would be stretched
    /// over nothing.
    const CLOSEST: f64 = 0.2;

    fn holds(&self, points: &[DVec3]) -> bool {
        points.iter().all(|point| point.dot(self.forward) >= Self::CLOSEST * point.length())
    }

    /// The camera's own depression where that keeps every ray below the horizon (Livny et al., Eq. 2); the
    /// middle of the visible ground where that loses part of it; straight down where that does too.
    fn facing(points: &[DVec3], heading: DVec2, camera: &Camera) -> Self {
        let depression = (-camera.forward().z).asin();
        let own =
            Self::at_depression(heading, depression.max(camera.half_tan.y.atan()).min(std::f64::consts::FRAC_PI_2));
        if own.holds(points) {
            return own;
        }
        let angles = points.iter().map(|point| (-point.z).atan2(point.truncate().dot(heading)));
        let (low, high) = angles.fold((f64::MAX, f64::MIN), |(low, high), angle| (low.min(angle), high.max(angle)));
        let middle = Self::at_depression(heading, 0.5 * (low + high));
        match middle.holds(points) {
            true => middle,
            false => Self::at_depression(heading, std::f64::consts::FRAC_PI_2),
        }
    }
}
