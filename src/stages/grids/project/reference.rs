use glam::{DVec2, UVec2};

use super::{Filter, Project};
use crate::experiment::scene::Surface;
use crate::frame::projector::Projector;
use crate::ground::cell::Cell;
use crate::ground::pyramid::Layout;
use crate::plan::product::{Grid, Mesh};
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::projected::ground_off_m;
use crate::stages::shared::rounding::EPSILON;

impl Reference for Project {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let points = buffers.get("grid_point")?;
        let height = buffers.get("height")?;
        let means = if self.finest(frame.is_flat()) { height.clone() } else { buffers.get("height_mean")? };
        let heights = Heights { height: &height, means: &means };
        let (rows, columns) = (points.dims[0], points.dims[1]);
        let projector = Projector::new(frame.data, frame.camera);
        let ground = |column: u32, row: u32| {
            let at = 2 * (row * columns + column) as usize;
            let uv = DVec2::new(points.value[at], points.value[at + 1]);
            ground_off_m(&projector, uv, points.bound[at] + points.bound[at + 1])
        };
        let mut vertices = Values::missing(&[rows, columns], 4);
        for row in 0..rows {
            for column in 0..columns {
                let (here, off_m) = ground(column, row);
                let neighbours = [
                    ground(column.saturating_sub(1), row),
                    ground((column + 1).min(columns - 1), row),
                    ground(column, row.saturating_sub(1)),
                    ground(column, (row + 1).min(rows - 1)),
                ];
                let vertex = self.vertex(frame, heights, here, off_m, &neighbours);
                let at = 4 * (row * columns + column) as usize;
                for (component, (value, bound)) in vertex.into_iter().enumerate() {
                    vertices.set(at + component, value, bound);
                }
            }
        }
        let vertex = buffers.put("vertex", vertices);
        buffers.offer(Mesh::Grid(Grid { vertex, cell_bound: None, promise: None }));
        Ok(())
    }
}

impl Project {
    /// Value and bound of x, y, z and level.
    fn vertex(
        &self,
        frame: &Frame,
        heights: Heights,
        here: DVec2,
        off_m: f64,
        neighbours: &[(DVec2, f64)],
    ) -> [(f64, f64); 4] {
        let terrain = frame.lattice();
        let eye_m = frame.camera.eye_m;
        let last = (terrain.size - UVec2::ONE).as_dvec2();
        let sample = terrain.sample_from_world(here + eye_m.truncate()).clamp(DVec2::ZERO, last);
        let off_cells = off_m / terrain.cell_m.min_element() + 8.0 * EPSILON * last.max_element();
        let layout = Layout::new(terrain.size);
        let is_made =
            |level: &u32| heights.means.value.get(layout.index(*level, 0, 0)).is_some_and(|mean| !mean.is_nan());
        let made = (1..=layout.top).take_while(is_made).last().unwrap_or(0);
        let field = Pyramid {
            heights,
            size: terrain.size,
            layout,
            range_m: frame.ground.range_m(),
            surface: frame.data.scene.surface,
        };
        if self.finest(frame.is_flat()) {
            let (height_m, bound) = field.height(0, sample, off_cells);
            return [(here.x, off_m), (here.y, off_m), (height_m - eye_m.z, bound), (0.0, 0.0)];
        }
        let distance = |(other, _): &(DVec2, f64)| ((*other - here) / terrain.cell_m).length();
        let extent = neighbours.iter().map(distance).fold(0.0, f64::max);
        let off_extent =
            (off_m + neighbours.iter().map(|(_, off)| *off).fold(0.0, f64::max)) / terrain.cell_m.min_element();
        let level = extent.max(1.0).log2().clamp(0.0, f64::from(self.top(made)));
        // d log2(e) = de / (e ln 2); Vulkan allows log2 an absolute error of 2^-21 near 1 and 3 ulp elsewhere
        let off_level = off_extent / (extent.max(1.0) * std::f64::consts::LN_2) + 5e-7 + 8.0 * EPSILON * level;
        let finer = level.floor();
        let (fine_m, fine_off) = field.height(finer as u32, sample, off_cells);
        let (coarse_m, coarse_off) = field.height((finer as u32 + 1).min(self.top(made)), sample, off_cells);
        let (height_m, bound) = match self.filter {
            Filter::Trilinear => {
                // across a whole level the blend goes on where the one before ended: the difference to the next is enough
                let slope = field.step_m(finer as u32, self.top(made), sample, off_cells);
                (fine_m + (coarse_m - fine_m) * (level - finer), fine_off.max(coarse_off) + off_level * slope)
            }
            // the level jumps at whole numbers
            _ if (level - level.round()).abs() <= off_level && extent > 1.0 - off_extent => (fine_m, f64::INFINITY),
            _ => (fine_m, fine_off),
        };
        [(here.x, off_m), (here.y, off_m), (height_m - eye_m.z, bound), (level, off_level)]
    }
}

/// What heights are taken from.
#[derive(Clone, Copy)]
struct Heights<'a> {
    height: &'a Values,
    means: &'a Values,
}

/// The surface and, above it, bilinear sampling of the mean pyramid, in f64.
struct Pyramid<'a> {
    heights: Heights<'a>,
    size: UVec2,
    layout: Layout,
    range_m: (f64, f64),
    surface: Surface,
}

impl Pyramid<'_> {
    fn node(&self, level: u32, x: f64, y: f64) -> f64 {
        let last = if level == 0 { self.size - 1 } else { self.layout.size(level) - 1 };
        let x = x.clamp(0.0, f64::from(last.x)) as u32;
        let y = y.clamp(0.0, f64::from(last.y)) as u32;
        match level {
            0 => self.heights.height.value[(y * self.size.x + x) as usize],
            _ => self.heights.means.value[self.layout.index(level, x, y)],
        }
    }

    /// Height and its bound for a sample position that is known to `off` cells.
    fn height(&self, level: u32, sample: DVec2, off: f64) -> (f64, f64) {
        let side = f64::from(1u32 << level);
        let place = (sample - (side - 1.0) / 2.0) / side;
        let low = place.floor();
        let w = place - low;
        let node = |dx: f64, dy: f64| self.node(level, low.x + dx, low.y + dy);
        let (nw, ne, sw, se) = (node(0.0, 0.0), node(1.0, 0.0), node(0.0, 1.0), node(1.0, 1.0));
        let surface = if level == 0 { self.surface } else { Surface::Bilinear };
        let height = Cell { nw, ne, sw, se }.surface_m(w, surface);
        // a place that is off by `off` meets the steepest slope around, neighbours of the cell included
        let around = (-1..=2).flat_map(|dy| (-1..=2).map(move |dx| (f64::from(dx), f64::from(dy))));
        let heights = around.map(|(dx, dy)| node(dx, dy));
        let (lowest, highest) = heights.fold((f64::MAX, f64::MIN), |(low, high), h| (low.min(h), high.max(h)));
        let largest = self.range_m.0.abs().max(self.range_m.1.abs());
        // means are themselves rounded: six operations a level
        let rounding = (12.0 + 6.0 * f64::from(level)) * EPSILON * largest;
        (height, 2.0 * (highest - lowest) * (off / side).min(1.0) + rounding)
    }

    /// Largest height difference between neighbouring levels around `level`.
    fn step_m(&self, level: u32, top: u32, sample: DVec2, off: f64) -> f64 {
        let at = |level: u32| self.height(level.min(top), sample, off).0;
        let middle = at(level);
        let next = at(level + 1);
        (middle - next).abs().max((at(level.saturating_sub(1)) - middle).abs()).max((at(level + 2) - next).abs())
    }
}
