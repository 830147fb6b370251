mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::{Grid, Mesh, what};
use crate::plan::{Chain, Spread};
use crate::stages::shared::heights::{Filter, Means};
use crate::stages::shared::octaves;
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "Project",
    summary: "grid points to terrain vertices: ray to the base plane, height from the mean pyramid",
    formula: "P = V + v_z / (v_z - g_z) (G - V); level = max(0, log2(distance to the farthest neighbour, in cells))",
    source: "Livny et al. 2008, Eq. 1, 2, 6; Loeffler et al. 2009, Eq. 1; projector after Johanson 2004",
    reads: &["grid_point", "height_mean"],
    writes: &["vertex"],
    offers: &[what::<Mesh<()>>()],
    parameters: schema::<Project>,
    read: read_as::<Project>,
    examples: &[
        Example::new("[HeightPyramid, ViewGrid(size: (23, 17)), Project]")
            .in_benches(&[("ViewGrid.size", "(512, 384)")]),
        Example::new("[HeightPyramid(max_level: 2), ViewGrid(size: (2, 5)), Project(filter: Bilinear)]")
            .in_benches(&[("ViewGrid.size", "(512, 384)")]),
    ],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Project {
    /// how heights are taken from the mean pyramid
    filter: Filter,
    /// coarsest level sampled; None is up to a single node
    max_level: Option<u32>,
    /// octaves of the scene's detail that the mesh has less than the distance of its vertices allows, against swimming
    #[schemars(range(min = 0, max = 64))]
    bias: f64,
}

impl Default for Project {
    fn default() -> Self {
        Self { filter: Filter::default(), max_level: None, bias: 1.0 }
    }
}

impl Stage for Project {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let points = chain.read("grid_point")?;
        let size = chain.grid_size(points, Elem::Vec2F32)?;
        let (columns, rows) = (size.x, size.y);
        let means = Means::find(chain, self.filter, self.max_level)?;
        octaves::note(chain);
        let vertices = chain.make(
            "vertex",
            Elem::Vec4F32,
            &[rows, columns],
            "m",
            "x east, y north, z up from the eye; w: pyramid level, or minus the split octave",
        );
        chain.set_spread(vertices, Spread::GridPoints);
        let kernel = chain.kernel("grids/project.wgsl")?;
        let step = chain.step("project", &kernel, "main").bind("grid_point", points).bind("vertex", vertices);
        means.bind(step).set("grid", [columns, rows]).set("bias", self.bias as f32).over(UVec2::new(columns, rows))?;
        chain.offer(Mesh::Grid(Grid { vertex: vertices, cell_bound: None, promise: None }));
        Ok(())
    }
}
