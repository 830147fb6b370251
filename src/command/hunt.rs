//! `lodlab hunt`

use std::time::Duration;

use lodlab::experiment::diagnostic::Diagnostic;
use lodlab::gpu::Gpu;
use lodlab::hunt::{self, Found, Hunt, Summary};

use super::progress::bar;
use crate::arguments::Hunting;

pub fn hunt_for(wanted: Hunting) -> Result<(), Diagnostic> {
    let time = wanted.seconds.map(|seconds| Duration::from_secs(seconds.into()));
    let Hunting { seed, frames, finds, tries, stage, dem: dems, .. } = wanted;
    let hunt = Hunt { seed, frames, time, finds, tries, stage, dems };
    let gpu = Gpu::open(wanted.adapter.as_deref())?;
    say!("seed {} on {}", hunt.seed, gpu.summary.name);
    let bar = bar();
    let mut found = 0;
    let mut failure = None;
    let mut note = |broken: Found| {
        found += 1;
        let file = wanted.out.join(format!("{}_{found}.ron", wanted.seed));
        let settings: String = broken.settings.iter().map(|(path, value)| format!(" --set '{path}={value}'")).collect();
        say!("BROKEN {} ({}): lodlab run {}{settings}", broken.promise, broken.value, file.display());
        let written = std::fs::create_dir_all(&wanted.out).and_then(|()| std::fs::write(&file, &broken.experiment));
        failure = failure.take().or(written.err());
    };
    let tell = |summary: &Summary| {
        bar.set_length(hunt.frames as u64);
        bar.set_position(summary.frames as u64);
    };
    let summary = hunt::hunt(&gpu, &hunt, &mut note, &tell);
    bar.finish_and_clear();
    let Summary { frames, promised, in_f64, refused } = summary?;
    say!("{frames} frames, {promised} of them with a proven bound: {found} broken promises");
    say!("({in_f64} scenes with a truth in f64; {refused} are no experiment, promise too much or do not fit)");
    match failure {
        Some(error) => Err(Diagnostic::run(format!("`{}` cannot be written: {error}", wanted.out.display()))),
        None if found > 0 => Err(Diagnostic::run("a promise is broken")),
        None => Ok(()),
    }
}
