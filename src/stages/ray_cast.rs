use std::sync::Arc;

use glam::{DVec2, UVec2};
use rayon::prelude::*;
use serde::Deserialize;

use super::height_pyramid::bounds_layout;
use super::{EPSILON, Info, Stage, read_params};
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::scene::Surface;
use crate::kernel::{Elem, Kernel};
use crate::plan::StepBuilder;
use crate::plan::{BufferId, Chain};
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "RayCast",
    summary: "exact first hit of every pixel's ray with the full-resolution surface: the ground truth",
    formula: "smallest t > 0 with eye.z + t d.z = surface(eye.xy + t d.xy)",
    source: "maximum-pyramid traversal after Tevs, Ihrke, Seidel 2008; sign test at cell borders is ours",
    reads: &["height", "height_max", "height_min"],
    writes: &["distance"],
    kernels: &["ray_cast.wgsl"],
    params: &[],
    read: |node, _| read_params::<RayCast>(node),
};

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RayCast {}

/// Pixels a side of the tiles whose rays are led to the surface together; `TILE` of the kernel.
pub(super) const TILE: u32 = 8;

/// What the traversal of `kernels/lib/traverse.wgsl` needs.
pub(super) struct Traversed {
    pub height: BufferId,
    pub highest: BufferId,
    pub lowest: BufferId,
}

impl Traversed {
    pub fn read(chain: &mut Chain) -> Result<Self, Diagnostic> {
        let layout = bounds_layout(chain.data.terrain.size);
        let height = chain.read("height")?;
        let highest = chain.read_as("height_max", Elem::F32, &layout.dims())?;
        if chain.data.sees_underside {
            let lowest = chain.read_as("height_min", Elem::F32, &layout.dims())?;
            return Ok(Self { height, highest, lowest });
        }
        chain.leave_out("the way under the surface", "no camera is under it or outside the terrain", 0, 0);
        Ok(Self { height, highest, lowest: highest })
    }

    /// A step with what every traversal is told.
    pub fn step<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        label: &str,
        kernel: &Arc<Kernel>,
        entry: &str,
    ) -> StepBuilder<'c, 'a> {
        let layout = bounds_layout(chain.data.terrain.size);
        let bilinear = chain.data.scene.surface == Surface::Bilinear;
        let underside = chain.data.sees_underside;
        chain
            .step(label, kernel, entry)
            .bind("height_max", self.highest)
            .constant("BILINEAR", f64::from(bilinear))
            .constant("UNDERSIDE", f64::from(underside))
            .set_camera()
            .set_terrain()
            .set("stride", layout.stride)
            .set("tall", layout.tall)
            .set("top", layout.top)
    }

    fn tiles(chain: &Chain) -> UVec2 {
        let (width, tall) = chain.data.scene.viewport;
        UVec2::new(width.div_ceil(TILE), tall.div_ceil(TILE))
    }

    /// What `LeadRays` has found out.
    pub fn known_tiles(chain: &Chain) -> Result<BufferId, Diagnostic> {
        let tiles = Self::tiles(chain);
        chain.read_as("clear_until", Elem::F32, &[tiles.y, tiles.x])
    }

    /// For each tile of pixels, how far its rays can be led at once. A bundle that may start under the surface is not led past
    /// anything; some buffer has to be bound all the same.
    pub fn lead_tiles(&self, chain: &mut Chain) -> Result<BufferId, Diagnostic> {
        if chain.data.sees_underside {
            return Ok(self.highest);
        }
        if chain.has("clear_until") {
            return Self::known_tiles(chain);
        }
        let tiles = Self::tiles(chain);
        let start =
            chain.make("clear_until", Elem::F32, &[tiles.y, tiles.x], "", "a t all rays of a tile reach without a hit");
        let kernel = Kernel::built_in("ray_cast.wgsl")?;
        let step = self.step(chain, "coarse", &kernel, "coarse");
        step.bind("height_min", self.lowest).bind("clear_until", start).over(tiles)?;
        Ok(start)
    }
}

impl Stage for RayCast {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let terrain = Traversed::read(chain)?;
        let start = terrain.lead_tiles(chain)?;
        let (width, tall) = chain.data.scene.viewport;
        let distance = chain.make_distance();
        let kernel = Kernel::built_in("ray_cast.wgsl")?;
        terrain
            .step(chain, "cast", &kernel, "main")
            .bind("height", terrain.height)
            .bind("height_min", terrain.lowest)
            .bind("start", start)
            .bind("distance", distance)
            .over(UVec2::new(width, tall))
    }

    fn reference(&self, frame: &Frame, buffers: &mut Buffers) {
        let (width, tall) = frame.camera.viewport;
        let pixels: Vec<(f64, f64)> = (0..tall)
            .into_par_iter()
            .flat_map_iter(|y| (0..width).map(move |x| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)))
            .map(|pixel| first_hit(frame, pixel))
            .collect();
        let mut distance = Values::missing(&[tall, width], 1);
        for (at, (value, bound)) in pixels.into_iter().enumerate() {
            distance.set(at, value, bound);
        }
        buffers.put("distance", distance);
    }
}

/// Distance of the first hit and its bound. Every line at which the surface's formula changes (columns, rows,
/// diagonals) is crossed one by one, so between two crossings the surface is one plane or one patch.
pub(super) fn first_hit(frame: &Frame, pixel: DVec2) -> (f64, f64) {
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
