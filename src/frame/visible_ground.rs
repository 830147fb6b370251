//! The ground under everything that a camera can see of the terrain: what a grid has to hold. Its samples are `VisibleGround` of
//! `kernels/lib/visible_ground.wgsl`.

use glam::{DVec2, DVec3, IVec2};

use super::Block;
use crate::camera::Camera;
use crate::kernel::FieldKind::I32;
use crate::scene::SceneData;

pub const BLOCK: Block = Block {
    name: "VisibleGround",
    fields: &[("low", I32(2)), ("high", I32(2))],
    changes: true,
    fill: |frame, values| {
        let (low, high) = samples(frame.data, &frame.camera);
        values.add(low.to_array()).add(high.to_array());
    },
};

/// The first and the last of the terrain's samples, by columns and by rows, around all ground that the camera can see; the sample nearest to
/// the eye, if it sees none.
pub fn samples(data: &SceneData, camera: &Camera) -> (IVec2, IVec2) {
    let lattice = data.ground.lattice();
    let last = lattice.last().as_dvec2();
    let sample = |point: &DVec2| lattice.sample_from_world(*point + camera.eye_m.truncate());
    let points = points_m(data, camera);
    if points.is_empty() {
        let nearest = sample(&DVec2::ZERO).round().clamp(DVec2::ZERO, last).as_ivec2();
        return (nearest, nearest);
    }
    let low = points.iter().map(sample).fold(DVec2::MAX, DVec2::min);
    let high = points.iter().map(sample).fold(DVec2::MIN, DVec2::max);
    let inside = |sample: DVec2| sample.clamp(DVec2::ZERO, last).as_ivec2();
    (inside(low.floor()), inside(high.ceil()))
}

/// Corners of what the camera sees of the terrain's volume, dropped to the ground, from the camera's eye: the
/// volume is a box for each part of the terrain, as low and as high as the samples in it.
pub fn points_m(data: &SceneData, camera: &Camera) -> Vec<DVec2> {
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
