//! From points of a mesh to a picture of it: from above, through a camera, or as a plane figure.

use glam::{DVec2, DVec3, DVec4};

use crate::camera::Camera;

/// Four rows of a matrix that makes clip space of a point; depth is larger nearer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection(pub [DVec4; 4]);

/// What is nearer to an eye is not drawn, in metres.
const NEAR_M: f64 = 0.05;

impl Projection {
    /// A plane figure: `low` is the corner at the left and the bottom, `high` the other one.
    pub fn plane(low: DVec2, high: DVec2) -> Self {
        let size = high - low;
        let centre = (low + high) / 2.0;
        Self([
            DVec4::new(2.0 / size.x, 0.0, 0.0, -2.0 * centre.x / size.x),
            DVec4::new(0.0, 2.0 / size.y, 0.0, -2.0 * centre.y / size.y),
            DVec4::new(0.0, 0.0, 0.0, 0.25),
            DVec4::new(0.0, 0.0, 0.0, 1.0),
        ])
    }

    /// Through a camera, of points that are relative to `origin_m`.
    pub fn camera(camera: &Camera, origin_m: DVec3) -> Self {
        let view_from_world = camera.world_from_view.transpose();
        let moved = view_from_world * (origin_m - camera.eye_m);
        let row = |at: usize| DVec4::from((view_from_world.row(at), moved[at]));
        Self([row(0) / camera.half_tan.x, row(1) / camera.half_tan.y, DVec4::new(0.0, 0.0, 0.0, NEAR_M), row(2)])
    }

    /// A part of the picture, between two of its places from (-1, -1) at the left and the bottom to (1, 1), as the whole.
    pub fn cropped(&self, low: DVec2, high: DVec2) -> Self {
        let [x, y, z, w] = self.0;
        let (centre, half) = ((low + high) / 2.0, (high - low) / 2.0);
        Self([(x - w * centre.x) / half.x, (y - w * centre.y) / half.y, z, w])
    }

    pub fn clip(&self, point: DVec3) -> DVec4 {
        let point = point.extend(1.0);
        DVec4::from_array(self.0.map(|row| row.dot(point)))
    }

    /// Where a point is in a picture of `size` pixels, or `None` behind the eye.
    pub fn pixel(&self, point: DVec3, size: DVec2) -> Option<DVec2> {
        let clip = self.clip(point);
        let ndc = DVec2::new(clip.x, clip.y) / clip.w;
        (clip.w > 0.0).then(|| DVec2::new(ndc.x + 1.0, 1.0 - ndc.y) / 2.0 * size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_figure_has_its_corners_in_those_of_the_picture() {
        let plane = Projection::plane(DVec2::new(-1.0, 2.0), DVec2::new(3.0, 4.0));
        let size = DVec2::new(200.0, 100.0);
        assert_eq!(plane.pixel(DVec3::new(-1.0, 2.0, 9.0), size), Some(DVec2::new(0.0, 100.0)));
        assert_eq!(plane.pixel(DVec3::new(3.0, 4.0, 9.0), size), Some(DVec2::new(200.0, 0.0)));
    }
}
