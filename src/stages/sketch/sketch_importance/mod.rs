mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::{Wanted, what};
use crate::plan::{BufferId, Chain, Spread, StepBuilder};
use crate::scene::SURFACE_TYPE;
use crate::stages::shared::sketch::texels_of;
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "SketchImportance",
    summary: "importance of the texels of a sketch map: how many grid points a metre are wanted there",
    formula: "I = max(min(Iv^(1 - error_share) Ie^error_share Sf Sb, Is), floor max I); Iv = focal_px / (quad_px d), Ie what `ErrorDemand` left, Sf, Sb (and So) = 1 - smoothstep beside the picture, where ground faces away (and where it is hidden)",
    source: "Dachsbacher, Stamminger 2004, section 3.1 (which writes Iv = C / d: there a larger C makes smaller quads)",
    reads: &["sketch_square", "sketch_height", "surface_type", "error_demand"],
    writes: &["importance", "importance_factors"],
    offers: &[what::<Wanted<()>>()],
    parameters: schema::<SketchImportance>,
    read: read_as::<SketchImportance>,
    examples: &[
        Example::new("[HeightPyramid, SketchMap(texels: 9), SketchImportance]").in_benches(&[("SketchMap.texels", "128")]),
        Example::new(
            "[HeightPyramid, SketchMap(texels: 7), SketchImportance(distance: false, facing: false, safety_deg: 20, floor: 0)]",
        )
        .in_benches(&[("SketchMap.texels", "128")]),
        Example::new(
            "[HeightPyramid, SketchMap(texels: 10), SketchImportance(facing: false, occlusion: true, clear_deg: 2, hidden_deg: 10)]",
        )
        .in_benches(&[("SketchMap.texels", "128")]),
        Example::new("[HeightPyramid, SketchMap(texels: 9, blend: 1), SketchImportance(occlusion: true)]")
            .in_benches(&[("SketchMap.texels", "128")]),
        Example::new("[HeightPyramid, SketchMap(texels: 8), SketchImportance(frustum: false, densest_per_m: 0.002)]")
            .in_benches(&[("SketchMap.texels", "128")]),
        Example::new(
            "[HeightPyramid, SketchMap(texels: 7, blend: 1), SurfaceType, SketchImportance(densest_of_types: (1e-4, 0.002, 1, 0.01))]",
        )
        .in_benches(&[("SketchMap.texels", "128")]),
    ],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SketchImportance {
    /// largest side of a quad in pixels, seen head-on
    #[schemars(range(min = 1e-3, max = 1e6))]
    quad_px: f64,
    /// importance falls with the distance from the eye; otherwise there is one point for each texel
    distance: bool,
    /// ground outside the picture is of no importance
    frustum: bool,
    /// angle beside the picture over which importance fades to nothing
    #[schemars(range(min = 0, max = 90))]
    safety_deg: f64,
    /// ground that faces away is of no importance
    facing: bool,
    /// angle by which ground may face away and still counts in full, since it is a silhouette
    #[schemars(range(min = 0, max = 45))]
    silhouette_deg: f64,
    /// angle beyond that over which importance fades to nothing
    #[schemars(range(min = 0, max = 45))]
    fade_deg: f64,
    /// ground that other ground hides is of no importance, as far as the sketch map knows (beyond the paper)
    occlusion: bool,
    /// angle by which other ground may stand over a texel and still not hide it
    #[schemars(range(min = 0, max = 45))]
    clear_deg: f64,
    /// angle beyond that over which importance fades to nothing
    #[schemars(range(min = 0, max = 45))]
    hidden_deg: f64,
    /// the most grid points a metre, whatever the view; None is any number
    #[schemars(range(min = 1e-12, max = 1e12))]
    densest_per_m: Option<f64>,
    /// the same for ground of the surface types 0, 1, 2 and 3: of `SurfaceType` water, rock, snow and meadow; other types have `densest_per_m`
    #[schemars(extend("minimum" = 1e-12, "maximum" = 1e12))]
    densest_of_types: Option<(f64, f64, f64, f64)>,
    /// how far importance follows what the errors of the frame before ask for (`ErrorDemand`), instead of distance: 0 is not at all, as in the
    /// paper, 1 is wholly; a first frame has none to follow, and a path of one frame measures nothing of it
    #[schemars(range(min = 0, max = 1))]
    error_share: f64,
    /// least importance, as a share of the largest, beyond the terrain's border as well; with 0, as in the paper, what is out of the picture
    /// keeps no points
    #[schemars(range(min = 0, max = 1))]
    floor: f64,
}

impl Default for SketchImportance {
    fn default() -> Self {
        Self {
            quad_px: 4.0,
            distance: true,
            frustum: true,
            safety_deg: 5.0,
            facing: true,
            silhouette_deg: 10.0,
            fade_deg: 20.0,
            occlusion: false,
            clear_deg: 0.5,
            hidden_deg: 1.0,
            densest_per_m: None,
            densest_of_types: None,
            error_share: 0.0,
            floor: 0.02,
        }
    }
}

impl SketchImportance {
    /// The most grid points a metre, as f32 has them.
    fn densest(&self) -> f64 {
        self.densest_per_m.unwrap_or(3e38)
    }

    /// The same of the first four surface types.
    fn densest_of(&self) -> [f64; 4] {
        self.densest_of_types.map_or([self.densest(); 4], <[f64; 4]>::from)
    }
}

/// The sine over which something fades: never nothing, so that nobody divides by it.
fn width(degrees: f64) -> f64 {
    degrees.to_radians().sin().max(1e-6)
}

/// The slope over which something fades, likewise.
fn slope(degrees: f64) -> f64 {
    degrees.to_radians().tan().max(1e-6)
}

/// The map of surface types: the scene's, or what a stage has made of the ground that there is.
fn types_of(chain: &Chain, dims: &[u32]) -> Result<BufferId, Diagnostic> {
    let found = chain.read(SURFACE_TYPE)?;
    match chain.input(SURFACE_TYPE) == Some(found) {
        true => chain.read_as(SURFACE_TYPE, Elem::U32, dims),
        false => chain.read_of_ground(SURFACE_TYPE, Elem::U32, dims),
    }
}

impl Stage for SketchImportance {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let (square, heights) = (chain.read("sketch_square")?, chain.read("sketch_height")?);
        let texels = texels_of(chain, heights, square)?;
        let samples = chain.lattice().size;
        let types = match self.densest_of_types {
            Some(_) => Some(types_of(chain, &[samples.y, samples.x])?),
            None => None,
        };
        let mut make = |name, elem, unit, meaning| {
            let id = chain.make(name, elem, &[texels; 2], unit, meaning);
            chain.set_spread(id, Spread::UnitSquare);
            id
        };
        let importance = make("importance", Elem::F32, "1/m", "grid points a metre that are wanted");
        let meaning = "what importance is made of: Iv by distance (or errors), Sf in the picture, Sb So facing the eye and not hidden, Is the most";
        let factors = make("importance_factors", Elem::Vec4F32, "", meaning);
        chain.offer(Wanted { importance, square });
        let has_floor = self.floor > 0.0;
        let meaning = "the largest importance, as the bits of an f32";
        let largest = has_floor.then(|| chain.make("largest_importance", Elem::U32, &[1], "", meaning));
        if let Some(largest) = largest {
            self.step(chain, texels, "begin")?.bind("largest", largest).over(UVec2::ONE)?;
        }
        let ground = Ground { square, heights, types };
        let asked = self.compare(chain, texels, &ground)?;
        ground
            .bind(self.step(chain, texels, "weigh")?)
            .bind_or_leave("largest", largest)
            .bind_or_leave("asked", asked.as_ref().map(|asked| asked.demand))
            .bind_or_leave("asked_frame", asked.as_ref().map(|asked| asked.over))
            .bind("importance", importance)
            .bind_if_wanted("factors", factors, "WRITE_FACTORS")
            .over(UVec2::splat(texels))?;
        let Some(largest) = largest else { return Ok(()) };
        let raise = self.step(chain, texels, "raise")?.bind("importance", importance).bind("largest", largest);
        raise.over(UVec2::splat(texels))
    }
}

/// What factors are made from.
struct Ground {
    square: BufferId,
    heights: BufferId,
    types: Option<BufferId>,
}

impl Ground {
    fn bind<'c, 'a>(&self, step: StepBuilder<'c, 'a>) -> StepBuilder<'c, 'a> {
        step.bind("sketch_square", self.square)
            .bind("sketch_height", self.heights)
            .bind_or_leave("surface_type", self.types)
    }
}

/// What the errors of the frame before ask for, and the square that it had, with how many times as much distance wants.
struct Asked {
    demand: BufferId,
    over: BufferId,
}

impl SketchImportance {
    /// Compares what errors want with what distance wants, so that one can stand for the other.
    fn compare(&self, chain: &mut Chain, texels: u32, ground: &Ground) -> Result<Option<Asked>, Diagnostic> {
        if self.error_share == 0.0 {
            return Ok(None);
        }
        let demand = chain.last_frame_of_own("error_demand", Elem::F32);
        let square = chain.last_frame_of_own("error_square", Elem::I32);
        let meaning = "of each texel: importance by distance, and by errors";
        let each = chain.make("error_sums", Elem::Vec2F32, &[texels; 2], "", meaning);
        let sums = chain.make("error_row_sums", Elem::Vec2F32, &[texels], "", "sums of them by rows of texels");
        let meaning =
            "the square before: column and row, side, and importance by distance over importance by errors, as bits";
        let over = chain.make("asked_frame", Elem::I32, &[4], "", meaning);
        let survey = ground.bind(self.step(chain, texels, "survey")?).bind("asked", demand);
        survey.bind("asked_square", square).bind("texel_sums", each).over(UVec2::splat(texels))?;
        let rows = self.step(chain, texels, "sum_rows")?.bind("texel_sums", each).bind("row_sums", sums);
        rows.over(UVec2::new(texels, 1))?;
        let compare = self.step(chain, texels, "compare")?.bind("row_sums", sums).bind("asked_square", square);
        compare.bind("asked_frame_out", over).over(UVec2::ONE)?;
        Ok(Some(Asked { demand, over }))
    }

    fn step<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        texels: u32,
        entry: &str,
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        let kernel = chain.kernel("sketch/sketch_importance.wgsl")?;
        Ok(chain
            .step(entry, &kernel, entry)
            .constant("DISTANCE", f64::from(self.distance))
            .constant("FRUSTUM", f64::from(self.frustum))
            .constant("FACING", f64::from(self.facing))
            .constant("OCCLUSION", f64::from(self.occlusion))
            .constant("BY_TYPE", f64::from(self.densest_of_types.is_some()))
            .constant("BY_ERROR", f64::from(self.error_share > 0.0))
            .constant("HAS_FLOOR", f64::from(self.floor > 0.0))
            .set("texels", texels)
            .set("quad_px", self.quad_px as f32)
            .set("safety", width(self.safety_deg) as f32)
            .set("silhouette", self.silhouette_deg.to_radians().sin() as f32)
            .set("fade", width(self.fade_deg) as f32)
            .set("clear", self.clear_deg.to_radians().tan() as f32)
            .set("hidden", slope(self.hidden_deg) as f32)
            .set("densest", self.densest() as f32)
            .set("densest_of", self.densest_of().map(|densest| densest as f32))
            .set("floor", self.floor as f32)
            .set("error_share", self.error_share as f32))
    }
}
