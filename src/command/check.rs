//! `lodlab check`

use std::sync::Arc;

use lodlab::check;
use lodlab::experiment::diagnostic::Diagnostic;
use lodlab::gpu::{Gpu, device};

pub fn check(stage: Option<&str>, adapter: Option<&str>) -> Result<(), Diagnostic> {
    let cases = check::cases::cases(stage)?;
    let known = device::list();
    if known.is_empty() {
        return Err(lodlab::gpu::GpuError::NoAdapter.into());
    }
    let gpus: Vec<Arc<Gpu>> = match adapter {
        Some(name) => vec![Gpu::open(Some(name))?],
        None => (0..known.len()).map(Gpu::open_nth).collect::<Result<_, _>>()?,
    };
    let mut failures = 0;
    for gpu in gpus {
        say!("{}", gpu.summary.name);
        for case in &cases {
            let outcomes = check::run_case(&gpu, case)?;
            // of one stage, what leads to it is not asked for
            let is_wanted =
                |outcome: &&check::Outcome| stage.is_none_or(|stage| outcome.stage == stage || !outcome.passed());
            for outcome in outcomes.iter().filter(is_wanted) {
                say!("  {outcome}");
                failures += usize::from(!outcome.passed());
            }
        }
    }
    match failures {
        0 => Ok(()),
        _ => Err(Diagnostic::run(format!("{failures} checks failed"))),
    }
}
