mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::{Grid, Mesh, what};
use crate::plan::{Chain, Spread};
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

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Project {
    /// how heights are taken from the mean pyramid
    filter: Filter,
    /// coarsest level sampled; None is up to a single node
    max_level: Option<u32>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
enum Filter {
    /// blends two levels
    #[default]
    Trilinear,
    /// takes the finer of two levels
    Bilinear,
    /// takes the surface itself, and no pyramid
    Finest,
}

impl Project {
    /// On a flat terrain every level holds the same height.
    fn finest(&self, frame_is_flat: bool) -> bool {
        self.filter == Filter::Finest || frame_is_flat
    }

    /// The coarsest level that is sampled, of those that were `made`.
    fn top(&self, made: u32) -> u32 {
        self.max_level.unwrap_or(made).min(made)
    }
}

impl Stage for Project {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let points = chain.read("grid_point")?;
        let size = chain.grid_size(points, Elem::Vec2F32)?;
        let (columns, rows) = (size.x, size.y);
        let layout = chain.lattice().means();
        let finest = self.finest(chain.is_flat());
        let mean = match finest {
            true => None,
            false => Some(chain.read_of_ground("height_mean", Elem::F32, &layout.dims())?),
        };
        if chain.is_flat() && self.filter != Filter::Finest {
            chain.leave_out("the mean pyramid", "the terrain is flat, every level is the same", 0, 0);
        }
        let vertices = chain.make(
            "vertex",
            Elem::Vec4F32,
            &[rows, columns],
            "m",
            "x east, y north, z up from the eye; w: pyramid level",
        );
        chain.set_spread(vertices, Spread::GridPoints);
        let made = mean.and_then(|mean| chain.buffer(mean).top_level).unwrap_or(layout.top);
        let kernel = chain.kernel("grids/project.wgsl")?;
        chain
            .step("project", &kernel, "main")
            .bind("grid_point", points)
            .bind_or_leave("height_mean", mean)
            .bind("vertex", vertices)
            .constant("FINEST", f64::from(finest))
            .constant("BLEND", f64::from(self.filter == Filter::Trilinear))
            .set("grid", [columns, rows])
            .set("max_level", self.top(made))
            .over(UVec2::new(columns, rows))?;
        chain.offer(Mesh::Grid(Grid { vertex: vertices, cell_bound: None, promise: None }));
        Ok(())
    }
}
