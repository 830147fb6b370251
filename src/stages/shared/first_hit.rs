//! The first hit of a ray with the surface, in f64.

use glam::{DVec2, UVec2};

use super::rounding::EPSILON;
use crate::experiment::scene::Surface;
use crate::reference::Frame;

/// Distance of the first hit and its bound. Every line at which the surface's formula changes (columns, rows,
/// diagonals) is crossed one by one, so between two crossings the surface is one plane or one patch.
pub fn first_hit(frame: &Frame, pixel: DVec2) -> (f64, f64) {
    let terrain = &frame.data.terrain;
    let surface = frame.data.scene.surface;
    let eye_m = frame.camera.eye_m;
    let ray = frame.camera.ray(pixel);
    let origin = terrain.sample_from_world(eye_m.truncate());
    let direction = DVec2::new(ray.x, -ray.y) / terrain.cell_m;
    let last = (terrain.size - UVec2::ONE).as_dvec2();
    let Some((t_in, t_out)) = over_terrain(origin, direction, last, ray.z, frame) else {
        return (f64::NAN, f64::MIN_POSITIVE);
    };
    let mut crossings = vec![t_in, t_out];
    let mut lines = |start: f64, speed: f64| {
        let (from, to) = (start + speed * t_in, start + speed * t_out);
        let (low, high) = (from.min(to).ceil(), from.max(to).floor());
        if speed != 0.0 && high - low < 1e6 {
            crossings.extend(
                (low as i64..=high as i64)
                    .map(|line| (line as f64 - start) / speed)
                    .filter(|t| (t_in..=t_out).contains(t)),
            );
        }
    };
    lines(origin.x, direction.x);
    lines(origin.y, direction.y);
    if surface == Surface::Triangles {
        lines(origin.x + origin.y, direction.x + direction.y);
    }
    crossings.sort_by(f64::total_cmp);
    let above = |t: f64| {
        let position = eye_m + ray * t;
        position.z - terrain.surface_m(position.truncate(), surface)
    };
    let scale_m = eye_m.z.abs() + frame.data.range_m.0.abs().max(frame.data.range_m.1.abs());
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

/// The ray's stay over the terrain's rectangle.
fn over_terrain(origin: DVec2, direction: DVec2, last: DVec2, rise: f64, frame: &Frame) -> Option<(f64, f64)> {
    let (mut t_in, mut t_out) = (0.0f64, f64::INFINITY);
    for axis in 0..2 {
        if direction[axis] == 0.0 {
            if origin[axis] < 0.0 || origin[axis] > last[axis] {
                return None;
            }
            continue;
        }
        let (a, b) = (-origin[axis] / direction[axis], (last[axis] - origin[axis]) / direction[axis]);
        t_in = t_in.max(a.min(b));
        t_out = t_out.min(a.max(b));
    }
    if t_out.is_infinite() {
        // straight up or down: nothing is beyond the lowest and the highest height
        let (low, high) = frame.data.range_m;
        let eye = frame.camera.eye_m.z;
        t_out = ((low - eye).abs().max((high - eye).abs()) + 1.0) / rise.abs().max(1e-300);
    }
    (t_in <= t_out).then_some((t_in, t_out))
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
