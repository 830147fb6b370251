use glam::{DVec2, DVec3, UVec2};
use rayon::prelude::*;
use serde::Deserialize;

use super::grid_error::THRESHOLD;
use super::height_pyramid::bounds_layout;
use super::ray_cast::{TILE, Traversed};
use super::{EPSILON, Info, Stage, read_params};
use crate::camera::Camera;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::scene::Surface;
use crate::kernel::{Elem, Kernel};
use crate::plan::Chain;
use crate::plan::StepBuilder;
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "Rasterize",
    summary: "a grid mesh to the distance of the nearest triangle at every pixel",
    formula: "t = (n . a) / (n . d) for the nearest triangle that covers the pixel's centre",
    source: "visibility buffer after Burns, Hunt 2013; the mesh is cut at the terrain's border",
    reads: &["vertex"],
    writes: &["drawn", "distance", "error"],
    kernels: &["rasterize.wgsl"],
    params: &[],
    read: |node, _| read_params::<Rasterize>(node),
};

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rasterize {}

/// Nothing nearer than this is drawn, in metres along the view direction.
const NEAR_M: f32 = 0.1;

/// The same for a list of triangles between samples, on which an eye can stand.
const NEAR_LIST_M: f32 = 1e-4;

/// A step with what all of them set.
fn step<'c, 'a>(
    chain: &'c mut Chain<'a>,
    label: &str,
    entry: &str,
    threshold_px: f64,
) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
    let kernel = Kernel::built_in("rasterize.wgsl")?;
    let axis = |pick: fn(&Camera) -> DVec3| move |camera: &Camera| pick(camera).as_vec3().to_array();
    let layout = bounds_layout(chain.data.terrain.size);
    let bilinear = chain.data.scene.surface == Surface::Bilinear;
    let underside = chain.data.sees_underside;
    let step = chain.step(label, &kernel, entry).set_camera().set_terrain();
    Ok(step
        .constant("BILINEAR", f64::from(bilinear))
        .constant("UNDERSIDE", f64::from(underside))
        .set("stride", layout.stride)
        .set("tall", layout.tall)
        .set("top", layout.top)
        .set("threshold_px", threshold_px as f32)
        .set("snap_px", super::grid_error::SNAP_PX)
        .set_per_frame("focal_px", |camera| camera.focal_px() as f32)
        .set_per_frame("view_right", axis(|camera| camera.world_from_view.x_axis))
        .set_per_frame("view_up", axis(|camera| camera.world_from_view.y_axis))
        .set_per_frame("view_forward", axis(|camera| camera.world_from_view.z_axis))
        .set_per_frame("half_tan", |camera| camera.half_tan.as_vec2().to_array()))
}

/// Draws the triangles of a list, as many as the GPU has counted.
fn plan_list(chain: &mut Chain) -> Result<(), Diagnostic> {
    let size = chain.data.terrain.size;
    let height = chain.read_as("height", Elem::F32, &[size.y, size.x])?;
    let triangles = chain.read("triangle")?;
    let triangles = chain.read_own("triangle", Elem::Vec4U32, &chain.buffer(triangles).dims.clone())?;
    let count = chain.read_own("triangle_count", Elem::U32, &[4])?;
    let meaning = "distance of the nearest triangle as the bits of an f32, negative beside it; 0 is none";
    let drawn = chain.make_target("drawn", Elem::U32, meaning);
    let distance = chain.make_distance();
    let promise = chain.promise_of(triangles);
    if let Some(promise) = promise {
        chain.promise(promise, distance);
    }
    let proven = promise.is_some_and(|promise| promise.proven);
    let traversed = if proven { Some(Traversed::read(chain)?) } else { None };
    let draw = step(chain, "draw", "draw_list", 0.0)?.set("grid", [0u32; 2]).set("near_m", NEAR_LIST_M);
    draw.bind("triangle", triangles).bind("samples", height).draw_list(count, drawn, "keep_list")?;
    let (width, tall) = chain.data.scene.viewport;
    let resolve = step(chain, "resolve", "resolve_list", 0.0)?.constant("PROVEN", f64::from(proven));
    let resolve = resolve.set("grid", [0u32; 2]).set("near_m", NEAR_LIST_M).bind("height", height);
    let resolve = match traversed {
        Some(known) => resolve.bind("height_max", known.highest).bind("height_min", known.lowest),
        None => resolve.leave_unbound("height_max").leave_unbound("height_min"),
    };
    resolve.bind("drawn", drawn).bind("distance", distance).over(UVec2::new(width, tall))
}

impl Stage for Rasterize {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        // of a grid and a list, the one that was made last
        let is_list =
            chain.has("triangle") && (!chain.has("vertex") || chain.read("triangle")? > chain.read("vertex")?);
        if is_list { plan_list(chain) } else { plan_grid(chain) }
    }

    fn reference(&self, frame: &Frame, buffers: &mut Buffers) {
        let mesh = match buffers.contains("triangle_count") {
            true => {
                let proven = buffers.contains(super::roughness::IS_BOUND);
                Mesh::of_list(frame, &buffers.get("triangle"), &buffers.get("triangle_count"), proven)
            }
            false => Mesh::of_grid(&buffers.get("vertex"), &buffers.get("cell_bound")),
        };
        // how far a grid was raised is known to an interval only: what it covers then hangs on that
        let is_loose = mesh.is_proven() && mesh.bounds_m.iter().any(|&bound_m| bound_m > 1e-3);
        let threshold_px = buffers.get(THRESHOLD).value.first().copied();
        let (width, tall) = frame.camera.viewport;
        let clear_until = buffers.contains("clear_until").then(|| buffers.get("clear_until"));
        let seen = |y: u32, x: u32| {
            let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            if mesh.is_open {
                return ((f64::NAN, f64::INFINITY), (f64::NAN, 0.0));
            }
            let hit = mesh.nearest(frame, pixel);
            let Some(threshold_px) = threshold_px else { return (hit.distance, (f64::NAN, 0.0)) };
            if is_loose {
                return ((f64::NAN, f64::INFINITY), (f64::NAN, f64::INFINITY));
            }
            if hit.triangle.is_none() && mesh.is_proven() {
                let tile = (y / TILE * width.div_ceil(TILE) + x / TILE) as usize;
                let is_sky = |clear: &std::sync::Arc<Values>| !frame.data.sees_underside && clear.value[tile] > 1e38;
                let led = !frame.data.sees_underside;
                let unknown = led && clear_until.as_ref().is_some_and(|clear| clear.bound[tile] > 0.0);
                let open = if hit.distance.1.is_infinite() || unknown { f64::INFINITY } else { f64::MIN_POSITIVE };
                return (hit.distance, (f64::from(!clear_until.as_ref().is_some_and(is_sky)), open));
            }
            mesh.error(frame, pixel, &hit, threshold_px)
        };
        let pixels: Vec<((f64, f64), (f64, f64))> = (0..tall)
            .into_par_iter()
            .flat_map_iter(|y| (0..width).map(move |x| (y, x)))
            .map(|(y, x)| seen(y, x))
            .collect();
        let mut distance = Values::missing(&[tall, width], 1);
        let mut error = Values::missing(&[tall, width], 1);
        for (at, ((value, bound), (own, own_bound))) in pixels.into_iter().enumerate() {
            distance.set(at, value, bound);
            error.set(at, own, own_bound);
        }
        buffers.put("distance", distance);
        if threshold_px.is_some() {
            buffers.put("error", error);
        }
    }
}

fn plan_grid(chain: &mut Chain) -> Result<(), Diagnostic> {
    let (vertices, size) = chain.read_grid("vertex", Elem::Vec4F32)?;
    let corners = (2 * u64::from(size.x) + 2) * u64::from(size.y - 1);
    let Ok(corners) = u32::try_from(corners) else {
        return Err(Diagnostic::input(format!(
            "a mesh of {} x {} vertices has too many triangles to draw",
            size.x, size.y
        ))
        .at(chain.origin(), "this stage"));
    };
    let promise = chain.promise_of(vertices);
    let proven = promise.is_some_and(|promise| promise.proven);
    let bounds = if proven { chain.read_as("cell_bound", Elem::Vec4F32, &[size.y - 1, size.x - 1])? } else { vertices };
    let (elem, meaning) = match promise {
        None => (Elem::U32, "distance of the nearest triangle as the bits of an f32; 0 is none"),
        Some(_) => (Elem::Vec2U32, "distance of the nearest triangle and its error, as the bits of f32; 0 is none"),
    };
    let led = proven && chain.has("clear_until") && !chain.data.sees_underside;
    let tiles = if led { Some(Traversed::known_tiles(chain)?) } else { None };
    let drawn = chain.make_target("drawn", elem, meaning);
    let distance = chain.make_distance();
    let (width, tall) = chain.data.scene.viewport;
    let error = promise.map(|_| {
        chain.make(
            "error",
            Elem::F32,
            &[tall, width],
            "",
            "normalised error of what is drawn; 0 is within the threshold",
        )
    });
    for (promise, buffer) in promise.into_iter().flat_map(|promise| [Some(distance), error].map(|id| (promise, id))) {
        if let Some(buffer) = buffer {
            chain.promise(promise, buffer);
        }
    }
    let entries = if error.is_some() { ("keep_error", "resolve_error") } else { ("keep", "resolve") };
    for (label, entry) in [("draw", "draw"), ("resolve", entries.1)] {
        let sees_underside = chain.data.sees_underside;
        let step = step(chain, label, entry, promise.map_or(0.0, |promise| promise.bound_px))?
            .constant("PROVEN", f64::from(proven))
            .constant("LED", f64::from(tiles.is_some()))
            .constant("DISCARD", f64::from(sees_underside))
            .set("grid", size.to_array())
            .set("near_m", NEAR_M);
        if label == "draw" {
            step.bind("vertex", vertices).bind("cell_bound", bounds).draw_strip(corners, drawn, entries.0)?;
            continue;
        }
        let step = step.bind("drawn", drawn).bind("distance", distance);
        match error {
            Some(error) => {
                let step = step.bind("error", error);
                let step = match tiles {
                    Some(tiles) => step.bind("clear_until", tiles),
                    None => step.leave_unbound("clear_until"),
                };
                step.over(UVec2::new(width, tall))?
            }
            None => step.over(UVec2::new(width, tall))?,
        }
    }
    Ok(())
}

/// How far the rasterizer may move an edge: it snaps corners to a grid of at least 1/16 of a pixel (Vulkan's
/// smallest `subPixelPrecisionBits` is 4), so a corner moves by up to half the diagonal of that.
const SNAP_PX: f64 = 0.7072 / 16.0;

struct Mesh {
    triangles: Vec<[DVec3; 3]>,
    /// Bound of each triangle's corners, metres.
    bounds_m: Vec<f64>,
    /// What the corners carry: their errors, or how far they were raised.
    carried: Vec<[f64; 3]>,
    /// Lowest and highest of surface minus the plane that was raised; empty for a mesh that is not proven.
    found_m: Vec<(f64, f64)>,
    near_m: f64,
    /// At the terrain's border.
    is_cut: bool,
    /// A ray that passes beside its triangle is cast.
    casts_beside: bool,
    /// Which triangles there are hangs on a decision.
    is_open: bool,
}

/// What a pixel sees of a mesh.
struct Hit {
    /// With its bound; NaN for nothing.
    distance: (f64, f64),
    triangle: Option<usize>,
}

impl Mesh {
    fn of_list(frame: &Frame, keys: &Values, count: &Values, casts_beside: bool) -> Self {
        let terrain = &frame.data.terrain;
        let corner = |key: f64| {
            let (column, row) = (key as u32 & 0xffff, key as u32 >> 16);
            let ground = DVec2::new(column.into(), f64::from(terrain.size.y - 1 - row)) * terrain.cell_m;
            ground.extend(terrain.height_m(column, row).into()) - frame.camera.eye_m
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
        let carried = vec![[0.0; 3]; triangles.len()];
        let is_open = count.bound[0].is_infinite();
        Self {
            triangles,
            bounds_m,
            carried,
            found_m: Vec::new(),
            near_m: NEAR_LIST_M.into(),
            is_cut: false,
            casts_beside,
            is_open,
        }
    }

    fn of_grid(vertices: &Values, cell_bounds: &Values) -> Self {
        let (rows, columns) = (vertices.dims[0], vertices.dims[1]);
        let at = |x: u32, y: u32| 4 * (y * columns + x) as usize;
        let point = |x, y| DVec3::from_slice(&vertices.value[at(x, y)..]);
        let bound = |x, y| vertices.bound[at(x, y)..at(x, y) + 3].iter().copied().fold(0.0, f64::max);
        let (mut triangles, mut bounds_m, mut carried) = (Vec::new(), Vec::new(), Vec::new());
        for y in 0..rows - 1 {
            for x in 0..columns - 1 {
                for corners in [[(x, y), (x, y + 1), (x + 1, y)], [(x + 1, y), (x, y + 1), (x + 1, y + 1)]] {
                    triangles.push(corners.map(|(x, y)| point(x, y)));
                    bounds_m.push(corners.iter().map(|&(x, y)| bound(x, y)).fold(0.0, f64::max));
                    carried.push(corners.map(|(x, y)| vertices.value[at(x, y) + 3]));
                }
            }
        }
        let found_m = cell_bounds.value.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
        Self {
            triangles,
            bounds_m,
            carried,
            found_m,
            near_m: NEAR_M.into(),
            is_cut: true,
            casts_beside: false,
            is_open: false,
        }
    }

    fn is_proven(&self) -> bool {
        self.found_m.len() == self.triangles.len()
    }

    /// The nearest triangle on a pixel's ray.
    fn nearest(&self, frame: &Frame, pixel: DVec2) -> Hit {
        let camera = frame.camera;
        let [right, down, corner] = camera.pixel_basis();
        let ray = corner + right * pixel.x + down * pixel.y;
        let (mut value, mut bound, mut nearest) = (f64::INFINITY, f64::MIN_POSITIVE, None);
        // hits that the rasterizer may or may not see
        let mut doubtful: Vec<(f64, f64)> = Vec::new();
        for (number, (triangle, &bound_m)) in self.triangles.iter().zip(&self.bounds_m).enumerate() {
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
            let mut t = (normal.dot(a) / steep).max(near.max(0.0)).min(far);
            let mut rim_off = 0.0;
            if !self.is_cut && margin < slack {
                // beside a triangle of a list, its rim counts
                let weights =
                    DVec3::from([b.cross(c), c.cross(a), a.cross(b)].map(|edge| volume.signum() * edge.dot(ray)));
                let inside = weights.max(DVec3::ZERO);
                let rim = (inside.dot(depths.into()) / inside.element_sum()).max(near.max(0.0)).min(far);
                // a bound is kept by looking at the surface itself there
                rim_off = if self.casts_beside { f64::INFINITY } else { (rim - t).abs() * ray.length() };
                t = if margin < 0.0 { rim } else { t };
            }
            let in_front = t * camera.forward().dot(ray) > self.near_m;
            if !in_front || steep == 0.0 {
                continue;
            }
            let length = ray.length();
            let spread = (b - a).length() * (c - a).length();
            let reach = a.length().max(b.length()).max(c.length());
            let off = length * (16.0 * EPSILON * reach * spread + bound_m * normal.length()) / steep.abs()
                + 4.0 * EPSILON * t * length
                + rim_off;
            // where the triangle meets the terrain's border moves with its corners, and the farther the flatter it is seen
            let along = normal.length() * length / steep.abs();
            let border_off = off + SNAP_PX * 2.0 * right.length().max(down.length()) * t * along + 1e-4 * (1.0 + reach);
            let border = if self.is_cut { border_margin_m(frame, ray * t) } else { f64::INFINITY };
            if border < -border_off {
                continue;
            }
            if margin < slack || border < border_off {
                doubtful.push((t * length, off));
            } else if t * length < value {
                (value, bound, nearest) = (t * length, off, Some(number));
            }
        }
        for (t, off) in doubtful {
            if t < value + bound {
                // seen or not, the answer is one of the two; far apart, nothing can be said
                let apart = (value - t).abs();
                bound = if apart < 0.02 * t { bound.max(off) + apart } else { f64::INFINITY };
            }
        }
        let value = if value.is_infinite() { f64::NAN } else { value };
        Hit { distance: (value, bound), triangle: nearest }
    }
}

impl Mesh {
    /// Distance and normalised error, each with its bound, of what a pixel sees.
    fn error(&self, frame: &Frame, pixel: DVec2, hit: &Hit, threshold_px: f64) -> ((f64, f64), (f64, f64)) {
        let undecided = ((f64::NAN, f64::INFINITY), (f64::NAN, f64::INFINITY));
        let Some(number) = hit.triangle else {
            let open = if hit.distance.1.is_infinite() { f64::INFINITY } else { f64::MIN_POSITIVE };
            return (hit.distance, (0.0, open));
        };
        if hit.distance.1.is_infinite() {
            return undecided;
        }
        if self.is_proven() {
            return self.proven(frame, pixel, hit, number, threshold_px).unwrap_or(undecided);
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
            let moved = (ray + step * (SNAP_PX * corner.length().max(1.0))).normalize();
            (at(moved * (normal.dot(a) / normal.dot(moved))) - at(point)).abs()
        });
        let spread =
            carried.iter().copied().fold(f64::MIN, f64::max) - carried.iter().copied().fold(f64::MAX, f64::min);
        let off = 2.0 * (aside[0] + aside[1]) + 2e-4 * spread + 1e-6;
        (hit.distance, (at(point).clamp(0.0, 1.0), if off.is_finite() { off } else { f64::INFINITY }))
    }

    /// The same for a mesh whose cells have bounds; `None` where rounding decides.
    fn proven(
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
        let beside_m = 2.0 * f64::from(super::grid_error::SNAP_PX) * (aside(right) + aside(down)).sqrt();
        let low = corners.into_iter().fold(DVec3::MAX, DVec3::min).truncate();
        let high = corners.into_iter().fold(DVec3::MIN, DVec3::max).truncate();
        // the footprint: a rim of 1/64 and a quarter as deep behind (docs/proven_bound.md), less a hundredth for rounding
        let edge_m = 0.99 / 64.0 * (high - low).max_element();
        let reach = corners.map(|corner| corner.truncate().length());
        let (nearest, farthest) = reach.iter().fold((f64::MAX, 0.0f64), |(l, h), &r| (l.min(r), h.max(r)));
        let behind = 1.0 + 0.99 * 0.25 * (1.0 - nearest / farthest);
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

/// How far a camera-relative point is inside the terrain's rectangle, in metres.
pub(super) fn border_margin_m(frame: &Frame, point: DVec3) -> f64 {
    let world = (point + frame.camera.eye_m).truncate();
    world.min(frame.data.terrain.extent_m() - world).min_element()
}
