use glam::UVec2;
use serde::Deserialize;

use super::{Info, Stage};
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Kernel};
use crate::plan::StepBuilder;
use crate::plan::{BufferId, Chain};
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "Scan",
    summary: "prefix sums of a buffer of u32: each element's sum of all before it",
    formula: "sums(i) = sum over j < i of source(j), modulo 2^32",
    source: "reduce-then-scan; Merrill, Garland 2016 compare the family",
    reads: &[],
    writes: &["sums", "sums_total"],
    kernels: &["scan.wgsl"],
    params: &[("of", "\"counts\"", "the buffer to sum"), ("to", "\"sums\"", "the buffer to make")],
    read: |node, _| super::read_params::<Scan>(node),
};

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scan {
    of: String,
    to: String,
}

impl Default for Scan {
    fn default() -> Self {
        Self { of: "counts".into(), to: "sums".into() }
    }
}

/// Elements that a thread takes; `RUN` of the kernel, and the bits of a word of `compact.wgsl`.
pub(super) const RUN: u32 = 32;

/// Threads as workgroups of 64, in a rectangle that a dispatch can have: a row has as many workgroups as are allowed.
pub(super) fn over_runs(step: StepBuilder, runs: u32) -> Result<(), Diagnostic> {
    const MOST_WIDE: u32 = 64 * 32768;
    step.over(UVec2::new(runs.min(MOST_WIDE), runs.div_ceil(MOST_WIDE)))
}

/// The steps that put the prefix sums of `source` into `sums` and its sum into `total`.
pub(super) fn scan(
    chain: &mut Chain,
    name: &str,
    source: BufferId,
    sums: BufferId,
    total: BufferId,
) -> Result<(), Diagnostic> {
    let length = super::elements(chain, source)?;
    let runs = length.div_ceil(RUN);
    let kernel = Kernel::built_in("scan.wgsl")?;
    let has_tail = f64::from(!length.is_multiple_of(RUN));
    let is_top = runs == 1;
    let mut starts = None;
    if !is_top {
        let run_sums = chain.make(&format!("{name}_runs"), Elem::U32, &[runs], "", "sum of each run of elements");
        let run_starts = chain.make(&format!("{name}_starts"), Elem::U32, &[runs], "", "sum before each run");
        let step = chain.step(&format!("sum {length}"), &kernel, "sum_runs").constant("HAS_TAIL", has_tail);
        over_runs(step.bind("source", source).bind("run_sum", run_sums).set("length", length), runs)?;
        scan(chain, name, run_sums, run_starts, total)?;
        starts = Some(run_starts);
    }
    let step = chain
        .step(&format!("scan {length}"), &kernel, "scan_runs")
        .constant("HAS_TAIL", has_tail)
        .constant("IS_TOP", f64::from(is_top))
        .bind("source", source)
        .bind("sums", sums)
        .set("length", length);
    let step = match starts {
        Some(starts) => step.bind("run_start", starts).leave_unbound("total"),
        None => step.leave_unbound("run_start").bind("total", total),
    };
    over_runs(step, runs)
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

    fn makes(&self) -> Vec<String> {
        vec![self.to.clone(), format!("{}_total", self.to)]
    }

    fn reference(&self, _frame: &Frame, buffers: &mut Buffers) {
        let source = buffers.get(&self.of);
        let mut sums = Values::missing(&source.dims, 1);
        let mut sum = 0u32;
        for (at, &value) in source.value.iter().enumerate() {
            sums.set(at, sum.into(), 0.0);
            sum = sum.wrapping_add(value as u32);
        }
        buffers.put(&self.to, sums);
        buffers.put(&format!("{}_total", self.to), Values::exact(&[1], 1, vec![sum.into()]));
    }
}
