mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::{Listing, what};
use crate::plan::{BufferId, Chain, StepBuilder};
use crate::stages::shared::prefix_sums::{RUN, elements, over_runs, scan};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "Compact",
    summary: "stream compaction: the numbers of the elements above a value, in order, and the workgroups to visit them",
    formula: "list = (i : of(i) > above); count = (workgroups along x, y, z; length of the list)",
    source: "reduce-then-scan; the pixels over the threshold of Loeffler et al. 2009, section 4",
    writes: &["pixels", "pixels_count"],
    offers: &[what::<Listing<()>>()],
    parameters: schema::<Compact>,
    read: read_as::<Compact>,
    examples: &[Example::new("[HeightPyramid, RayCast, Compact(of: \"distance\", above: 900, rows: 3, to: \"far\")]")],
    ..Info::EMPTY
};

#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Compact {
    /// a buffer of f32 or u32
    of: String,
    /// elements above this are listed; NaN is not
    above: f64,
    /// so many rows of a buffer with two dimensions make one element: it is above if any is, its number is the first's; where
    /// `GridError` has proven a bound, RayFill can give such a block one ray
    #[schemars(range(min = 1, max = 16))]
    rows: u32,
    /// the list to make; its count is called the same with `_count`
    to: String,
}

impl Default for Compact {
    fn default() -> Self {
        Self { of: "error".into(), above: 0.0, rows: 1, to: "pixels".into() }
    }
}

/// Elements a workgroup takes that visits the list: threads of a workgroup of `ray_fill.wgsl`.
const VISITORS: u32 = 64;

/// The most rows of a buffer that `place_of` of `kernels/lib/place.wgsl` finds again.
const MOST_ROWS: u32 = 1 << 23;

/// The most workgroups a side of a dispatch may have on any adapter.
const MOST_GROUPS: u32 = 65535;

impl Compact {
    /// The largest u32 that is not listed; u32 are compared as such.
    fn above_number(&self) -> u32 {
        self.above.clamp(0.0, f64::from(u32::MAX)) as u32
    }

    /// A negative value below which no u32 is.
    fn lists_all_numbers(&self) -> bool {
        self.above < 0.0
    }
}

/// What is compacted.
struct Source {
    numbers: bool,
    /// Elements, of which some may be several rows.
    length: u32,
    /// Columns and rows of the buffer; one row if it is not looked at as rows.
    size: UVec2,
}

impl Compact {
    fn source(&self, chain: &Chain, source: BufferId) -> Result<Source, Diagnostic> {
        let buffer = chain.buffer(source);
        let elem = buffer.elem;
        let numbers = elem == Elem::U32;
        if !(numbers || elem == Elem::F32) || numbers && self.lists_all_numbers() {
            let message = match numbers {
                true => format!("every u32 is above {}", self.above),
                false => format!("`Compact` lists elements of f32 or u32, and `{}` holds {elem:?}", self.of),
            };
            return Err(Diagnostic::input(message).at(chain.origin(), "this stage"));
        }
        let length = elements(chain, source)?;
        if self.rows == 1 {
            return Ok(Source { numbers, length, size: UVec2::new(length, 1) });
        }
        let &[rows, columns] = buffer.dims.as_slice() else {
            let message = format!(
                "`{}` has no rows: it has {} dimension(s), and rows are the first of two",
                self.of,
                buffer.dims.len()
            );
            return Err(Diagnostic::input(message).at(chain.origin(), "this stage looks at several rows at once"));
        };
        if rows > MOST_ROWS {
            let message = format!("`{}` has {rows} rows, and blocks can be listed of {MOST_ROWS}", self.of);
            return Err(Diagnostic::input(message).at(chain.origin(), "this stage looks at several rows at once"));
        }
        Ok(Source { numbers, length: rows.div_ceil(self.rows) * columns, size: UVec2::new(columns, rows) })
    }

    fn step<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        entry: &str,
        source: &Source,
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        let kernel = chain.kernel("lists/compact.wgsl")?;
        Ok(chain
            .step(entry, &kernel, entry)
            .constant("NUMBERS", f64::from(source.numbers))
            .constant("HAS_TAIL", f64::from(!source.length.is_multiple_of(RUN)))
            .constant("ROWS", self.rows.into())
            .constant("IS_ALIGNED", f64::from(source.size.x.is_multiple_of(4)))
            .set("length", source.length)
            .set("size", source.size.to_array())
            .set("above", self.above as f32)
            .set("above_number", self.above_number())
            .set("visitors", VISITORS)
            .set("most_groups", MOST_GROUPS))
    }
}

impl Stage for Compact {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let values = chain.read(&self.of)?;
        let source = self.source(chain, values)?;
        let words = source.length.div_ceil(RUN);
        let meaning = "numbers of the elements listed, in order";
        let list = chain.make(&self.to, Elem::U32, &[source.length], "", meaning);
        let count_name = format!("{}_count", self.to);
        let count = chain.make(&count_name, Elem::U32, &[4], "", "workgroups along x, y, z; length of the list");
        let mut make = |what: &str, length: u32, meaning: &str| {
            chain.make(&format!("{}_{what}", self.to), Elem::U32, &[length], "", meaning)
        };
        let masks = make("masks", words, "a bit for each element: is it listed");
        let counts = make("counts", words, "bits set in each mask");
        let starts = make("before", words, "bits set in all masks before");
        let total = make("total", 1, "bits set");
        let step = self.step(chain, "look", &source)?;
        let step = step.bind_either("values", "numbers", values, source.numbers);
        over_runs(step.bind("masks_out", masks).bind("counts", counts), words)?;
        scan(chain, &self.to, counts, starts, total)?;
        let step = self.step(chain, "plan_visit", &source)?;
        step.bind("total", total).bind("count", count).over(UVec2::ONE)?;
        let step = self.step(chain, "scatter", &source)?;
        over_runs(step.bind("masks", masks).bind("starts", starts).bind("list", list), words)?;
        chain.offer(Listing { numbers: list, count, of: values, above: self.above, rows: self.rows });
        Ok(())
    }

    fn makes(&self) -> Option<Vec<String>> {
        Some(vec![self.to.clone(), format!("{}_count", self.to)])
    }
}
