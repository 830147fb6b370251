mod reference;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::Chain;
use crate::stages::shared::prefix_sums::scan;
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "Scan",
    summary: "prefix sums of a buffer of u32: each element's sum of all before it",
    formula: "sums(i) = sum over j < i of source(j), modulo 2^32",
    source: "reduce-then-scan; Merrill, Garland 2016 compare the family",
    writes: &["sums", "sums_total"],
    parameters: schema::<Scan>,
    read: read_as::<Scan>,
    examples: &[Example::new(
        "[HeightPyramid, Roughness, VertexSplitting(threshold_px: 5), Scan(of: \"split\", to: \"split_before\")]",
    )],
    ..Info::EMPTY
};

#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Scan {
    /// the buffer to sum
    of: String,
    /// the buffer to make
    to: String,
}

impl Default for Scan {
    fn default() -> Self {
        Self { of: "counts".into(), to: "sums".into() }
    }
}

impl Stage for Scan {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let source = chain.read(&self.of)?;
        let dims = chain.buffer(source).dims.clone();
        let source = chain.read_as(&self.of, Elem::U32, &dims)?;
        let sums = chain.make(&self.to, Elem::U32, &dims, "", "sum of all elements before");
        let total = chain.make(&format!("{}_total", self.to), Elem::U32, &[1], "", "sum of all elements");
        scan(chain, &self.to, source, sums, total)
    }

    fn makes(&self) -> Option<Vec<String>> {
        Some(vec![self.to.clone(), format!("{}_total", self.to)])
    }
}
