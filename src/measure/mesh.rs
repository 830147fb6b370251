//! What can be said of the mesh that was drawn: triangles, cracks, folds, the largest cell, pinholes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::triangles::{Listed, Triangles, cracks, folds, grid_triangles, largest_px};
use super::{Column, Figures, Info, Kind, Known, Measure, Measured, Seen, Show, Sums, Tally, pinholes, read_as};
use crate::camera::Camera;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::ground::Ground;
use crate::kernel::Elem;
use crate::plan::product::{self, Drawn, Products};
use crate::plan::{BufferId, Chain};

pub const INFO: Info = Info {
    name: "Mesh",
    summary: "triangles, cracks, folded triangles and the largest cell of the mesh that was drawn; of a list also its pinholes, the pixels through which one sees",
    version: 3,
    parameters: schema::<Mesh>,
    read: read_as::<Mesh>,
    figures: &[
        Known::new("triangles", "", Kind::Cost, "triangles that were drawn, of the frame with the most of them"),
        Known::new("cracks", "edges", Kind::Other, "edges along which triangles do not meet, all frames together"),
        Known::new("folded", "triangles", Kind::Other, "triangles that are turned over, all frames together"),
        Known::new("largest_cell", "px", Kind::Other, "the largest side of a triangle in the picture"),
        Known::new(
            "pinholes",
            "pixels",
            Kind::Fault("has holes"),
            "pixels through which one sees, all frames together",
        ),
    ],
    columns: &[
        Column { heading: "triangles", figure: "triangles", show: Show::Count },
        Column { heading: "cracks", figure: "cracks", show: Show::Count },
        Column { heading: "pinholes", figure: "pinholes", show: Show::Count },
    ],
};

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Mesh {}

/// What there is to measure: the mesh that was drawn, or one that nobody drew.
pub struct Subject {
    pub mesh: Option<product::Mesh<BufferId>>,
    pub drawn: Option<Drawn<BufferId>>,
}

impl Subject {
    pub fn of(products: &Products<BufferId>) -> Self {
        let drawn: Option<Drawn<BufferId>> = products.latest();
        let mesh = match drawn {
            Some(drawn) => drawn.mesh,
            None => products.latest(),
        };
        Self { mesh, drawn }
    }

    /// The buffers of the mesh; rays have none, which is no triangles.
    pub fn buffers(&self, chain: &Chain) -> Result<Vec<BufferId>, Diagnostic> {
        match self.mesh {
            None if self.drawn.is_some() => Ok(Vec::new()),
            None => Err(chain.missing::<product::Mesh<BufferId>>()),
            Some(product::Mesh::Grid(grid)) => {
                chain.grid_size(grid.vertex, Elem::Vec4F32)?;
                Ok(vec![grid.vertex])
            }
            Some(product::Mesh::List(list)) => {
                chain.check_own(list.triangle)?;
                chain.check_own(list.count)?;
                Ok(vec![list.count, list.triangle])
            }
        }
    }
}

impl Measure for Mesh {
    fn needs(&self, chain: &Chain) -> Result<Vec<BufferId>, Diagnostic> {
        let subject = Subject::of(chain.products());
        // the pinholes of a list are seen in what was drawn of it
        let is_list = matches!(subject.mesh, Some(product::Mesh::List(_)));
        let distance = subject.drawn.filter(|_| is_list).map(|drawn| drawn.distance);
        Ok(distance.into_iter().chain(subject.buffers(chain)?).collect())
    }

    fn wants_truth(&self) -> bool {
        true
    }

    fn begin(&self) -> Box<dyn Tally> {
        Box::new(Summary::default())
    }
}

impl Sums for Summary {
    fn of_frame(&self, seen: &Seen) -> Self {
        let subject = Subject::of(&seen.plan.products);
        let mut own = Self { is_drawn: subject.drawn.is_some(), ..Self::default() };
        let ground = seen.data.ground.as_ref();
        match subject.mesh {
            None => {}
            Some(product::Mesh::Grid(grid)) => {
                let columns = seen.plan.buffer(grid.vertex).dims[1] as usize;
                own.add_grid(&grid_triangles(&seen.read(grid.vertex), columns), ground, seen.camera());
            }
            Some(product::Mesh::List(list)) => {
                let drawn_vertices = seen.read::<u32>(list.count).first().copied().unwrap_or(0);
                let triangles = Listed::new(&seen.read(list.triangle), drawn_vertices);
                let drawn_m: Option<Vec<f32>> = subject.drawn.map(|drawn| seen.read(drawn.distance));
                let both_m = drawn_m.as_deref().zip(seen.truth.map(|truth| &truth.distance_m[..]));
                own.add_list(&triangles, ground, seen.camera(), both_m);
            }
        }
        own
    }

    fn add(&mut self, frame: Self) {
        self.is_drawn = frame.is_drawn;
        self.triangles = self.triangles.max(frame.triangles);
        self.cracks += frame.cracks;
        self.folds += frame.folds;
        self.pinholes = self.pinholes.into_iter().chain(frame.pinholes).reduce(|a, b| a + b);
        self.largest_px = self.largest_px.into_iter().chain(frame.largest_px).reduce(f64::max);
    }

    fn measured(&self) -> Vec<Measured> {
        let mut measures = vec![
            Measured::new("triangles", self.triangles as f64, ""),
            Measured::new("cracks", self.cracks as f64, "edges"),
            Measured::new("folded", self.folds as f64, "triangles"),
            Measured::new("largest_cell", self.largest_px, "px"),
        ];
        if let Some(pinholes) = self.pinholes {
            measures.push(Measured::new("pinholes", pinholes as f64, "pixels"));
        }
        measures
    }

    fn figures(self) -> Figures {
        let unseen = "`Mesh` measures a mesh that no stage draws".to_string();
        let warnings = if self.is_drawn { Vec::new() } else { vec![unseen] };
        Figures { measured: self.measured(), pictures: Vec::new(), warnings }
    }
}

/// Over the frames: the most triangles, the sum of cracks and folds, the largest cell.
#[derive(Clone, Copy, Debug, Default)]
struct Summary {
    is_drawn: bool,
    triangles: usize,
    cracks: usize,
    pinholes: Option<usize>,
    folds: usize,
    largest_px: Option<f64>,
}

impl Summary {
    fn add_grid(&mut self, mesh: &Triangles, ground: &dyn Ground, camera: &Camera) {
        self.cracks += cracks(mesh);
        self.add_uncracked(mesh, ground, camera);
    }

    /// A list of triangles, and what was drawn of it and should have been: distances along the pixels' rays, if they are known.
    fn add_list(
        &mut self,
        list: &Listed,
        ground: &dyn Ground,
        camera: &Camera,
        drawn_and_true_m: Option<(&[f32], &[f64])>,
    ) {
        let mesh = list.placed(ground, camera);
        self.cracks += list.cracks();
        if let Some((drawn_m, true_m)) = drawn_and_true_m {
            *self.pinholes.get_or_insert_default() +=
                pinholes::count(&mesh, &list.gaps(ground, camera), camera, drawn_m, true_m);
        }
        self.add_uncracked(&mesh, ground, camera);
    }

    fn add_uncracked(&mut self, mesh: &Triangles, ground: &dyn Ground, camera: &Camera) {
        self.triangles = self.triangles.max(mesh.corners.len());
        self.folds += folds(mesh, ground, camera.eye_m);
        self.largest_px = match (self.largest_px, largest_px(mesh, camera)) {
            (Some(a), Some(b)) => Some(a.max(b)),
            (a, b) => a.or(b),
        };
    }
}
