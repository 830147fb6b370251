//! What a bound over cells has to be (docs/proven_bound.md).

use glam::{DVec2, DVec3, UVec2};

use crate::plan::product::{Grid, Mesh, Promise};
use crate::reference::{Buffers, Frame, Values, ValuesId};
use crate::stages::shared::rounding::{EPSILON, PROOF_SNAP_PX};

/// What a bound over cells has to be: no less than the error at any place that is looked at here, and no more than the highest
/// and lowest heights anywhere near allow.
pub fn reference(frame: &Frame, buffers: &mut Buffers, grid: Grid<ValuesId>, threshold_px: f64) {
    let vertices = buffers.values(grid.vertex);
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
            let off_m = cell.seen_off_m(frame, [a, b, c]);
            set(&mut bounds, 4 * index + 2 * triangle, limit.0, (seen.0 + off_m).min(limit.1));
            set(&mut bounds, 4 * index + 2 * triangle + 1, (seen.1 - off_m).max(limit.0), limit.1);
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
    let vertex = buffers.put("vertex", moved);
    let cell_bound = Some(buffers.put("cell_bound", bounds));
    let promise = Some(Promise { bound_px: threshold_px, proven: true });
    buffers.offer(Mesh::Grid(Grid { vertex, cell_bound, promise }));
    buffers.put("cell_raise", raises);
}

/// One cell of the grid in sample coordinates and metres above the eye.
struct Cell {
    /// nw, ne, sw, se.
    corners: [DVec3; 4],
    /// Bound of what the corners are known to, as a height.
    off_m: f64,
    /// The same as a place.
    off_cells: f64,
    /// Lowest and highest surface of everything that the kernel may have looked at.
    surface: Option<(f64, f64)>,
    snap_m: f64,
    rounding_m: f64,
}

impl Cell {
    fn new(frame: &Frame, vertices: &Values, at: UVec2) -> Self {
        let terrain = frame.lattice();
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
        let snap_m = f64::from(PROOF_SNAP_PX) / frame.camera.focal_px() * reach.length();
        let extent = (high - low).truncate();
        // nodes of the level that is looked at are up to as large as the cell, and stick out by their size
        let around = DVec2::splat(2.0 * extent.max_element() + 2.0) + snap_m / terrain.cell_m;
        let surface = surface_range(frame, low.truncate() - around, high.truncate() + around);
        let steep = (high.z - low.z) / extent.min_element().max(1e-9);
        let rounding_m = 1e-5
            * (reach.z
                + steep * reach.truncate().length()
                + frame.ground.range_m().1.abs()
                + frame.ground.range_m().0.abs());
        let off_cells = off_m / terrain.cell_m.min_element();
        Self { corners, off_m, off_cells, surface, snap_m, rounding_m }
    }

    fn triangles(&self) -> [[DVec3; 3]; 2] {
        let [nw, ne, sw, se] = self.corners;
        [[nw, sw, ne], [se, sw, ne]]
    }

    /// Lowest and highest of surface minus plane at places inside a triangle.
    fn seen(&self, frame: &Frame, [a, b, c]: [DVec3; 3]) -> (f64, f64) {
        const STEPS: u32 = 6;
        let terrain = frame.lattice();
        let last = (terrain.size - 1).as_dvec2();
        let shares = (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| (f64::from(i), f64::from(j))));
        let error = |(i, j): (f64, f64)| {
            let place = a + (b - a) * (i / f64::from(STEPS)) + (c - a) * (j / f64::from(STEPS));
            let inside = place.truncate().cmpge(DVec2::ZERO).all() && place.truncate().cmple(last).all();
            let world = terrain.world_from_sample(place.truncate()).extend(0.0);
            inside.then(|| frame.ground.surface_at(world).z - frame.camera.eye_m.z - place.z)
        };
        let errors = shares.filter_map(error);
        errors.fold((f64::MAX, f64::MIN), |(low, high), error| (low.min(error), high.max(error)))
    }

    /// By how much what is seen there is another if the corners are off: the surface and the plane are looked at beside the place.
    fn seen_off_m(&self, frame: &Frame, [a, b, c]: [DVec3; 3]) -> f64 {
        let (u, v) = (b - a, c - a);
        let steepest = frame.ground.steepest() * frame.lattice().cell_m.max_element();
        self.off_m + self.off_cells * (steepest + u.z.abs().max(v.z.abs()) / narrowest(u, v))
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
        // corners that are off tilt the plane, a narrow triangle's most
        let tilt = 2.0 * (slope.length() * self.off_cells + self.off_m) / narrowest(u, v);
        let beyond = slope.abs().element_sum() * around
            + self.rounding_m
            + slope.length() * self.off_cells
            + tilt * ((high - low).length() + around);
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

/// How wide a triangle is across the longer of two sides, in cells.
fn narrowest(u: DVec3, v: DVec3) -> f64 {
    let (u, v) = (u.truncate(), v.truncate());
    u.perp_dot(v).abs() / u.length().max(v.length())
}

/// Lowest and highest surface above the eye over a rectangle of samples; `None` if none of it is on the terrain.
fn surface_range(frame: &Frame, low: DVec2, high: DVec2) -> Option<(f64, f64)> {
    let (low, high) = frame.ground.range_over_m(low, high)?;
    Some((low - frame.camera.eye_m.z, high - frame.camera.eye_m.z))
}
