use glam::UVec2;
use serde::Deserialize;

use super::scan::{RUN, over_runs, scan};
use super::{Info, Stage};
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Kernel};
use crate::plan::{BufferId, Chain, Listing, StepBuilder};
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "Compact",
    summary: "stream compaction: the numbers of the elements above a value, in order, and the workgroups to visit them",
    formula: "list = (i : of(i) > above); count = (workgroups along x, y, z; length of the list)",
    source: "reduce-then-scan; the pixels over the threshold of Loeffler et al. 2009, section 4",
    reads: &[],
    writes: &["pixels", "pixels_count"],
    kernels: &["compact.wgsl"],
    params: &[
        ("of", "\"error\"", "a buffer of f32 or u32"),
        ("above", "0", "elements above this are listed; NaN is not"),
        (
            "rows",
            "1",
            "so many rows of a buffer with two dimensions make one element: it is above if any is, its number is the first's; where `GridError` has proven a bound, RayFill can give such a block one ray",
        ),
        ("to", "\"pixels\"", "the list to make; its count is called the same with `_count`"),
    ],
    read: |node, _| {
        let stage: Compact = node.parse_fields()?;
        if stage.above.is_nan() {
            let above = node.field("above").unwrap_or(node);
            return Err(Diagnostic::input("nothing is above NaN").at(&above.origin, "expected a number"));
        }
        if !(1..=MOST_ROWS).contains(&stage.rows) {
            let rows = node.field("rows").unwrap_or(node);
            let expected = format!("expected 1 to {MOST_ROWS}");
            return Err(
                Diagnostic::input(format!("{} rows cannot make one element", stage.rows)).at(&rows.origin, expected)
            );
        }
        Ok(Box::new(stage))
    },
};

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Compact {
    of: String,
    above: f64,
    rows: u32,
    to: String,
}

impl Default for Compact {
    fn default() -> Self {
        Self { of: "error".into(), above: 0.0, rows: 1, to: "pixels".into() }
    }
}

/// Elements a workgroup takes that visits the list: threads of a workgroup of `ray_fill.wgsl`.
const VISITORS: u32 = 64;
/// The most rows that make one element: a kernel that visits the list looks at all of them.
const MOST_ROWS: u32 = 16;
/// The most rows of a buffer that `place_of` of `kernels/lib/place.wgsl` finds again.
const MOST_TALL: u32 = 1 << 23;
/// The most workgroups a side of a dispatch may have on any adapter.
const MOST_GROUPS: u32 = 65535;

/// Under this name the reference tells the stages after it how many rows an element of a list stands for.
pub(super) fn rows_of(list: &str) -> String {
    format!("{list}_rows")
}

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
        let length = super::elements(chain, source)?;
        if self.rows == 1 {
            return Ok(Source { numbers, length, size: UVec2::new(length, 1) });
        }
        let &[tall, width] = buffer.dims.as_slice() else {
            let message = format!(
                "`{}` has no rows: it has {} dimension(s), and rows are the first of two",
                self.of,
                buffer.dims.len()
            );
            return Err(Diagnostic::input(message).at(chain.origin(), "this stage looks at several rows at once"));
        };
        if tall > MOST_TALL {
            let message = format!("`{}` has {tall} rows, and blocks can be listed of {MOST_TALL}", self.of);
            return Err(Diagnostic::input(message).at(chain.origin(), "this stage looks at several rows at once"));
        }
        Ok(Source { numbers, length: tall.div_ceil(self.rows) * width, size: UVec2::new(width, tall) })
    }

    fn step<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        entry: &str,
        source: &Source,
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        let kernel = Kernel::built_in("compact.wgsl")?;
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
        chain.list(list, Listing { of: values, above: self.above, rows: self.rows });
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
        over_runs(step.bind("masks", masks).bind("starts", starts).bind("list", list), words)
    }

    fn makes(&self) -> Vec<String> {
        vec![self.to.clone(), format!("{}_count", self.to)]
    }

    fn reference(&self, _frame: &Frame, buffers: &mut Buffers) {
        let source = buffers.get(&self.of);
        let above = f64::from(self.above as f32);
        let width = if self.rows == 1 { source.value.len() } else { source.dims[1] as usize };
        // numbers of the values that make an element
        let values_of = |element: usize| {
            let first = element / width * width * self.rows as usize + element % width;
            (first..source.value.len()).step_by(width).take(self.rows as usize)
        };
        let length = if self.rows == 1 { width } else { width * source.dims[0].div_ceil(self.rows) as usize };
        let is_above = |&element: &usize| values_of(element).any(|at| source.value[at] > above);
        let listed: Vec<f64> =
            (0..length).filter(is_above).filter_map(|at| values_of(at).next()).map(|at| at as f64).collect();
        // an element whose bound reaches across the value may be listed or not, and moves all after it
        let reaches = |at: usize| {
            let (value, bound) = (source.value[at], source.bound[at]);
            bound > 0.0 && (value.is_nan() || (value - above).abs() <= bound)
        };
        let open = (0..source.value.len()).any(reaches);
        let bound = if open { f64::INFINITY } else { 0.0 };
        let mut list = Values::missing(&[length as u32], 1);
        listed.iter().enumerate().for_each(|(at, &number)| list.set(at, number, bound));
        let groups = (listed.len() as u32).div_ceil(VISITORS);
        let wide = groups.min(MOST_GROUPS);
        let counts = [wide, groups.div_ceil(wide.max(1)), groups.min(1), listed.len() as u32];
        let mut count = Values::missing(&[4], 1);
        counts.iter().enumerate().for_each(|(at, &value)| count.set(at, value.into(), bound));
        buffers.put(&self.to, list);
        buffers.put(&format!("{}_count", self.to), count);
        buffers.put(&rows_of(&self.to), Values::exact(&[1], 1, vec![self.rows.into()]));
    }
}
