use glam::{DVec2, DVec3, UVec2};
use serde::Deserialize;

use super::height_pyramid::bounds_layout;
use super::{EPSILON, Info, Stage};
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::scene::Surface;
use crate::kernel::{Elem, Kernel};
use crate::plan::{BufferId, Chain};
use crate::plan::{Promise, StepBuilder};
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "GridError",
    summary: "the error of a projected grid: estimated at its points (Paper), or bounded with the grid raised above the surface (Proven)",
    formula: "delta = max(h_max - h_avg, h_avg - h_min); rho = lambda delta / |p - e|; error = 0 if rho < gamma, else 1 - gamma / rho",
    source: "Loeffler et al. 2009, Eq. 2, 3, 4 and the displacement by the maximum; Proven is ours: docs/proven_bound.md",
    reads: &["vertex", "height", "height_max", "height_min", "height_plane", "plane_slope"],
    writes: &["vertex", "grid_error", "cell_bound", "cell_raise"],
    kernels: &["grid_error.wgsl"],
    params: &[
        (
            "rule",
            "Paper",
            "Paper estimates at grid points from the minimum and maximum pyramids; Proven bounds whole cells",
        ),
        ("threshold_px", "1.0", "the error that the mesh is allowed, gamma"),
    ],
    read: |node, _| {
        let stage: GridError = node.parse_fields()?;
        if !(stage.threshold_px > 0.0 && stage.threshold_px.is_finite()) {
            let place = node.field("threshold_px").unwrap_or(node);
            return Err(Diagnostic::input(format!("an error of {} px", stage.threshold_px))
                .at(&place.origin, "a threshold is more than 0 px"));
        }
        Ok(Box::new(stage))
    },
};

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GridError {
    rule: Rule,
    threshold_px: f64,
}

impl Default for GridError {
    fn default() -> Self {
        Self { rule: Rule::Paper, threshold_px: 1.0 }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
enum Rule {
    Paper,
    Proven,
}

/// Under this name the reference tells the stages after it what the error is measured against.
pub(super) const THRESHOLD: &str = "threshold_px";

/// How far the rasterizer may see a corner from where it is. It works on corners rounded to 1/256 of a pixel or finer (D3D 11
/// asks for 8 bits, every desktop and software adapter has them): half the diagonal of that, and what transforming a corner
/// in f32 adds.
pub(super) const SNAP_PX: f32 = 0.005;

impl Stage for GridError {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let (vertices, size) = chain.read_grid("vertex", Elem::Vec4F32)?;
        if chain.promise_of(vertices).is_some() {
            return Err(
                Diagnostic::input("these vertices have their error already").at(chain.origin(), "a second time")
            );
        }
        let samples = chain.data.terrain.size;
        let height = chain.read_as("height", Elem::F32, &[samples.y, samples.x])?;
        let layout = bounds_layout(samples);
        let grid = Grid { vertices, size, height };
        match self.rule {
            Rule::Paper => {
                let highest = chain.read_as("height_max", Elem::F32, &layout.dims())?;
                let lowest = chain.read_as("height_min", Elem::F32, &layout.dims())?;
                self.plan_paper(chain, grid, lowest, highest)
            }
            Rule::Proven => {
                let planes = chain.read_as("height_plane", Elem::Vec2F32, &layout.dims())?;
                let slopes = chain.read_as("plane_slope", Elem::U32, &layout.dims())?;
                self.plan_proven(chain, grid, planes, slopes)
            }
        }
    }

    fn reference(&self, frame: &Frame, buffers: &mut Buffers) {
        buffers.put(THRESHOLD, Values::exact(&[1], 1, vec![self.threshold_px]));
        match self.rule {
            Rule::Paper => self.paper(frame, buffers),
            Rule::Proven => proven(frame, buffers),
        }
    }
}

/// The grid that is looked at.
#[derive(Clone, Copy)]
struct Grid {
    vertices: BufferId,
    size: UVec2,
    height: BufferId,
}

impl GridError {
    fn step<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        label: &str,
        grid: Grid,
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        let layout = bounds_layout(chain.data.terrain.size);
        let scene = &chain.data.scene;
        let lambda = f64::from(scene.viewport.1) / scene.fov_deg.to_radians();
        let bilinear = scene.surface == Surface::Bilinear;
        let kernel = Kernel::built_in("grid_error.wgsl")?;
        Ok(chain
            .step(label, &kernel, label)
            .bind("vertex", grid.vertices)
            .constant("BILINEAR", f64::from(bilinear))
            .set_terrain()
            .set("grid", grid.size.to_array())
            .set("stride", layout.stride)
            .set("tall", layout.tall)
            .set("top", layout.top)
            .set("threshold_px", self.threshold_px as f32)
            .set("lambda", lambda as f32)
            .set_per_frame("focal_px", |camera| camera.focal_px() as f32)
            .set("snap_px", SNAP_PX))
    }

    fn plan_paper(&self, chain: &mut Chain, grid: Grid, lowest: BufferId, highest: BufferId) -> Result<(), Diagnostic> {
        let dims = [grid.size.y, grid.size.x];
        let meaning = "x east, y north, z up from the eye; w: normalised error";
        let moved = chain.make("vertex", Elem::Vec4F32, &dims, "m", meaning);
        let error = chain.make("grid_error", Elem::F32, &dims, "", "normalised error of each grid point (Eq. 4)");
        chain.promise(Promise { bound_px: self.threshold_px, proven: false }, moved);
        self.step(chain, "paper", grid)?
            .bind("height", grid.height)
            .bind("height_min", lowest)
            .bind("height_max", highest)
            .bind("moved", moved)
            .bind_if_wanted("grid_error", error, "WRITE_ERROR")
            .over(grid.size)
    }

    fn plan_proven(&self, chain: &mut Chain, grid: Grid, planes: BufferId, slopes: BufferId) -> Result<(), Diagnostic> {
        let cells = [grid.size.y - 1, grid.size.x - 1];
        let meaning = "lowest and highest of surface minus plane, for both triangles of each cell";
        let bounds = chain.make("cell_bound", Elem::Vec4F32, &cells, "m", meaning);
        let raises = chain.make("cell_raise", Elem::F32, &cells, "m", "how far a cell's corners have to rise");
        self.step(chain, "bound", grid)?
            .bind("height", grid.height)
            .bind("height_plane", planes)
            .bind("plane_slope", slopes)
            .bind("cell_bound", bounds)
            .bind("cell_raise", raises)
            .over(grid.size - 1)?;
        let meaning = "x east, y north, z up from the eye; w: metres it was raised";
        let moved = chain.make("vertex", Elem::Vec4F32, &[grid.size.y, grid.size.x], "m", meaning);
        chain.promise(Promise { bound_px: self.threshold_px, proven: true }, moved);
        self.step(chain, "raise", grid)?.bind("raises", raises).bind("moved", moved).over(grid.size)
    }

    fn paper(&self, frame: &Frame, buffers: &mut Buffers) {
        let vertices = buffers.get("vertex");
        let terrain = &frame.data.terrain;
        let (eye_m, top) = (frame.camera.eye_m, bounds_layout(terrain.size).top);
        let lambda = f64::from(frame.data.scene.viewport.1) / frame.data.scene.fov_deg.to_radians();
        let last = (terrain.size - 1).as_dvec2();
        let mut moved = (*vertices).clone();
        let mut errors = Values::missing(&vertices.dims, 1);
        for at in 0..errors.value.len() {
            let (v, off) = (&vertices.value[4 * at..4 * at + 4], &vertices.bound[4 * at..4 * at + 4]);
            let point = DVec3::from_slice(v);
            let place = terrain.sample_from_world(point.truncate() + eye_m.truncate()).clamp(DVec2::ZERO, last);
            let off_cells = off[0].max(off[1]) / terrain.cell_m.min_element() + 8.0 * EPSILON * last.max_element();
            let level = v[3].clamp(0.0, top.into());
            let off_level = off[3] + 8.0 * EPSILON * level;
            let range = |level: u32| Ranges { buffers, size: terrain.size }.at(level.min(top), place, off_cells);
            let (fine, coarse, next) = (range(level as u32), range(level as u32 + 1), range(level as u32 + 2));
            let before = range((level as u32).saturating_sub(1));
            let blend = |pick: fn(&(f64, f64, f64)) -> f64| pick(&fine) + (pick(&coarse) - pick(&fine)) * level.fract();
            let (low, high) = (blend(|range| range.0) - eye_m.z, blend(|range| range.1) - eye_m.z);
            // past a whole level the blend goes on where the one before ended
            let jump = |a: &(f64, f64, f64), b: &(f64, f64, f64)| (a.0 - b.0).abs().max((a.1 - b.1).abs());
            let step_m = jump(&fine, &coarse).max(jump(&coarse, &next)).max(jump(&before, &fine));
            let off_m = fine.2.max(coarse.2) + off_level * step_m + off[2] + 8.0 * EPSILON * (high - low).abs();
            let delta_m = (high - point.z).max(point.z - low).max(0.0);
            let distance_m = point.length().max(1e-6);
            let rho_px = lambda * delta_m / distance_m;
            let off_distance = DVec3::from_slice(off).length() / distance_m;
            let off_px = lambda * off_m / distance_m + rho_px * (8.0 * EPSILON + off_distance);
            let error = if rho_px < self.threshold_px { 0.0 } else { 1.0 - self.threshold_px / rho_px };
            let off_error = off_px / rho_px.max(self.threshold_px) + 4.0 * EPSILON;
            errors.set(at, error, off_error);
            moved.set(4 * at + 3, error, off_error);
            if (rho_px - self.threshold_px).abs() <= off_px {
                moved.set(4 * at + 2, point.z, f64::INFINITY);
            } else if rho_px > self.threshold_px {
                moved.set(4 * at + 2, high, off_m);
            }
        }
        buffers.put("vertex", moved);
        buffers.put("grid_error", errors);
    }
}

/// Bilinear sampling of the minimum and maximum pyramids.
struct Ranges<'a> {
    buffers: &'a Buffers,
    size: UVec2,
}

impl Ranges<'_> {
    fn node(&self, level: u32, x: f64, y: f64) -> (f64, f64) {
        let layout = bounds_layout(self.size);
        let last = if level == 0 { self.size - 1 } else { layout.size(level) - 1 };
        let (x, y) = (x.clamp(0.0, last.x.into()) as u32, y.clamp(0.0, last.y.into()) as u32);
        if level == 0 {
            let height = self.buffers.get("height").value[(y * self.size.x + x) as usize];
            return (height, height);
        }
        let index = layout.index(level, x, y);
        (self.buffers.get("height_min").value[index], self.buffers.get("height_max").value[index])
    }

    /// Minimum, maximum, and the bound of both for a place that is known to `off` cells.
    fn at(&self, level: u32, place: DVec2, off: f64) -> (f64, f64, f64) {
        let side = f64::from(1u32 << level);
        // a node over cells has its middle half a side from its corner
        let place = if level == 0 { place } else { place / side - 0.5 };
        let (low, w) = (place.floor(), place - place.floor());
        let node = |dx: f64, dy: f64| self.node(level, low.x + dx, low.y + dy);
        let mix = |pick: fn((f64, f64)) -> f64| {
            let north = pick(node(0.0, 0.0)) * (1.0 - w.x) + pick(node(1.0, 0.0)) * w.x;
            let south = pick(node(0.0, 1.0)) * (1.0 - w.x) + pick(node(1.0, 1.0)) * w.x;
            north * (1.0 - w.y) + south * w.y
        };
        let around: Vec<(f64, f64)> = (-1..=2)
            .flat_map(|dy| (-1..=2).map(move |dx| (f64::from(dx), f64::from(dy))))
            .map(|(x, y)| node(x, y))
            .collect();
        let spread = |pick: fn(&(f64, f64)) -> f64| {
            let (low, high) = around.iter().map(pick).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
            high - low
        };
        let largest = around.iter().fold(0.0, |most: f64, (low, high)| most.max(low.abs()).max(high.abs()));
        let steepest = spread(|range| range.0).max(spread(|range| range.1));
        (mix(|range| range.0), mix(|range| range.1), 2.0 * steepest * (off / side).min(1.0) + 12.0 * EPSILON * largest)
    }
}

/// What a bound over cells has to be: no less than the error at any place that is looked at here, and no more than the highest
/// and lowest heights anywhere near allow.
fn proven(frame: &Frame, buffers: &mut Buffers) {
    let vertices = buffers.get("vertex");
    let (rows, columns) = (vertices.dims[0], vertices.dims[1]);
    let mut bounds = Values::missing(&[rows - 1, columns - 1], 4);
    let mut raises = Values::missing(&[rows - 1, columns - 1], 1);
    let set = |values: &mut Values, at: usize, low: f64, high: f64| {
        values.set(at, 0.5 * (low + high), 0.5 * (high - low) * (1.0 + 1e-9));
    };
    let mut ranges: Vec<(f64, f64)> = Vec::new();
    for at in (0..rows - 1).flat_map(|y| (0..columns - 1).map(move |x| UVec2::new(x, y))) {
        let cell = Cell::new(frame, &vertices, at);
        let index = (at.y * (columns - 1) + at.x) as usize;
        for (triangle, [a, b, c]) in cell.triangles().into_iter().enumerate() {
            let (seen, limit) = (cell.seen(frame, [a, b, c]), cell.limit([a, b, c]));
            set(&mut bounds, 4 * index + 2 * triangle, limit.0, seen.0.min(limit.1));
            set(&mut bounds, 4 * index + 2 * triangle + 1, seen.1.max(limit.0), limit.1);
        }
        let needed = cell.triangles().map(|corners| cell.seen(frame, corners).1).into_iter().fold(0.0, f64::max);
        let (low, high) = (needed.max(0.0) - cell.off_m, cell.most_raise());
        set(&mut raises, index, low, high);
        ranges.push((low, high));
    }
    let mut moved = (*vertices).clone();
    for at in (0..rows).flat_map(|y| (0..columns).map(move |x| UVec2::new(x, y))) {
        let (a, b) = (at.max(UVec2::ONE) - 1, at.min(UVec2::new(columns, rows) - 2));
        let around = [a, b, UVec2::new(a.x, b.y), UVec2::new(b.x, a.y)]
            .map(|cell| ranges[(cell.y * (columns - 1) + cell.x) as usize]);
        let (low, high) =
            around.into_iter().fold((0.0, 0.0), |(l, h): (f64, f64), (low, high)| (l.max(low), h.max(high)));
        let index = 4 * (at.y * columns + at.x) as usize;
        let (z, off) = (vertices.value[index + 2], vertices.bound[index + 2]);
        let rounding = 2.0 * EPSILON * (z.abs() + high);
        set(&mut moved, index + 2, z + low - off - rounding, z + high + off + rounding);
        set(&mut moved, index + 3, low, high);
    }
    buffers.put("vertex", moved);
    buffers.put("cell_bound", bounds);
    buffers.put("cell_raise", raises);
}

/// One cell of the grid in sample coordinates and metres above the eye.
struct Cell {
    /// nw, ne, sw, se.
    corners: [DVec3; 4],
    /// Bound of what the corners are known to, as a height.
    off_m: f64,
    /// Lowest and highest surface of everything that the kernel may have looked at.
    surface: Option<(f64, f64)>,
    snap_m: f64,
    rounding_m: f64,
}

impl Cell {
    fn new(frame: &Frame, vertices: &Values, at: UVec2) -> Self {
        let terrain = &frame.data.terrain;
        let eye_m = frame.camera.eye_m;
        let columns = vertices.dims[1];
        let index = |x: u32, y: u32| 4 * ((at.y + y) * columns + at.x + x) as usize;
        let places = [index(0, 0), index(1, 0), index(0, 1), index(1, 1)];
        let corner = |index: usize| {
            let point = DVec3::from_slice(&vertices.value[index..]);
            terrain.sample_from_world(point.truncate() + eye_m.truncate()).extend(point.z)
        };
        let corners = places.map(corner);
        let off_m = places.iter().flat_map(|&index| &vertices.bound[index..index + 3]).copied().fold(0.0, f64::max);
        let low = corners.into_iter().fold(DVec3::MAX, DVec3::min);
        let high = corners.into_iter().fold(DVec3::MIN, DVec3::max);
        let eye = terrain.sample_from_world(eye_m.truncate());
        let reach = ((low - eye.extend(0.0)).abs().max((high - eye.extend(0.0)).abs())) * terrain.cell_m.extend(1.0);
        let snap_m = f64::from(SNAP_PX) / frame.camera.focal_px() * reach.length();
        let extent = (high - low).truncate();
        // nodes of the level that is looked at are up to as large as the cell, and stick out by their size
        let around = DVec2::splat(2.0 * extent.max_element() + 2.0) + snap_m / terrain.cell_m;
        let surface = surface_range(frame, low.truncate() - around, high.truncate() + around);
        let steep = (high.z - low.z) / extent.min_element().max(1e-9);
        let rounding_m = 1e-5
            * (reach.z + steep * reach.truncate().length() + frame.data.range_m.1.abs() + frame.data.range_m.0.abs());
        Self { corners, off_m, surface, snap_m, rounding_m }
    }

    fn triangles(&self) -> [[DVec3; 3]; 2] {
        let [nw, ne, sw, se] = self.corners;
        [[nw, sw, ne], [se, sw, ne]]
    }

    /// Lowest and highest of surface minus plane at places inside a triangle.
    fn seen(&self, frame: &Frame, [a, b, c]: [DVec3; 3]) -> (f64, f64) {
        const STEPS: u32 = 6;
        let terrain = &frame.data.terrain;
        let last = (terrain.size - 1).as_dvec2();
        let shares = (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| (f64::from(i), f64::from(j))));
        let error = |(i, j): (f64, f64)| {
            let place = a + (b - a) * (i / f64::from(STEPS)) + (c - a) * (j / f64::from(STEPS));
            let inside = place.truncate().cmpge(DVec2::ZERO).all() && place.truncate().cmple(last).all();
            let world = DVec2::new(place.x, last.y - place.y) * terrain.cell_m;
            inside.then(|| terrain.surface_m(world, frame.data.scene.surface) - frame.camera.eye_m.z - place.z)
        };
        let errors = shares.filter_map(error);
        errors.fold((f64::MAX, f64::MIN), |(low, high), error| (low.min(error), high.max(error)))
    }

    /// What surface minus plane can be at most, on the ground that the kernel may have looked at.
    fn limit(&self, corners: [DVec3; 3]) -> (f64, f64) {
        let Some((lowest, highest)) = self.surface else { return (-self.rounding_m, self.rounding_m) };
        let [a, b, c] = corners;
        let (u, v) = (b - a, c - a);
        let area = u.truncate().perp_dot(v.truncate());
        let slope = DVec2::new(u.z * v.y - u.y * v.z, u.x * v.z - u.z * v.x) / area;
        if area.abs() < 1e-6 * u.truncate().length() * v.truncate().length() || !slope.is_finite() {
            // all but a line: its plane is anything
            return (f64::NEG_INFINITY, f64::INFINITY);
        }
        let low = self.corners.into_iter().fold(DVec3::MAX, DVec3::min).truncate();
        let high = self.corners.into_iter().fold(DVec3::MIN, DVec3::max).truncate();
        let around = 0.25 * (high - low).max_element() + 0.1;
        let places = [(low.x, low.y), (high.x, low.y), (low.x, high.y), (high.x, high.y)].map(DVec2::from);
        let planes = places.map(|place| a.z + slope.dot(place - a.truncate()));
        let beyond = slope.abs().element_sum() * around + self.rounding_m + slope.length() * self.off_m;
        let (flat_low, flat_high) = planes.into_iter().fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(z), h.max(z)));
        // a node's plane is off by up to the range of its heights, and its slope can double that
        let range = highest - lowest;
        (lowest - 3.0 * range - flat_high - beyond - self.off_m, highest + 3.0 * range - flat_low + beyond + self.off_m)
    }

    fn most_raise(&self) -> f64 {
        let Some((lowest, highest)) = self.surface else { return self.off_m };
        let heights = self.corners.map(|corner| corner.z);
        let (low, high) = heights.into_iter().fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(z), h.max(z)));
        (highest + 3.0 * (highest - lowest) - low).max(0.0) + high - low + self.snap_m + self.rounding_m + self.off_m
    }
}

/// Lowest and highest surface above the eye over a rectangle of samples; `None` if none of it is on the terrain.
fn surface_range(frame: &Frame, low: DVec2, high: DVec2) -> Option<(f64, f64)> {
    let terrain = &frame.data.terrain;
    let last = (terrain.size - 1).as_dvec2();
    if low.cmpgt(last).any() || high.cmplt(DVec2::ZERO).any() {
        return None;
    }
    let (from, to) = (low.floor().clamp(DVec2::ZERO, last).as_uvec2(), high.ceil().clamp(DVec2::ZERO, last).as_uvec2());
    let heights = (from.y..=to.y).flat_map(|y| {
        let row = (y * terrain.size.x) as usize;
        &terrain.heights_m[row + from.x as usize..=row + to.x as usize]
    });
    let (low, high) = heights.fold((f32::MAX, f32::MIN), |(low, high), &height| (low.min(height), high.max(height)));
    Some((f64::from(low) - frame.camera.eye_m.z, f64::from(high) - frame.camera.eye_m.z))
}
