//! How far a mesh's vertices are from the surface, in pixels: the error of a method's heights alone, without what triangles do between
//! them (Livny et al. 2008, tables 5 and 6).

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mesh::Subject;
use super::triangles::Listed;
use super::{Info, Kind, Known, Measure, Measured, Seen, Sums, Tally, read_as};
use crate::camera::Camera;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::ground::Ground;
use crate::plan::product::Mesh;
use crate::plan::{BufferId, Chain};

pub const INFO: Info = Info {
    name: "VertexError",
    summary: "pixel distance between each vertex in the picture and the surface over or under it; share of vertices outside the picture",
    version: 1,
    parameters: schema::<VertexError>,
    read: read_as::<VertexError>,
    figures: &[
        Known::new(
            "vertex_error_max",
            "px",
            Kind::Error,
            "maximum of the error of vertices in the picture, all frames",
        ),
        Known::new("vertex_error_mean", "px", Kind::Error, "mean of the error of vertices in the picture, all frames"),
        Known::new(
            "vertex_error_rms",
            "px",
            Kind::Error,
            "root of the mean square of the error of vertices in the picture, all frames",
        ),
        Known::new("vertices_outside", "of vertices", Kind::Other, "share of vertices outside the picture"),
    ],
    columns: &[],
};

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct VertexError {}

impl Measure for VertexError {
    fn needs(&self, chain: &Chain) -> Result<Vec<BufferId>, Diagnostic> {
        Subject::of(chain.products()).buffers(chain)
    }

    fn begin(&self) -> Box<dyn Tally> {
        Box::new(VertexSums::default())
    }
}

/// Sums over the vertices of all frames.
#[derive(Clone, Copy, Debug, Default)]
struct VertexSums {
    vertices: usize,
    /// Vertices in the picture and over the terrain, which the errors are of.
    seen: usize,
    sum_px: f64,
    sum_of_squares: f64,
    largest_px: f64,
}

impl VertexSums {
    /// `vertex` is relative to the eye, in metres.
    fn place(&mut self, ground: &dyn Ground, camera: &Camera, vertex: DVec3) {
        self.vertices += 1;
        let point = vertex + camera.eye_m;
        let is_on_ground = ground.margin_m(point) >= 0.0;
        let size = DVec2::new(camera.viewport.0.into(), camera.viewport.1.into());
        let in_picture = |pixel: &DVec2| pixel.cmpge(DVec2::ZERO).all() && pixel.cmple(size).all();
        let Some(pixel) = camera.pixel(point).filter(in_picture).filter(|_| is_on_ground) else { return };
        let truth = ground.surface_at(point);
        // a surface behind the eye is as far off as anything in the picture can be
        let error_px = camera.pixel(truth).map_or(size.length(), |place| place.distance(pixel).min(size.length()));
        self.seen += 1;
        self.sum_px += error_px;
        self.sum_of_squares += error_px * error_px;
        self.largest_px = self.largest_px.max(error_px);
    }
}

impl Sums for VertexSums {
    fn of_frame(&self, seen: &Seen) -> Self {
        let mut own = Self::default();
        let (ground, camera) = (seen.data.ground.as_ref(), seen.camera());
        match Subject::of(&seen.plan.products).mesh {
            None => {}
            Some(Mesh::Grid(grid)) => {
                let vertices: Vec<[f32; 4]> = seen.read(grid.vertex);
                for [x, y, z, _] in vertices {
                    own.place(ground, camera, DVec3::new(x.into(), y.into(), z.into()));
                }
            }
            Some(Mesh::List(list)) => {
                // corners are samples; one that several triangles share counts for each of them
                let corners = seen.read::<u32>(list.count).first().copied().unwrap_or(0);
                let placed = Listed::new(&seen.read(list.triangle), corners).placed(ground, camera);
                for corner in placed.corners.iter().flatten() {
                    own.place(ground, camera, DVec3::from(corner.map(f64::from)));
                }
            }
        }
        own
    }

    fn add(&mut self, frame: Self) {
        self.vertices += frame.vertices;
        self.seen += frame.seen;
        self.sum_px += frame.sum_px;
        self.sum_of_squares += frame.sum_of_squares;
        self.largest_px = self.largest_px.max(frame.largest_px);
    }

    fn measured(&self) -> Vec<Measured> {
        let mean = |sum: f64| (self.seen > 0).then(|| sum / self.seen as f64);
        let outside = (self.vertices > 0).then(|| 1.0 - self.seen as f64 / self.vertices as f64);
        vec![
            Measured::new("vertex_error_max", (self.seen > 0).then_some(self.largest_px), "px"),
            Measured::new("vertex_error_mean", mean(self.sum_px), "px"),
            Measured::new("vertex_error_rms", mean(self.sum_of_squares).map(f64::sqrt), "px"),
            Measured::new("vertices_outside", outside, "of vertices"),
        ]
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::experiment::diagnostic::Source;
    use crate::experiment::scene::Scene;
    use crate::experiment::tree::Node;
    use crate::ground::Samples;
    use crate::terrain::HeightField;

    #[test]
    fn a_vertex_is_off_by_what_it_is_raised() {
        let scene = "(terrain: Shape(kind: Flat, size: (33, 33), cell_m: 10, height_m: (50, 50)), camera: Still(eye: (160, 0, 50)), \
                     viewport: (200, 100), fov_deg: 90)";
        let scene: Scene = Node::read(&Source::new("test", scene)).unwrap().parse().unwrap();
        let field = HeightField::load(&scene.terrain, "".as_ref()).unwrap();
        let ground = Samples::new(Arc::new(field), scene.surface);
        let camera = Camera::looking_at(DVec3::new(160.0, 0.0, 50.0), DVec3::new(160.0, 100.0, 50.0), &scene);
        let mut sums = VertexSums::default();
        // 100 m away, half of 100 rows are 100 m: half a pixel a metre
        sums.place(&ground, &camera, DVec3::new(0.0, 100.0, 0.0));
        assert!(sums.largest_px < 1e-9);
        sums.place(&ground, &camera, DVec3::new(0.0, 100.0, 6.0));
        assert!((sums.largest_px - 3.0).abs() < 1e-9, "{}", sums.largest_px);
        // behind the eye, beside the terrain
        sums.place(&ground, &camera, DVec3::new(0.0, -100.0, 0.0));
        sums.place(&ground, &camera, DVec3::new(500.0, 1000.0, 0.0));
        assert_eq!((sums.vertices, sums.seen), (4, 2));
    }
}
