//! Pixels in which a picture shows something farther away than the mesh that was drawn: sky or a farther surface seen through it.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::triangles::Triangles;
use crate::camera::Camera;

/// How far from a pixel's centre the mesh has to be closed, in pixels: rasterizers move edges by up to 1/16 of a pixel.
const AROUND_PX: f64 = 0.09;
/// What is nearer than this, in metres, may have been clipped.
const NEAREST_M: f64 = 2e-4;
/// Rows of pixels that are looked at together.
const BAND: u32 = 16;

/// Pixels through which one sees: those that `drawn_m` (distances along their rays in metres, negative for none) shows behind a gap between
/// the mesh's triangles, whatever it is that stands there, and those that it shows behind the mesh itself, although all rays around them meet
/// the mesh before; of these, one that shows what there is to see is none.
pub fn count(mesh: &Triangles, gaps: &Triangles, camera: &Camera, drawn_m: &[f32], true_m: &[f64]) -> usize {
    let (width_px, height_px) = camera.viewport;
    let (mesh, gaps) = (Bands::new(mesh, camera), Bands::new(gaps, camera));
    let in_band = |band: u32| {
        let (listed, open) = (mesh.listed(band), gaps.listed(band));
        let rows = band * BAND..((band + 1) * BAND).min(height_px);
        let nearest_gap = nearest(&open, camera, rows.clone());
        let nearest = nearest(&listed, camera, rows.clone());
        let pixels = rows.flat_map(|y| (0..width_px).map(move |x| (x, y)));
        let is_hole = |&((x, y), (near, gap)): &((u32, u32), (f64, f64))| {
            let drawn = f64::from(drawn_m[(y * width_px + x) as usize]);
            let is_behind = |near: f64| near.is_finite() && (drawn < 0.0 || drawn > near * (1.0 + 1e-3) + 1e-3);
            if is_behind(gap) {
                return true;
            }
            let truth = true_m[(y * width_px + x) as usize];
            let is_true = drawn < 0.0 && truth < 0.0 || (drawn - truth).abs() <= 1e-5 * truth;
            if is_true || !is_behind(near) {
                return false;
            }
            let hits: Vec<f64> = around(x, y).map(|place| first_hit(&listed, camera, place)).collect();
            let farthest = hits.iter().copied().fold(near, f64::max);
            hits.into_iter().all(is_behind) && !shows_rim(&listed, camera, (x, y), farthest, drawn)
        };
        pixels.zip(nearest.into_iter().zip(nearest_gap)).filter(is_hole).count()
    };
    (0..height_px.div_ceil(BAND)).into_par_iter().map(in_band).sum()
}

/// Triangles by the bands of rows that they may cover.
struct Bands {
    triangles: Vec<Triangle>,
    of_band: Vec<Vec<u32>>,
}

impl Bands {
    fn new(mesh: &Triangles, camera: &Camera) -> Self {
        let triangles: Vec<Triangle> =
            mesh.corners.iter().filter_map(|corners| Triangle::new(corners, camera)).collect();
        let height_px = camera.viewport.1;
        let mut of_band: Vec<Vec<u32>> = vec![Vec::new(); height_px.div_ceil(BAND) as usize];
        for (number, triangle) in triangles.iter().enumerate() {
            let (first, last) = (triangle.rows.0 / BAND, triangle.rows.1.min(height_px - 1) / BAND);
            (first..=last).for_each(|band| of_band[band as usize].push(number as u32));
        }
        Self { triangles, of_band }
    }

    fn listed(&self, band: u32) -> Vec<&Triangle> {
        self.of_band[band as usize].iter().map(|&number| &self.triangles[number as usize]).collect()
    }
}

fn around(x: u32, y: u32) -> impl Iterator<Item = DVec2> {
    let centre = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
    (0..8).map(move |at| centre + DVec2::from_angle(f64::from(at) * std::f64::consts::FRAC_PI_4) * AROUND_PX)
}

/// A triangle as planes through the eye.
struct Triangle {
    /// Normals of the planes through the eye and each edge, inward; what a ray has to be on the inner side of.
    edges: [DVec3; 3],
    normal: DVec3,
    distance: f64,
    /// Of the nearest and the farthest corner, along the view direction.
    depths: (f64, f64),
    /// Pixels that it may cover.
    columns: (u32, u32),
    rows: (u32, u32),
}

impl Triangle {
    fn new(corners: &[[f32; 3]; 3], camera: &Camera) -> Option<Self> {
        let [a, b, c] = corners.map(|corner| DVec3::from(corner.map(f64::from)));
        let depths = [a, b, c].map(|corner| corner.dot(camera.forward()));
        if depths.iter().all(|&depth| depth <= 0.0) {
            return None;
        }
        let turn = a.dot(b.cross(c)).signum();
        let normal = (b - a).cross(c - a);
        let (width_px, height_px) = camera.viewport;
        let (mut columns, mut rows) = ((0, width_px - 1), (0, height_px - 1));
        if depths.iter().all(|&depth| depth > 1e-4) {
            let pixels = [a, b, c].map(|corner| camera.pixel(corner + camera.eye_m).unwrap_or(DVec2::ZERO));
            let low = pixels.into_iter().fold(DVec2::MAX, DVec2::min);
            let high = pixels.into_iter().fold(DVec2::MIN, DVec2::max);
            if high.x < -1.0 || high.y < -1.0 || low.x > f64::from(width_px) + 1.0 || low.y > f64::from(height_px) + 1.0
            {
                return None;
            }
            // `as` keeps to the range of u32
            columns = ((low.x - 1.0) as u32, ((high.x + 1.0) as u32).min(width_px - 1));
            rows = ((low.y - 1.0) as u32, ((high.y + 1.0) as u32).min(height_px - 1));
        }
        let edges = [a.cross(b) * turn, b.cross(c) * turn, c.cross(a) * turn];
        let depths = depths.into_iter().fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
        Some(Self { edges, normal, distance: normal.dot(a), depths, columns, rows })
    }

    /// Distance along a unit ray, if it meets the triangle or its rim.
    fn hit(&self, ray: DVec3) -> Option<f64> {
        let is_inside = self.edges.iter().all(|edge| edge.dot(ray) >= 0.0);
        let t = self.distance / self.normal.dot(ray);
        (is_inside && t > NEAREST_M && t.is_finite()).then_some(t)
    }
}

/// For each pixel of some rows, the nearest hit of the ray through its centre.
fn nearest(listed: &[&Triangle], camera: &Camera, rows: std::ops::Range<u32>) -> Vec<f64> {
    let width_px = camera.viewport.0;
    let [right, down, corner] = camera.pixel_basis();
    let mut nearest = vec![f64::INFINITY; (rows.len() as u32 * width_px) as usize];
    for triangle in listed {
        for y in rows.start.max(triangle.rows.0)..rows.end.min(triangle.rows.1 + 1) {
            for x in triangle.columns.0..=triangle.columns.1 {
                let ray = corner + right * (f64::from(x) + 0.5) + down * (f64::from(y) + 0.5);
                if let Some(t) = triangle.hit(ray) {
                    let place = &mut nearest[((y - rows.start) * width_px + x) as usize];
                    *place = place.min(t * ray.length());
                }
            }
        }
    }
    nearest
}

/// Whether a triangle at the pixel's rim reaches from the surface that the pixel should show to what it shows: a rasterizer that moved
/// its edge over the pixel drew its plane there, which is seen edge-on.
fn shows_rim(listed: &[&Triangle], camera: &Camera, (x, y): (u32, u32), farthest: f64, drawn: f64) -> bool {
    let [right, down, corner] = camera.pixel_basis();
    let ray = corner + right * (f64::from(x) + 0.5) + down * (f64::from(y) + 0.5);
    let length = ray.length();
    listed.iter().any(|triangle| {
        let beside = |edge: &DVec3| edge.dot(ray) / DVec2::new(edge.dot(right), edge.dot(down)).length();
        let is_near = triangle.edges.iter().all(|edge| beside(edge) >= -AROUND_PX);
        let (from, to) = triangle.depths;
        is_near && drawn > 0.0 && from * length <= farthest * (1.0 + 1e-3) && to * length * (1.0 + 1e-6) >= drawn
    })
}

fn first_hit(listed: &[&Triangle], camera: &Camera, place: DVec2) -> f64 {
    let ray = camera.ray(place);
    listed.iter().filter_map(|triangle| triangle.hit(ray)).fold(f64::INFINITY, f64::min)
}
