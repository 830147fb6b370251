use glam::UVec2;
use serde::Deserialize;

use super::scan::{RUN, over_runs, scan};
use super::{Info, Stage};
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Kernel};
use crate::plan::Chain;
use crate::plan::chain::StepBuilder;
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
        ("to", "\"pixels\"", "the list to make; its count is called the same with `_count`"),
    ],
    read: |node, _| {
        let stage: Compact = node.parse_fields()?;
        if stage.above.is_nan() {
            let above = node.field("above").unwrap_or(node);
            return Err(Diagnostic::input("nothing is above NaN").at(&above.origin, "expected a number"));
        }
        Ok(Box::new(stage))
    },
};

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Compact {
    of: String,
    above: f64,
    to: String,
}

impl Default for Compact {
    fn default() -> Self {
        Self { of: "error".into(), above: 0.0, to: "pixels".into() }
    }
}

/// Elements a workgroup takes that visits the list: threads of a workgroup of `ray_fill.wgsl`.
const VISITORS: u32 = 64;
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

impl Compact {
    fn step<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        entry: &str,
        numbers: bool,
        length: u32,
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        let kernel = Kernel::built_in("compact.wgsl")?;
        Ok(chain
            .step(entry, &kernel, entry)
            .constant("NUMBERS", f64::from(numbers))
            .constant("HAS_TAIL", f64::from(!length.is_multiple_of(RUN)))
            .set("length", length)
            .set("above", self.above as f32)
            .set("above_number", self.above_number())
            .set("visitors", VISITORS)
            .set("most_groups", MOST_GROUPS))
    }
}

impl Stage for Compact {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let source = chain.read(&self.of)?;
        let elem = chain.buffer(source).elem;
        let numbers = elem == Elem::U32;
        if !(numbers || elem == Elem::F32) || numbers && self.lists_all_numbers() {
            let message = match numbers {
                true => format!("every u32 is above {}", self.above),
                false => format!("`Compact` lists elements of f32 or u32, and `{}` holds {elem:?}", self.of),
            };
            return Err(Diagnostic::input(message).at(chain.origin(), "this stage"));
        }
        let length = super::elements(chain, source)?;
        let words = length.div_ceil(RUN);
        let list = chain.make(&self.to, Elem::U32, &[length], "", "numbers of the elements listed, in order");
        let count_name = format!("{}_count", self.to);
        let count = chain.make(&count_name, Elem::U32, &[4], "", "workgroups along x, y, z; length of the list");
        let mut make = |what: &str, length: u32, meaning: &str| {
            chain.make(&format!("{}_{what}", self.to), Elem::U32, &[length], "", meaning)
        };
        let masks = make("masks", words, "a bit for each element: is it listed");
        let counts = make("counts", words, "bits set in each mask");
        let starts = make("before", words, "bits set in all masks before");
        let total = make("total", 1, "bits set");
        let step = self.step(chain, "look", numbers, length)?;
        let step = step.bind_either("values", "numbers", source, numbers);
        over_runs(step.bind("masks_out", masks).bind("counts", counts), words)?;
        scan(chain, &self.to, counts, starts, total)?;
        let step = self.step(chain, "plan_visit", numbers, length)?;
        step.bind("total", total).bind("count", count).over(UVec2::ONE)?;
        let step = self.step(chain, "scatter", numbers, length)?;
        over_runs(step.bind("masks", masks).bind("starts", starts).bind("list", list), words)
    }

    fn makes(&self) -> Vec<String> {
        vec![self.to.clone(), format!("{}_count", self.to)]
    }

    fn reference(&self, _frame: &Frame, buffers: &mut Buffers) {
        let source = buffers.get(&self.of);
        let above = f64::from(self.above as f32);
        let listed: Vec<f64> =
            (0..source.value.len()).filter(|&at| source.value[at] > above).map(|at| at as f64).collect();
        // an element whose bound reaches across the value may be listed or not, and moves all after it
        let reaches = |at: usize| {
            let (value, bound) = (source.value[at], source.bound[at]);
            bound > 0.0 && (value.is_nan() || (value - above).abs() <= bound)
        };
        let open = (0..source.value.len()).any(reaches);
        let bound = if open { f64::INFINITY } else { 0.0 };
        let mut list = Values::missing(&[source.value.len() as u32], 1);
        listed.iter().enumerate().for_each(|(at, &number)| list.set(at, number, bound));
        let groups = (listed.len() as u32).div_ceil(VISITORS);
        let wide = groups.min(MOST_GROUPS);
        let counts = [wide, groups.div_ceil(wide.max(1)), groups.min(1), listed.len() as u32];
        let mut count = Values::missing(&[4], 1);
        counts.iter().enumerate().for_each(|(at, &value)| count.set(at, value.into(), bound));
        buffers.put(&self.to, list);
        buffers.put(&format!("{}_count", self.to), count);
    }
}
