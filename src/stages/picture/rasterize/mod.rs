mod grid;
mod list;
mod reference;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::experiment::scene::Surface;
use crate::plan::Chain;
use crate::plan::product::{Drawn, Mesh, what};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "Rasterize",
    summary: "a mesh to the distance of the nearest triangle at every pixel",
    formula: "t = (n . a) / (n . d) for the nearest triangle that covers the pixel's centre",
    source: "visibility buffer after Burns, Hunt 2013; a grid is cut at the terrain's border",
    reads: &["clear_until"],
    writes: &["drawn", "distance", "error", "mesh_level"],
    needs: &[what::<Mesh<()>>()],
    offers: &[what::<Drawn<()>>()],
    unchecked: &[("drawn", "a render target; `distance` and `error` are all that is in it")],
    parameters: schema::<Rasterize>,
    read: read_as::<Rasterize>,
    examples: &[
        Example::new("[HeightPyramid, ViewGrid(size: (23, 17)), Project, Rasterize]")
            .in_benches(&[("ViewGrid.size", "(512, 384)")]),
        Example::new("[HeightPyramid(max_level: 2), ViewGrid(size: (2, 5)), Project(filter: Bilinear), Rasterize]")
            .in_benches(&[("ViewGrid.size", "(512, 384)")]),
        Example::new("[HeightPyramid, Roughness, VertexSplitting(threshold_px: 5), TriangleSplitting, Rasterize]")
            .in_benches(&[("VertexSplitting.threshold_px", "2")]),
        Example::new(
            "[HeightPyramid, Roughness(error: Proven), VertexSplitting(threshold_px: 8, carry_flag: false, carry_size: false), \
             TriangleSplitting, Rasterize]",
        )
        .only_on(Surface::Triangles)
        .in_benches(&[("VertexSplitting.threshold_px", "2")]),
    ],
};

/// Draws the latest mesh: a grid or a list, each in a file of its own.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Rasterize {}

impl Stage for Rasterize {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let drawn = match chain.latest()? {
            Mesh::Grid(grid) => grid::plan(chain, grid)?,
            Mesh::List(list) => list::plan(chain, list)?,
        };
        chain.offer(drawn);
        Ok(())
    }
}
