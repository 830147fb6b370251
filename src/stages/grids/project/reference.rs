use glam::DVec2;

use super::Project;
use crate::frame::projector::Projector;
use crate::plan::product::{Grid, Mesh};
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::heights::Heights;
use crate::stages::shared::octaves::{self, in_mesh};
use crate::stages::shared::projected::ground_off_m;

impl Reference for Project {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let points = buffers.get("grid_point")?;
        let heights = Heights::new(frame, buffers, self.filter, self.max_level)?;
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
                let vertex = self.vertex(frame, &heights, (here, off_m), &neighbours);
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
        heights: &Heights,
        (here, off_m): (DVec2, f64),
        neighbours: &[(DVec2, f64)],
    ) -> [(f64, f64); 4] {
        let lattice = frame.lattice();
        let eye_m = frame.camera.eye_m;
        let distance = |(other, _): &(DVec2, f64)| ((*other - here) / lattice.cell_m).length();
        let farthest = neighbours.iter().map(distance).fold(0.0, f64::max);
        let off_farthest =
            (off_m + neighbours.iter().map(|(_, off)| *off).fold(0.0, f64::max)) / lattice.cell_m.min_element();
        let extent = (farthest, off_farthest);
        let sample = lattice.sample_from_world(here + eye_m.truncate());
        let [(height_m, off_height), level] = heights.at(sample, off_m, extent);
        let off_cells = off_m / lattice.cell_m.min_element();
        let [added, split] = in_mesh(frame, self.bias, (sample, off_cells), extent);
        let height = (height_m + added.0 - eye_m.z, off_height + added.1);
        [(here.x, off_m), (here.y, off_m), height, octaves::level(level, split)]
    }
}
