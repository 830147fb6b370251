//! The terrain's border.

use glam::DVec3;

use crate::reference::Frame;

/// How far a camera-relative point is inside the terrain's rectangle, in metres.
pub fn border_margin_m(frame: &Frame, point: DVec3) -> f64 {
    frame.ground.margin_m(point + frame.camera.eye_m)
}
