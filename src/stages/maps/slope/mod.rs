mod reference;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::{Chain, Spread};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "Slope",
    summary: "how steep the ground is at each height sample, and which way it falls",
    formula: "slope = atan |g|; aspect = atan2(-g_east, -g_north); g by differences over a 3 x 3 window",
    source: "Horn 1981, Hill shading and the reflectance map, Eq. for p and q",
    writes: &["slope", "aspect"],
    parameters: schema::<Slope>,
    read: read_as::<Slope>,
    examples: &[Example::new("[Slope]"), Example::new("[Slope(differences: Central)]")],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Slope {
    /// which differences the gradient is taken from
    differences: Differences,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
enum Differences {
    /// through the sample, and through its neighbours with half the weight
    #[default]
    Horn,
    /// through the sample alone
    Central,
}

impl Stage for Slope {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let size = chain.lattice().size;
        let slope =
            chain.make_over("slope", Elem::F32, Spread::Samples, "degrees", "angle of the ground with a level plane");
        let aspect = chain.make_over(
            "aspect",
            Elem::F32,
            Spread::Samples,
            "degrees",
            "the way the ground falls, clockwise from north",
        );
        chain.set_missing_below_zero(aspect);
        let kernel = chain.kernel("maps/slope.wgsl")?;
        chain
            .step("slope", &kernel, "main")
            .bind_if_wanted("slope", slope, "WRITE_SLOPE")
            .bind_if_wanted("aspect", aspect, "WRITE_ASPECT")
            .constant("HORN", f64::from(self.differences == Differences::Horn))
            .over(size)
    }
}
