//! The steps of every stage, on the registry's own examples, and what a frame costs outside its kernels: `cargo bench --bench stages`;
//! a part of a stage's name after `--` chooses.
//!
//! Steps are timed inside whole frames: some are not the same when they run twice (a prefix sum in place), so none runs alone again and
//! again.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use lodlab::experiment::diagnostic::Diagnostic;
use lodlab::experiment::sweep::read_setting;
use lodlab::gpu::submit::SubmissionTime;
use lodlab::gpu::{Gpu, GpuError};
use lodlab::plan::Often;
use lodlab::run::{Keep, Setup};
use lodlab::stages::{Example, REGISTRY};

const SCENE: &str = "terrain: Noise(kind: Ridged, seed: 4, size: (1025, 1025), height_m: (0, 1500)), \
     camera: Still(eye: (15000, -200, 2600), look_at: (15000, 20000, 300), clearance_m: 200), viewport: (1024, 768)";

fn stages(criterion: &mut Criterion) {
    let gpu = match Gpu::open(None) {
        Ok(gpu) => gpu,
        Err(error) => return println!("skipped: {error}"),
    };
    println!("{} {}", gpu.summary.name, gpu.summary.driver);
    let folder = match tempfile::tempdir() {
        Ok(folder) => folder,
        Err(error) => return println!("skipped: no place for example files ({error})"),
    };
    for entry in REGISTRY {
        for (number, example) in entry.info.examples.iter().enumerate() {
            let name = format!("{} {}", entry.info.name, number + 1);
            let setup = set_up(example, folder.path()).unwrap_or_else(|error| panic!("{error}"));
            bench(criterion, &gpu, &name, &setup).unwrap_or_else(|error| panic!("{name}: {error}"));
        }
    }
}

/// An example at the sizes that people use.
fn set_up(example: &Example, folder: &Path) -> Result<Setup, Diagnostic> {
    for (name, text) in example.files {
        std::fs::write(folder.join(name), text).map_err(|error| Diagnostic::run(error.to_string()))?;
    }
    let text = format!("Experiment(scene: ({SCENE}), chains: {{\"bench\": {}}}, measure: [Time])", example.chain);
    let set = |(path, value): &(&str, &str)| read_setting(&format!("bench.{path}={value}"));
    let settings = example.in_benches.iter().map(set).collect::<Result<Vec<_>, _>>()?;
    Setup::first(text, folder.to_path_buf(), &settings, Keep::Last)
}

/// The steps of the chain's last stage, and its whole frame.
fn bench(criterion: &mut Criterion, gpu: &Arc<Gpu>, name: &str, setup: &Setup) -> Result<(), GpuError> {
    let mut executor = setup.executor(gpu)?;
    let mut group = criterion.benchmark_group(name);
    let last = setup.plan.steps.iter().filter_map(|step| step.run().map(|_| step.stage_index)).max();
    for (at, step) in setup.plan.steps.iter().enumerate().filter(|(_, step)| Some(step.stage_index) == last) {
        let is_once = step.often == Often::Once;
        let mut run = || if is_once { executor.setup_by_steps() } else { executor.frame_by_steps(0) };
        let often = if is_once { "once" } else { "frame" };
        group.bench_function(format!("{} ({often})", step.label), |bench| {
            bench.iter_custom(|times| {
                (0..times).map(|_| of_step(run().unwrap_or_else(|error| panic!("{error}")), at)).sum()
            })
        });
    }
    group.bench_function("whole frame", |bench| {
        bench.iter(|| executor.timed_frame(0).unwrap_or_else(|error| panic!("{error}")))
    });
    group.finish();
    Ok(())
}

fn of_step(submission: SubmissionTime, at: usize) -> Duration {
    let ms = submission.steps.iter().find(|time| time.step == at).and_then(|time| time.ms);
    // a step takes less than the clock can tell, and criterion no time of nothing
    Duration::from_secs_f64(ms.unwrap_or(0.0).max(1e-6) / 1e3)
}

/// Nothing but a submission and the wait for it: what every frame pays at least.
fn empty_submission(criterion: &mut Criterion) {
    let Ok(gpu) = Gpu::open(None) else { return };
    criterion.bench_function("empty submission", |bench| {
        bench.iter(|| {
            gpu.queue.submit([]);
            gpu.wait().unwrap_or_else(|error| panic!("{error}"));
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    targets = stages, empty_submission
}
criterion_main!(benches);
