mod paper;
mod proven;
mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::{Mesh, NodeRanges, PointErrors, what};
use crate::plan::{BufferId, Chain, StepBuilder};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "GridError",
    summary: "the error of a projected grid or a geometry image: estimated at its points (Paper, Estimate), or bounded with the grid raised above the surface (Proven)",
    formula: "delta = max(h_max - h_avg, h_avg - h_min); rho = lambda delta / |p - e|; error = 0 if rho < gamma, else 1 - gamma / rho",
    source: "Loeffler et al. 2009, Eq. 2, 3, 4 and the displacement by the maximum; Proven is ours: docs/proven_bound.md",
    reads: &["height_plane", "plane_slope"],
    writes: &["vertex", "grid_error", "cell_bound", "cell_raise"],
    needs: &[what::<Mesh<()>>(), what::<NodeRanges<()>>()],
    offers: &[what::<Mesh<()>>(), what::<PointErrors<()>>()],
    parameters: schema::<GridError>,
    read: read_as::<GridError>,
    examples: &[
        Example::new("[HeightPyramid, ViewGrid(size: (23, 17)), Project, GridError(threshold_px: 0.5)]")
            .in_benches(&[("ViewGrid.size", "(512, 384)")]),
        Example::new("[HeightPyramid, ViewGrid(size: (12, 11)), Project, GridError(rule: Estimate, threshold_px: 0.1)]")
            .in_benches(&[("ViewGrid.size", "(512, 384)")]),
        Example::new(
            "[HeightPyramid, PlanePyramid, ViewGrid(size: (17, 23)), Project(filter: Finest), GridError(rule: Proven, threshold_px: 2)]",
        )
        .in_benches(&[("ViewGrid.size", "(96, 72)")]),
    ],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GridError {
    /// what is known of the error
    rule: Rule,
    /// the error that the mesh is allowed, gamma
    #[schemars(extend("exclusiveMinimum" = 0))]
    threshold_px: f64,
}

impl Default for GridError {
    fn default() -> Self {
        Self { rule: Rule::Paper, threshold_px: 1.0 }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
enum Rule {
    /// estimates at grid points from the minimum and maximum pyramids; what is over its threshold is raised to the maximum
    Paper,
    /// the same estimates; the mesh stays as it is, and promises nothing
    Estimate,
    /// bounds over whole cells
    Proven,
}

impl Stage for GridError {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        chain.check_no_octaves("compares a mesh with samples")?;
        let Mesh::Grid(grid) = chain.latest()? else {
            return Err(Diagnostic::input("`GridError` needs a grid, and the mesh here is a list of triangles")
                .at(chain.origin(), "this stage")
                .help("`Project` makes a grid"));
        };
        if grid.promise.is_some() {
            return Err(
                Diagnostic::input("these vertices have their error already").at(chain.origin(), "a second time")
            );
        }
        let size = chain.grid_size(grid.vertex, Elem::Vec4F32)?;
        let inputs = Inputs { vertices: grid.vertex, size };
        match self.rule {
            Rule::Paper => paper::plan(chain, inputs, self.threshold_px, true),
            Rule::Estimate => paper::plan(chain, inputs, self.threshold_px, false),
            Rule::Proven => proven::plan(chain, inputs, self.threshold_px),
        }
    }
}

/// What both rules look at.
#[derive(Clone, Copy)]
struct Inputs {
    vertices: BufferId,
    /// Columns and rows of vertices.
    size: UVec2,
}

impl Inputs {
    /// A step with what the kernels of both rules are told.
    fn step<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        file: &str,
        entry: &str,
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        let kernel = chain.kernel(file)?;
        Ok(chain.step(entry, &kernel, entry).bind("vertex", self.vertices).set("grid", self.size.to_array()))
    }
}
