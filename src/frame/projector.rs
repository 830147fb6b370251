//! The projector: the second camera that a projected grid hangs from (Johanson 2004, "projection camera";
//! Livny et al. 2008, section 3.2, Eq. 2 and 3; Loeffler et al. 2009, section 3).
//!
//! The projector stands at the camera's eye, never looks at or above the horizon, so that no ray fires backwards,
//! and its image is just as wide as it takes to hold the ground under everything the camera can see: peaks that
//! stand outside the camera's footprint on the base plane reach into the picture and must not be lost. It is `Projector` of
//! `kernels/lib/projector.wgsl`.

use glam::{DVec2, DVec3};

use super::Block;
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
        let mut ground = visible_ground(data, camera);
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

/// Corners of what the camera sees of the terrain's volume, dropped to the ground, from the camera's eye: the
/// volume is a box for each part of the terrain, as low and as high as the samples in it.
fn visible_ground(data: &SceneData, camera: &Camera) -> Vec<DVec2> {
    let planes = frustum(camera);
    let corners = data
        .ground
        .parts()
        .iter()
        .flat_map(|part| clipped_box(&planes, camera, (part.low_m - camera.eye_m, part.high_m - camera.eye_m)));
    let cell_m = data.ground.lattice().cell_m;
    // a hundredth of a cell more, and more far away: what rounding may take from the grid's border
    let around = |corner: DVec3| {
        let more = 0.01 * cell_m.max_element() + 1e-5 * corner.length();
        [(-more, -more), (more, -more), (-more, more), (more, more)]
            .map(|offset| corner.truncate() + DVec2::from(offset))
    };
    corners.flat_map(around).collect()
}

/// Inward normals of the planes through the eye that bound the picture.
fn frustum(camera: &Camera) -> [DVec3; 4] {
    let view = |x: f64, y: f64| camera.world_from_view * DVec3::new(x * camera.half_tan.x, y * camera.half_tan.y, 1.0);
    let (nw, ne, sw, se) = (view(-1.0, 1.0), view(1.0, 1.0), view(-1.0, -1.0), view(1.0, -1.0));
    let inward = |a: DVec3, b: DVec3| {
        let normal = a.cross(b);
        if normal.dot(camera.forward()) < 0.0 { -normal } else { normal }
    };
    [inward(nw, ne), inward(ne, se), inward(se, sw), inward(sw, nw)]
}

/// Corners of the part of a box (relative to the eye) inside the frustum.
fn clipped_box(planes: &[DVec3; 4], camera: &Camera, (low, high): (DVec3, DVec3)) -> Vec<DVec3> {
    let corner = |i: usize| {
        let pick = |bit: usize, low: f64, high: f64| if i >> bit & 1 == 1 { high } else { low };
        DVec3::new(pick(0, low.x, high.x), pick(1, low.y, high.y), pick(2, low.z, high.z))
    };
    if planes.iter().any(|plane| (0..8).all(|i| corner(i).dot(*plane) < 0.0)) {
        return Vec::new();
    }
    const FACES: [[usize; 4]; 6] = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let mut corners: Vec<DVec3> = Vec::new();
    for face in FACES {
        let mut polygon: Vec<DVec3> = face.iter().map(|&i| corner(i)).collect();
        for plane in planes {
            polygon = clip(&polygon, *plane);
        }
        corners.extend(polygon);
    }
    if low.cmple(DVec3::ZERO).all() && high.cmpge(DVec3::ZERO).all() {
        corners.push(DVec3::ZERO);
    }
    // the picture's corner rays, where they enter and leave the box
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let ray = camera.world_from_view * DVec3::new(x * camera.half_tan.x, y * camera.half_tan.y, 1.0);
        let (near, far) = (low / ray, high / ray);
        let enter = near.min(far).max_element().max(0.0);
        let leave = near.max(far).min_element();
        if enter <= leave {
            corners.extend([ray * enter, ray * leave]);
        }
    }
    corners
}

/// The part of a polygon on the inner side of a plane through the eye (Sutherland, Hodgman 1974).
fn clip(polygon: &[DVec3], plane: DVec3) -> Vec<DVec3> {
    let mut inside = Vec::with_capacity(polygon.len() + 1);
    for (index, &a) in polygon.iter().enumerate() {
        let b = polygon[(index + 1) % polygon.len()];
        let (da, db) = (a.dot(plane), b.dot(plane));
        if da >= 0.0 {
            inside.push(a);
        }
        if (da >= 0.0) != (db >= 0.0) {
            inside.push(a + (b - a) * (da / (da - db)));
        }
    }
    inside
}
