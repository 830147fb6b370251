mod reference;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::{Chain, Spread};
use crate::scene::SURFACE_TYPE;
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "SurfaceType",
    summary: "what lies on the ground at each height sample, from slope and altitude: water 0, rock 1, snow 2, meadow 3",
    formula: "water if height <= water_m, else rock if |g| > tan(rock_deg), else snow if height > snow_m, else meadow; g by differences of neighbours",
    source: "Dachsbacher, Stamminger 2004, sections 3.1 and 4.2 (which leave the rule open)",
    writes: &["surface_type"],
    parameters: schema::<SurfaceType>,
    read: read_as::<SurfaceType>,
    examples: &[Example::new("[SurfaceType]"), Example::new("[SurfaceType(rock_deg: 20, snow_m: 500, water_m: 100)]")],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceType {
    /// steeper ground is rock
    #[schemars(range(min = 0, max = 90))]
    rock_deg: f64,
    /// higher ground is under snow, in metres; None is four fifths of the way from the lowest to the highest ground of the scene, octaves included
    snow_m: Option<f64>,
    /// ground that is not higher is under water, in metres; None is none
    water_m: Option<f64>,
}

impl Default for SurfaceType {
    fn default() -> Self {
        Self { rock_deg: 35.0, snow_m: None, water_m: None }
    }
}

/// Below every height.
const NO_WATER_M: f64 = -3e38;

impl SurfaceType {
    /// The height that snow begins over, of a ground that is as low and as high.
    fn snow_m(&self, (low_m, high_m): (f64, f64)) -> f64 {
        self.snow_m.unwrap_or(low_m + 0.8 * (high_m - low_m))
    }
}

impl Stage for SurfaceType {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let size = chain.lattice().size;
        let meaning = "what lies on the ground: water 0, rock 1, snow 2, meadow 3";
        let types = chain.make_over(SURFACE_TYPE, Elem::U32, Spread::Samples, "", meaning);
        if chain.input(SURFACE_TYPE).is_some() {
            chain.leave_out("the scene's map of surface types", "this stage makes another one", 0, 0);
        }
        let snow_m = self.snow_m(chain.data.ground.range_m());
        let kernel = chain.kernel("maps/surface_type.wgsl")?;
        chain
            .step("classify", &kernel, "main")
            .bind("surface_type", types)
            .set("rock_slope", self.rock_deg.to_radians().tan() as f32)
            .set("snow_m", snow_m as f32)
            .set("water_m", self.water_m.unwrap_or(NO_WATER_M) as f32)
            .over(size)
    }
}
