//! The triangles that are drawn, and the nearest one on a pixel's ray.

use glam::{DVec2, DVec3, UVec2};

use super::super::list;
use crate::frame::view::near_m;
use crate::reference::{Frame, Values};
use crate::stages::shared::border::border_margin_m;
use crate::stages::shared::first_hit::first_hit;
use crate::stages::shared::rounding::{ANY_ADAPTER_SNAP_PX, EPSILON};

/// `RIM` of `kernels/picture/rasterize_list.wgsl`.
const RIM: f64 = 9.5e-7;

pub(super) struct Triangles {
    pub(super) triangles: Vec<[DVec3; 3]>,
    /// Bound of each triangle's corners, metres.
    pub(super) bounds_m: Vec<f64>,
    /// What the corners carry: their errors, or how far they were raised.
    pub(super) carried: Vec<[f64; 3]>,
    /// How far off that is.
    pub(super) carried_off: Vec<f64>,
    /// Lowest and highest of surface minus the plane that was raised; empty for a mesh that is not proven.
    pub(super) found_m: Vec<(f64, f64)>,
    /// Nothing nearer is drawn.
    pub(super) near_m: f64,
    /// At the terrain's border.
    pub(super) is_cut: bool,
    /// A ray that passes beside its triangle is cast.
    pub(super) casts_beside: bool,
    /// Which triangles there are hangs on a decision.
    pub(super) is_open: bool,
}

/// What a pixel sees of a mesh.
pub(super) struct Hit {
    /// With its bound; NaN for nothing.
    pub(super) distance: (f64, f64),
    pub(super) triangle: Option<usize>,
    /// A rasterizer that moves corners may see another triangle here, whose distance is hardly another.
    pub(super) is_shared: bool,
}

impl Triangles {
    pub(super) fn of_list(frame: &Frame, keys: &Values, count: &Values, casts_beside: bool) -> Self {
        let corner = |key: f64| {
            let sample = UVec2::new(key as u32 & 0xffff, key as u32 >> 16);
            frame.ground.sample_m(sample) - frame.camera.eye_m
        };
        let listed = count.value[0] as usize / 3;
        let triangles: Vec<[DVec3; 3]> = keys
            .value
            .chunks_exact(4)
            .take(listed)
            .map(|keys| [corner(keys[0]), corner(keys[1]), corner(keys[2])])
            .collect();
        // a difference, a fraction and a product for the ground, two differences for the height
        let off =
            |corners: &[DVec3; 3]| 4.0 * EPSILON * corners.iter().map(|corner| corner.length()).fold(0.0, f64::max);
        let bounds_m = triangles.iter().map(off).collect();
        let (carried, carried_off) = (vec![[0.0; 3]; triangles.len()], vec![0.0; triangles.len()]);
        let is_open = count.bound[0].is_infinite();
        Self {
            triangles,
            bounds_m,
            carried,
            carried_off,
            found_m: Vec::new(),
            near_m: list::NEAR_M.into(),
            is_cut: false,
            casts_beside,
            is_open,
        }
    }

    pub(super) fn of_grid(frame: &Frame, vertices: &Values, cell_bounds: Option<&Values>) -> Self {
        let (rows, columns) = (vertices.dims[0], vertices.dims[1]);
        let at = |x: u32, y: u32| 4 * (y * columns + x) as usize;
        let point = |x, y| DVec3::from_slice(&vertices.value[at(x, y)..]);
        let bound = |x, y| vertices.bound[at(x, y)..at(x, y) + 3].iter().copied().fold(0.0, f64::max);
        let (mut triangles, mut bounds_m, mut carried, mut carried_off) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for y in 0..rows - 1 {
            for x in 0..columns - 1 {
                for corners in [[(x, y), (x, y + 1), (x + 1, y)], [(x + 1, y), (x, y + 1), (x + 1, y + 1)]] {
                    triangles.push(corners.map(|(x, y)| point(x, y)));
                    bounds_m.push(corners.iter().map(|&(x, y)| bound(x, y)).fold(0.0, f64::max));
                    carried.push(corners.map(|(x, y)| vertices.value[at(x, y) + 3]));
                    carried_off.push(corners.iter().map(|&(x, y)| vertices.bound[at(x, y) + 3]).fold(0.0, f64::max));
                }
            }
        }
        let bounds = cell_bounds.map_or(&[][..], |bounds| &bounds.value);
        let found_m = bounds.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
        Self {
            triangles,
            bounds_m,
            carried,
            carried_off,
            found_m,
            near_m: near_m(frame.ground, frame.camera),
            is_cut: true,
            casts_beside: false,
            is_open: false,
        }
    }

    pub(super) fn is_proven(&self) -> bool {
        self.found_m.len() == self.triangles.len()
    }

    /// What a pixel shows: the nearest triangle on its ray, or the surface where a mesh with a bound is cast.
    pub(super) fn seen(&self, frame: &Frame, pixel: DVec2) -> Hit {
        let mut hit = self.nearest(frame, pixel);
        if self.casts_beside && frame.data.has_foreground {
            let ((value, bound), (surface, surface_bound)) = (hit.distance, first_hit(frame, pixel));
            let apart = (value - surface).abs();
            let is_same = value.is_nan() && surface.is_nan();
            hit.distance.1 = match (is_same, apart.is_nan()) {
                (true, _) => bound,
                (false, true) => f64::INFINITY,
                (false, false) => bound.max(apart + surface_bound),
            };
        }
        hit
    }

    /// The nearest triangle on a pixel's ray.
    fn nearest(&self, frame: &Frame, pixel: DVec2) -> Hit {
        let view = View::new(frame, pixel);
        let (mut value, mut bound, mut nearest) = (f64::INFINITY, f64::MIN_POSITIVE, None);
        // hits that the rasterizer may or may not see
        let mut doubtful: Vec<(f64, f64)> = Vec::new();
        for number in 0..self.triangles.len() {
            match self.meet(&view, number) {
                Some(Met { distance, off, is_doubtful: true }) => doubtful.push((distance, off)),
                Some(Met { distance, off, .. }) if distance < value => {
                    (value, bound, nearest) = (distance, off, Some(number));
                }
                _ => {}
            }
        }
        let mut is_shared = false;
        for (distance, off) in doubtful {
            if distance < value + bound {
                is_shared = true;
                // seen or not, the answer is one of the two; far apart, nothing can be said
                let apart = (value - distance).abs();
                bound = if apart < 0.02 * distance { bound.max(off) + apart } else { f64::INFINITY };
            }
        }
        let value = if value.is_infinite() { f64::NAN } else { value };
        Hit { distance: (value, bound), triangle: nearest, is_shared }
    }

    /// How far inside a triangle a pixel is, in pixels; negative beside it.
    pub(super) fn margin_px(&self, view: &View, number: usize) -> f64 {
        let View { ray, right, down, .. } = *view;
        let [a, b, c] = self.triangles[number];
        let volume = a.dot(b.cross(c));
        let inside = [a.cross(b), b.cross(c), c.cross(a)].map(|edge| {
            let pixels = DVec2::new(edge.dot(right), edge.dot(down)).length();
            volume.signum() * edge.dot(ray) / pixels.max(1e-300)
        });
        inside.into_iter().fold(f64::MAX, f64::min)
    }

    /// How wide the rim of a triangle is in which the kernel leaves open, for rounding, what a ray meets; in pixels.
    fn rim_px(&self, view: &View, number: usize) -> f64 {
        if !self.casts_beside {
            return 0.0;
        }
        let View { ray, right, down, .. } = *view;
        let [a, b, c] = self.triangles[number];
        let wide = |from: DVec3, to: DVec3| {
            let side = from.cross(to);
            let pixels = DVec2::new(side.dot(right), side.dot(down)).length();
            2.0 * RIM * ray.length() * from.length() * (to - from).length() / pixels.max(1e-300)
        };
        wide(b, c).max(wide(c, a)).max(wide(a, b))
    }

    /// Where a ray meets one triangle, or passes so close beside it that a rasterizer may draw it.
    fn meet(&self, view: &View, number: usize) -> Option<Met> {
        let View { frame, ray, right, down } = *view;
        let ([a, b, c], bound_m) = (self.triangles[number], self.bounds_m[number]);
        let margin = self.margin_px(view, number);
        let slack = ANY_ADAPTER_SNAP_PX
            + bound_m / (a.length().min(b.length()).min(c.length()) * right.length()).max(1e-9)
            + self.rim_px(view, number);
        if margin < -slack {
            return None;
        }
        let normal = (b - a).cross(c - a);
        let steep = normal.dot(ray);
        let (t, rim_off) = self.depth(view, number, margin < slack, margin < 0.0);
        let in_front = t * frame.camera.forward().dot(ray) >= self.near_m;
        if !in_front || steep == 0.0 {
            return None;
        }
        let length = ray.length();
        let spread = (b - a).length() * (c - a).length();
        let reach = a.length().max(b.length()).max(c.length());
        let off = length * (16.0 * EPSILON * reach * spread + bound_m * normal.length()) / steep.abs()
            + 4.0 * EPSILON * t * length
            + rim_off;
        // where the triangle meets the terrain's border moves with its corners, and the farther the flatter it is seen
        let along = normal.length() * length / steep.abs();
        let border_off =
            off + ANY_ADAPTER_SNAP_PX * 2.0 * right.length().max(down.length()) * t * along + 1e-4 * (1.0 + reach);
        let border = if self.is_cut { border_margin_m(frame, ray * t) } else { f64::INFINITY };
        if border < -border_off {
            return None;
        }
        let is_doubtful = margin < slack || border < border_off;
        Some(Met { distance: t * length, off, is_doubtful })
    }

    /// The depth at which a ray meets the plane of a triangle, kept between those of its corners. Near the rim of a triangle of a list the
    /// rim may count, and beside it does; how far the two are apart is the second number.
    fn depth(&self, view: &View, number: usize, is_near_rim: bool, is_beside: bool) -> (f64, f64) {
        let View { frame, ray, .. } = *view;
        let [a, b, c] = self.triangles[number];
        let normal = (b - a).cross(c - a);
        // depth is linear on the triangle
        let depths = [a, b, c].map(|corner| corner.dot(frame.camera.forward()));
        let (near, far) = depths.iter().fold((f64::MAX, 0.0f64), |(low, high), &z| (low.min(z), high.max(z)));
        let t = (normal.dot(a) / normal.dot(ray)).max(near.max(0.0)).min(far);
        if self.is_cut || !is_near_rim {
            return (t, 0.0);
        }
        let side = a.dot(b.cross(c)).signum();
        let weights = DVec3::from([b.cross(c), c.cross(a), a.cross(b)].map(|edge| side * edge.dot(ray)));
        let inside = weights.max(DVec3::ZERO);
        let rim = (inside.dot(depths.into()) / inside.element_sum()).max(near.max(0.0)).min(far);
        // a bound is kept by looking at the surface itself there, whatever else is behind the nearest corner
        if self.casts_beside {
            return (near.max(self.near_m), f64::INFINITY);
        }
        (if is_beside { rim } else { t }, (rim - t).abs() * ray.length())
    }
}

/// A pixel's ray, of length 1 along the view direction, and what a pixel to the right and down adds to it.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    frame: &'a Frame<'a>,
    pub(super) ray: DVec3,
    right: DVec3,
    down: DVec3,
}

impl<'a> View<'a> {
    pub(super) fn new(frame: &'a Frame<'a>, pixel: DVec2) -> Self {
        let [right, down, corner] = frame.camera.pixel_basis();
        Self { frame, ray: corner + right * pixel.x + down * pixel.y, right, down }
    }
}

/// What a ray meets of one triangle.
struct Met {
    distance: f64,
    off: f64,
    /// Not every rasterizer draws it.
    is_doubtful: bool,
}
