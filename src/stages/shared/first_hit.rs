//! The first hit of a ray with the surface, in f64.

use glam::DVec2;

use super::octaves::octaves_off_m;
use super::rounding::EPSILON;
use crate::experiment::scene::Surface;
use crate::frame::octaves::near;
use crate::ground::{Detailed, Gap, Ground, Ray, cast};
use crate::reference::Frame;

/// Distance of the first hit and its bound. Every place at which the surface's formula changes is crossed one by one, so between two
/// crossings the surface is one plane or one patch.
pub fn first_hit(frame: &Frame, pixel: DVec2) -> (f64, f64) {
    let surface = frame.data.scene.surface;
    let eye_m = frame.camera.eye_m;
    let ray = Ray { eye_m, direction: frame.camera.ray(pixel) };
    let Some((t_in, t_out)) = frame.ground.stay(&ray) else {
        return (f64::NAN, f64::MIN_POSITIVE);
    };
    if let Some(detail) = frame.ground.detail() {
        return on_octaves(frame, detail, &ray, (t_in, t_out));
    }
    let mut crossings = frame.ground.bends(&ray, t_in, t_out);
    crossings.extend([t_in, t_out]);
    crossings.sort_by(f64::total_cmp);
    let above = |t: f64| frame.ground.above_m(ray.at(t));
    let scale_m = eye_m.z.abs() + largest_m(frame);
    // heights and positions are rounded a few times each; a position off by p meets slopes of the terrain
    let off = |t: f64, slope: f64| 8.0 * EPSILON * (scale_m + t * (1.0 + slope));
    let mut f0 = above(t_in);
    let side = if f0 >= 0.0 { 1.0 } else { -1.0 };
    f0 *= side;
    let mut undecided = false;
    for pair in crossings.windows(2) {
        let (t0, t1) = (pair[0], pair[1]);
        let f1 = side * above(t1);
        // the same parabola in both cases; on triangles its second difference is zero
        let middle = side * above(0.5 * (t0 + t1));
        let bend = if surface == Surface::Bilinear { 2.0 * (f0 + f1 - 2.0 * middle) } else { 0.0 };
        let slope = (f1 - f0).abs() / (t1 - t0).max(1e-12) + 1.0;
        if let Some(share) = first_root(f0, f1 - f0 - bend, bend) {
            let t = t0 + (t1 - t0) * share;
            let steep = ((f1 - f0 - bend + 2.0 * bend * share) / (t1 - t0).max(1e-12)).abs();
            let bound = off(t, slope) / steep + 8.0 * EPSILON * t;
            // a ray that all but lies in the surface, or touched it before, may stop anywhere along it
            let open = undecided || bound > 0.5 * (t1 - t0) + 1e-3 * t || bound > 1e-2 * t.max(1.0);
            return (t, if open { f64::INFINITY } else { bound });
        }
        undecided |= f1.min(middle) <= off(t1, slope) && f1 > 0.0;
        f0 = f1;
    }
    (f64::NAN, if undecided { f64::INFINITY } else { f64::MIN_POSITIVE })
}

/// The same over octaves. A kernel ends where it is no farther over the surface than it is told to be, give or take rounding: not before a
/// ray comes so near, and not after it has gone under the surface by as much as rounding explains.
fn on_octaves(frame: &Frame, detail: &Detailed, ray: &Ray, (t_in, t_out): (f64, f64)) -> (f64, f64) {
    let (eye_m, octaves) = (frame.camera.eye_m, detail.octaves());
    let side = cast::side(detail, ray, t_in);
    // heights are rounded eight times, and so is a place, on slopes; then there are the octaves themselves
    let off_m = 8.0 * EPSILON * (eye_m.z.abs() + largest_m(frame)) + octaves_off_m(octaves, &|_| 1.0, 0.0);
    let off = Gap { m: off_m, of_way: 8.0 * EPSILON * (1.0 + detail.steepest()) };
    let first = detail.first_within(ray, side, Gap { of_way: off.of_way + near(frame.camera), ..off });
    let last = detail.first_within(ray, side, Gap { m: -off.m, of_way: -off.of_way });
    match (first, last) {
        (Some(first), Some(last)) => {
            let bound = 0.5 * (last - first) + 16.0 * EPSILON * last;
            // what all but touches the surface may stop anywhere along it
            let open = bound > 1e-2 * last.max(1.0);
            (0.5 * (first + last), if open { f64::INFINITY } else { bound })
        }
        (Some(first), None) => (first.min(t_out), f64::INFINITY),
        (None, _) => (f64::NAN, f64::MIN_POSITIVE),
    }
}

/// The largest height without its sign.
fn largest_m(frame: &Frame) -> f64 {
    let (low, high) = frame.ground.range_m();
    low.abs().max(high.abs())
}

/// Smallest root in [0, 1] of f0 + b s + a s^2 with f0 >= 0.
fn first_root(f0: f64, b: f64, a: f64) -> Option<f64> {
    if a == 0.0 {
        return (f0 + b <= 0.0 && b < 0.0).then(|| f0 / -b);
    }
    let discriminant = b * b - 4.0 * a * f0;
    if discriminant < 0.0 {
        return None;
    }
    let q = -0.5 * (b + b.signum() * discriminant.sqrt());
    let roots = [q / a, if q == 0.0 { 0.0 } else { f0 / q }];
    roots.into_iter().filter(|root| (0.0..=1.0).contains(root)).min_by(f64::total_cmp)
}
