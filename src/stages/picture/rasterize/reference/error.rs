//! What a pixel shows of a mesh that has an error: an estimate between grid points, or a bound (docs/proven_bound.md).

use glam::{DVec2, DVec3};

use super::triangles::{Hit, Triangles, View};
use crate::reference::Frame;
use crate::stages::shared::border::border_margin_m;
use crate::stages::shared::rounding::{ANY_ADAPTER_SNAP_PX, PROOF_SNAP_PX};

/// From an edge of the triangle as the rasterizer sees it, a pixel is certain not to be taken for one beside it: three times the snapping, by
/// the sum of two derivatives, which is at most 1.5 times their length, and twice that where they change.
const BESIDE_PX: f64 = 9.0 * PROOF_SNAP_PX as f64;

impl Triangles {
    /// Distance and normalised error, each with its bound, of what a pixel sees.
    pub(super) fn error(&self, frame: &Frame, pixel: DVec2, hit: &Hit, threshold_px: f64) -> ((f64, f64), (f64, f64)) {
        let undecided = ((f64::NAN, f64::INFINITY), (f64::NAN, f64::INFINITY));
        let Some(number) = hit.triangle else {
            let open = if hit.distance.1.is_infinite() { f64::INFINITY } else { f64::MIN_POSITIVE };
            return (hit.distance, (0.0, open));
        };
        if hit.distance.1.is_infinite() {
            return undecided;
        }
        if self.is_proven() {
            let (distance, error) = self.proven(frame, pixel, hit, number, threshold_px).unwrap_or(undecided);
            // close to an edge, the adapter's corners and derivatives decide whether the ray passes beside
            let is_close = self.margin_px(&View::new(frame, pixel), number) < ANY_ADAPTER_SNAP_PX + BESIDE_PX;
            let is_open = is_close || !self.has_derivatives(frame, pixel, number);
            return (distance, if is_open { (f64::NAN, f64::INFINITY) } else { error });
        }
        let (distance, (error, off)) = self.interpolated(frame, pixel, hit);
        (distance, (error.clamp(0.0, 1.0), off))
    }

    /// Distance of what a pixel sees, and what the corners of the triangle carry as it is interpolated there, each with its bound.
    pub(super) fn interpolated(&self, frame: &Frame, pixel: DVec2, hit: &Hit) -> ((f64, f64), (f64, f64)) {
        let Some(number) = hit.triangle else {
            let open = if hit.distance.1.is_infinite() { f64::INFINITY } else { f64::MIN_POSITIVE };
            return (hit.distance, (0.0, open));
        };
        if hit.is_shared || hit.distance.1.is_infinite() {
            return (hit.distance, (f64::NAN, f64::INFINITY));
        }
        // perspective-correct interpolation is linear on the triangle
        let [right, down, corner] = frame.camera.pixel_basis();
        let ray = (corner + right * pixel.x + down * pixel.y).normalize();
        let [a, b, c] = self.triangles[number];
        let normal = (b - a).cross(c - a);
        let share = |p: DVec3| {
            let point = p - a;
            let v = (b - a).cross(point).dot(normal) / normal.length_squared();
            let u = point.cross(c - a).dot(normal) / normal.length_squared();
            [1.0 - u - v, u, v]
        };
        let carried = self.carried[number];
        let at = |p: DVec3| share(p).iter().zip(carried).map(|(share, error)| share * error).sum::<f64>();
        let point = ray * hit.distance.0;
        // the rasterizer interpolates between corners that it has moved: by its snapping, and by what it rounds
        let aside = [right, down].map(|step| {
            let moved = (ray + step * (ANY_ADAPTER_SNAP_PX * corner.length().max(1.0))).normalize();
            (at(moved * (normal.dot(a) / normal.dot(moved))) - at(point)).abs()
        });
        let spread =
            carried.iter().copied().fold(f64::MIN, f64::max) - carried.iter().copied().fold(f64::MAX, f64::min);
        let off = 2.0 * (aside[0] + aside[1]) + 2e-4 * spread + 1e-6 + self.carried_off[number];
        (hit.distance, (at(point), if off.is_finite() { off } else { f64::INFINITY }))
    }

    /// Derivatives are differences between the four pixels of a quad; they say little of a triangle that another of them sees at quite another
    /// distance, or never.
    fn has_derivatives(&self, frame: &Frame, pixel: DVec2, number: usize) -> bool {
        let [a, b, c] = self.triangles[number];
        let normal = (b - a).cross(c - a);
        let depth = |at: DVec2| normal.dot(a) / normal.dot(View::new(frame, at).ray);
        let (own, first) = (depth(pixel), (pixel / 2.0).floor() * 2.0 + 0.5);
        let quad = [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE].map(|off| depth(first + off) / own);
        quad.into_iter().all(|share| (0.5..=2.0).contains(&share))
    }

    /// The same for a mesh whose cells have bounds; `None` where rounding decides.
    pub(super) fn proven(
        &self,
        frame: &Frame,
        pixel: DVec2,
        hit: &Hit,
        number: usize,
        threshold_px: f64,
    ) -> Option<((f64, f64), (f64, f64))> {
        let camera = frame.camera;
        let [right, down, corner] = camera.pixel_basis();
        let ray = corner + right * pixel.x + down * pixel.y;
        let per_t = ray.length();
        let corners = self.triangles[number];
        let raises = self.carried[number];
        // both triangles of a cell turn the same way here: upwards
        let plane = |[a, b, c]: [DVec3; 3]| {
            let normal = (b - a).cross(c - a);
            (normal, normal.dot(a))
        };
        let (normal, d) = plane(corners);
        let (low_m, high_m) = self.found_m[number];
        let lift = DVec3::Z * (0.5 * (low_m + high_m));
        let lowered = [0, 1, 2].map(|at| corners[at] - DVec3::Z * raises[at] + lift);
        let (under, under_d) = plane(lowered);
        // is a value below a limit, if rounding cannot turn that
        let decide = |value: f64, limit: f64, slack: f64| ((value - limit).abs() > slack).then_some(value < limit);
        let steep = normal.dot(ray);
        let cosines = [steep / (normal.length() * per_t), under.dot(ray) / (under.length() * per_t)];
        let facing = decide(cosines[0], 0.0, 1e-5)? && decide(cosines[1], 0.0, 1e-5)?;
        let sharp = cosines[0].abs().min(cosines[1].abs());
        let turned = decide(0.0, normal.z / normal.length(), 1e-6)?;
        let off = hit.distance.1 / hit.distance.0 * (1.0 + 1.0 / sharp) + 1e-6 / sharp;
        let raised = d / steep;
        let depths = corners.map(|corner| corner.dot(camera.forward()));
        let (near, far) = depths.iter().fold((f64::MAX, 0.0f64), |(low, high), &z| (low.min(z), high.max(z)));
        let sits = decide(near.max(0.0) / raised, 1.0, off)? && decide(raised / far, 1.0, off)?;
        if !(facing && turned && sits) {
            return Some((hit.distance, (1.0, 2e-5)));
        }
        if sharp < 1e-3 {
            return None;
        }
        let aside = |step: DVec3| (raised * (step - ray * (normal.dot(step) / steep))).truncate().length_squared();
        let beside_m = 2.0 * f64::from(PROOF_SNAP_PX) * (aside(right) + aside(down)).sqrt();
        let (edge_m, behind) = footprint(corners);
        let t = (under_d / under.dot(ray)).max(raised);
        let (least, most) = raises.iter().fold((f64::MAX, f64::MIN), |(l, h), &r| (l.min(r), h.max(r)));
        let start = (raised + 4.0 / 64.0 * (most - least) * normal.z / steep).max(0.0);
        let bound_m = 0.5 * (high_m - low_m);
        let inside = decide(-border_margin_m(frame, ray * t), 0.0, (1e-6 + off) * (1.0 + t * per_t))?;
        let holds = decide(beside_m, edge_m, 1e-2 * edge_m)? && decide(t / raised, behind, off)? && inside;
        let tilt = (ray * camera.forward().z - DVec3::Z).length();
        let depth = t - bound_m * camera.forward().z.abs();
        if !holds || depth <= 0.0 {
            return Some(((start * per_t, off * t * per_t), (0.99999, 2e-5)));
        }
        let most_px = camera.focal_px() * bound_m * tilt / depth * 1.0001 + 0.01;
        let error = (1.0 - threshold_px / most_px).min(0.99999);
        if decide(most_px, threshold_px, 2e-3 * threshold_px)? {
            return Some(((t * per_t, off * t * per_t), (0.0, f64::MIN_POSITIVE)));
        }
        Some(((start * per_t, off * t * per_t), (error, 0.01 + off)))
    }
}

/// The ground on which the bound of a triangle holds (docs/proven_bound.md): a rim of 1/64 of its size, and by how many times its distance it
/// goes on behind it; both less a hundredth for rounding.
fn footprint(corners: [DVec3; 3]) -> (f64, f64) {
    let low = corners.into_iter().fold(DVec3::MAX, DVec3::min).truncate();
    let high = corners.into_iter().fold(DVec3::MIN, DVec3::max).truncate();
    let reach = corners.map(|corner| corner.truncate().length());
    let (nearest, farthest) = reach.iter().fold((f64::MAX, 0.0f64), |(l, h), &r| (l.min(r), h.max(r)));
    (0.99 / 64.0 * (high - low).max_element(), 1.0 + 0.99 * 0.25 * (1.0 - nearest / farthest))
}
