//! Prefix sums as steps of any stage (`kernels/lists/scan.wgsl`).

use glam::UVec2;

use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::Elem;
use crate::plan::{BufferId, Chain, StepBuilder};

/// Number of elements of a buffer that a kernel counts in u32.
pub fn elements(chain: &Chain, buffer: BufferId) -> Result<u32, Diagnostic> {
    let buffer = chain.buffer(buffer);
    let too_many = |_| Diagnostic::input(format!("`{}` has more elements than u32 counts", buffer.name));
    u32::try_from(buffer.elements()).map_err(too_many).map_err(|message| message.at(chain.origin(), "this stage"))
}

/// Elements that a thread takes; `RUN` of the kernel, and the bits of a word of `compact.wgsl`.
pub const RUN: u32 = 32;

/// Threads as workgroups of 64, in a rectangle that a dispatch can have: a row has as many workgroups as are allowed.
pub fn over_runs(step: StepBuilder, runs: u32) -> Result<(), Diagnostic> {
    const MOST_WIDE: u32 = 64 * 32768;
    step.over(UVec2::new(runs.min(MOST_WIDE), runs.div_ceil(MOST_WIDE)))
}

/// The steps that put the prefix sums of `source` into `sums` and its sum into `total`.
pub fn scan(
    chain: &mut Chain,
    name: &str,
    source: BufferId,
    sums: BufferId,
    total: BufferId,
) -> Result<(), Diagnostic> {
    let length = elements(chain, source)?;
    let runs = length.div_ceil(RUN);
    let kernel = chain.kernel("lists/scan.wgsl")?;
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
