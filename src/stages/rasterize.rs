use glam::{DVec2, DVec3, UVec2};
use rayon::prelude::*;
use serde::Deserialize;

use super::{EPSILON, Info, Stage, read_params};
use crate::camera::Camera;
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Kernel};
use crate::plan::Chain;
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "Rasterize",
    summary: "a grid mesh to the distance of the nearest triangle at every pixel",
    formula: "t = (n . a) / (n . d) for the nearest triangle that covers the pixel's centre",
    source: "visibility buffer after Burns, Hunt 2013; the mesh is cut at the terrain's border",
    reads: &["vertex"],
    writes: &["visible", "distance"],
    kernels: &["rasterize.wgsl"],
    params: &[],
    read: |node, _| read_params::<Rasterize>(node),
};

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rasterize {}

/// Nothing nearer than this is drawn, in metres along the view direction.
const NEAR_M: f32 = 0.1;

impl Stage for Rasterize {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let (vertices, size) = chain.read_grid("vertex", Elem::Vec4F32)?;
        let (columns, rows) = (size.x, size.y);
        let corners = 6 * u64::from(columns - 1) * u64::from(rows - 1);
        let Ok(corners) = u32::try_from(corners) else {
            return Err(Diagnostic::input(format!(
                "a mesh of {columns} x {rows} vertices has too many triangles to draw"
            ))
            .at(chain.origin(), "this stage"));
        };
        let visible = chain.make_target("visible", "number of the nearest triangle plus one; 0 is none");
        let distance = chain.make_distance();
        let kernel = Kernel::built_in("rasterize.wgsl")?;
        let axis = |pick: fn(&Camera) -> DVec3| move |camera: &Camera| pick(camera).as_vec3().to_array();
        let (width, tall) = chain.data.scene.viewport;
        for (label, entry) in [("draw", "draw"), ("resolve", "resolve")] {
            let step = chain
                .step(label, &kernel, entry)
                .set_camera()
                .set_terrain()
                .set("grid", [columns, rows])
                .set("near_m", NEAR_M)
                .set_per_frame("view_right", axis(|camera| camera.world_from_view.x_axis))
                .set_per_frame("view_up", axis(|camera| camera.world_from_view.y_axis))
                .set_per_frame("view_forward", axis(|camera| camera.world_from_view.z_axis))
                .set_per_frame("half_tan", |camera| camera.half_tan.as_vec2().to_array())
                .bind("vertex", vertices);
            match entry {
                "draw" => step.draw(corners, visible, "keep")?,
                _ => step.bind("visible", visible).bind("distance", distance).over(UVec2::new(width, tall))?,
            }
        }
        Ok(())
    }

    fn reference(&self, frame: &Frame, buffers: &mut Buffers) {
        let mesh = Mesh::of(&buffers.get("vertex"));
        let (width, tall) = frame.camera.viewport;
        let pixels: Vec<(f64, f64)> = (0..tall)
            .into_par_iter()
            .flat_map_iter(|y| (0..width).map(move |x| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)))
            .map(|pixel| mesh.nearest(frame, pixel))
            .collect();
        let mut distance = Values::missing(&[tall, width], 1);
        for (at, (value, bound)) in pixels.into_iter().enumerate() {
            distance.set(at, value, bound);
        }
        buffers.put("distance", distance);
    }
}

/// How far the rasterizer may move an edge: it snaps corners to a grid of at least 1/16 of a pixel (Vulkan's
/// smallest `subPixelPrecisionBits` is 4), so a corner moves by up to half the diagonal of that.
const SNAP_PX: f64 = 0.7072 / 16.0;

struct Mesh {
    triangles: Vec<[DVec3; 3]>,
    /// Bound of each triangle's corners, metres.
    bounds_m: Vec<f64>,
}

impl Mesh {
    fn of(vertices: &Values) -> Self {
        let (rows, columns) = (vertices.dims[0], vertices.dims[1]);
        let at = |x: u32, y: u32| 4 * (y * columns + x) as usize;
        let point = |x, y| DVec3::from_slice(&vertices.value[at(x, y)..]);
        let bound = |x, y| vertices.bound[at(x, y)..at(x, y) + 3].iter().copied().fold(0.0, f64::max);
        let (mut triangles, mut bounds_m) = (Vec::new(), Vec::new());
        for y in 0..rows - 1 {
            for x in 0..columns - 1 {
                for corners in [[(x, y), (x, y + 1), (x + 1, y)], [(x + 1, y), (x, y + 1), (x + 1, y + 1)]] {
                    triangles.push(corners.map(|(x, y)| point(x, y)));
                    bounds_m.push(corners.iter().map(|&(x, y)| bound(x, y)).fold(0.0, f64::max));
                }
            }
        }
        Self { triangles, bounds_m }
    }

    /// Distance along the ray of the nearest triangle, and its bound.
    fn nearest(&self, frame: &Frame, pixel: DVec2) -> (f64, f64) {
        let camera = frame.camera;
        let [right, down, corner] = camera.pixel_basis();
        let ray = corner + right * pixel.x + down * pixel.y;
        let (mut value, mut bound) = (f64::INFINITY, f64::MIN_POSITIVE);
        // hits that the rasterizer may or may not see
        let mut doubtful: Vec<(f64, f64)> = Vec::new();
        for (triangle, &bound_m) in self.triangles.iter().zip(&self.bounds_m) {
            let [a, b, c] = *triangle;
            let volume = a.dot(b.cross(c));
            let inside = [a.cross(b), b.cross(c), c.cross(a)].map(|edge| {
                let pixels = DVec2::new(edge.dot(right), edge.dot(down)).length();
                volume.signum() * edge.dot(ray) / pixels.max(1e-300)
            });
            let margin = inside.into_iter().fold(f64::MAX, f64::min);
            let slack = SNAP_PX + bound_m / (a.length().min(b.length()).min(c.length()) * right.length()).max(1e-9);
            if margin < -slack {
                continue;
            }
            let normal = (b - a).cross(c - a);
            let steep = normal.dot(ray);
            // t is the depth, which is linear on the triangle
            let depths = [a, b, c].map(|corner| corner.dot(camera.forward()));
            let (near, far) = depths.iter().fold((f64::MAX, 0.0f64), |(low, high), &z| (low.min(z), high.max(z)));
            let t = (normal.dot(a) / steep).max(near.max(0.0)).min(far);
            let in_front = t * camera.forward().dot(ray) > f64::from(NEAR_M);
            if !in_front || steep == 0.0 {
                continue;
            }
            let length = ray.length();
            let spread = (b - a).length() * (c - a).length();
            let reach = a.length().max(b.length()).max(c.length());
            let off = length * (16.0 * EPSILON * reach * spread + bound_m * normal.length()) / steep.abs()
                + 4.0 * EPSILON * t * length;
            // where the triangle meets the terrain's border moves with its corners, and the farther the flatter it is seen
            let along = normal.length() * length / steep.abs();
            let border_off = off + SNAP_PX * 2.0 * right.length().max(down.length()) * t * along + 1e-4 * (1.0 + reach);
            let border = border_margin_m(frame, ray * t);
            if border < -border_off {
                continue;
            }
            if margin < slack || border < border_off {
                doubtful.push((t * length, off));
            } else if t * length < value {
                (value, bound) = (t * length, off);
            }
        }
        for (t, off) in doubtful {
            if t < value + bound {
                // seen or not, the answer is one of the two; far apart, nothing can be said
                let apart = (value - t).abs();
                bound = if apart < 0.02 * t { bound.max(off) + apart } else { f64::INFINITY };
            }
        }
        if value.is_infinite() { (f64::NAN, bound) } else { (value, bound) }
    }
}

/// How far a camera-relative point is inside the terrain's rectangle, in metres.
fn border_margin_m(frame: &Frame, point: DVec3) -> f64 {
    let world = (point + frame.camera.eye_m).truncate();
    world.min(frame.data.terrain.extent_m() - world).min_element()
}
