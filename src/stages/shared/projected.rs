//! Where grid points are on the base plane, and how far rounding may move them.

use glam::DVec2;

use super::rounding::EPSILON;
use crate::frame::projector::Projector;

/// Like [`Projector::ground_m`], with the bound of the position for a (u, v) that is off by `off_uv`. The ray is five
/// roundings of terms as large as `reach`, which count most where its z is small; then there are a division and a
/// product with the distance to the plane.
pub fn ground_off_m(projector: &Projector, uv: DVec2, off_uv: f64) -> (DVec2, f64) {
    let (position_m, ray) = projector.ground_m(uv);
    let reach = projector.corner.length() + projector.right.length() + projector.down.length();
    let off = (12.0 * EPSILON + off_uv) * reach;
    let stretch = off / (-ray.z).max(1e-300) * (1.0 + ray.truncate().length() / -ray.z);
    (position_m, stretch * (projector.base_m - projector.eye_m.z).abs() + 8.0 * EPSILON * position_m.length())
}
