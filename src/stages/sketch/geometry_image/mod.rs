mod reference;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::{Demand, Grid, Mesh, Wanted, what};
use crate::plan::{Chain, Spread};
use crate::stages::shared::heights::{Filter, Means};
use crate::stages::shared::octaves;
use crate::stages::shared::sketch::texels_of;
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "GeometryImage",
    summary: "grid points in the square of a sketch map to terrain vertices",
    formula: "(x, y) = Phi(s, t); z from the atlas at level = max(0, log2(distance to the farthest neighbour, in cells)), or from the sketch map",
    source: "Dachsbacher, Stamminger 2004, sections 3.2 and 3.4; section 5 (heights from the atlas)",
    reads: &["grid_point", "sketch_square", "sketch_height", "height_mean"],
    writes: &["vertex"],
    offers: &[what::<Mesh<()>>(), what::<Demand<()>>()],
    parameters: schema::<GeometryImage>,
    read: read_as::<GeometryImage>,
    examples: &[
        Example::new(
            "[HeightPyramid, SketchMap(texels: 8), SketchImportance, ViewGrid(size: (23, 17)), Warp, GeometryImage]",
        )
        .in_benches(&[("SketchMap.texels", "128"), ("ViewGrid.size", "(512, 512)")]),
        Example::new(
            "[HeightPyramid, SketchMap(texels: 7, blend: 1), ViewGrid(size: (7, 7)), GeometryImage(heights: SketchMap)]",
        )
        .in_benches(&[("SketchMap.texels", "128"), ("ViewGrid.size", "(512, 512)")]),
    ],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GeometryImage {
    /// where heights are from
    heights: Source,
    /// how heights are taken from the atlas
    filter: Filter,
    /// coarsest level of the atlas that is sampled; None is up to a single node
    max_level: Option<u32>,
    /// octaves of the scene's detail that the mesh has less than the distance of its vertices allows, against swimming
    #[schemars(range(min = 0, max = 64))]
    bias: f64,
}

impl Default for GeometryImage {
    fn default() -> Self {
        Self { heights: Source::default(), filter: Filter::default(), max_level: None, bias: 1.0 }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
enum Source {
    /// the terrain and its mean pyramid
    #[default]
    Atlas,
    /// the sketch map, which the warp resamples
    SketchMap,
}

impl Stage for GeometryImage {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let points = chain.read("grid_point")?;
        let size = chain.grid_size(points, Elem::Vec2F32)?;
        let (square, heights) = (chain.read("sketch_square")?, chain.read("sketch_height")?);
        let texels = texels_of(chain, heights, square)?;
        let means = match self.heights {
            Source::Atlas => Some(Means::find(chain, self.filter, self.max_level)?),
            Source::SketchMap if self.filter != Filter::default() || self.max_level.is_some() => {
                return Err(Diagnostic::input("`filter` and `max_level` are of heights from the atlas")
                    .at(chain.origin(), "this stage takes its heights from the sketch map")
                    .help("leave them out, or take heights from the `Atlas`"));
            }
            Source::SketchMap => None,
        };
        octaves::note(chain);
        let meaning = "x east, y north, z up from the eye; w: pyramid level, or minus the split octave";
        let vertices = chain.make("vertex", Elem::Vec4F32, &[size.y, size.x], "m", meaning);
        chain.set_spread(vertices, Spread::GridPoints);
        let kernel = chain.kernel("sketch/geometry_image.wgsl")?;
        let step = chain.step("image", &kernel, "main").bind("grid_point", points).bind("vertex", vertices);
        let step = step.bind("sketch_square", square).set("grid", size.to_array()).set("texels", texels);
        let step = step.set("bias", self.bias as f32);
        let step = match means {
            Some(means) => means.bind(step).leave_unbound("sketch_height"),
            None => step
                .bind("sketch_height", heights)
                .leave_unbound("height_mean")
                .constant("SKETCH_HEIGHTS", 1.0)
                .set("max_level", 0u32),
        };
        step.over(size)?;
        chain.offer(Mesh::Grid(Grid { vertex: vertices, cell_bound: None, promise: None }));
        // an importance of another square, or of something else, asked for nothing here
        if let Some(Wanted { importance, .. }) = chain.products().find(|wanted: &Wanted<_>| wanted.square == square) {
            chain.offer(Demand { importance, places: points, vertex: vertices, square });
        }
        Ok(())
    }
}
