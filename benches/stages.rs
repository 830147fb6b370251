//! Every stage, and what a frame costs outside its kernels: `cargo bench --bench stages`.

use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use lodlab::experiment::Experiment;
use lodlab::experiment::diagnostic::{Diagnostic, Source};
use lodlab::gpu::{Executor, Gpu};
use lodlab::plan::{Often, Plan};
use lodlab::run::{self, Options, Prepared};

const SCENE: &str = "scene: (terrain: Noise(kind: Ridged, seed: 4, size: (1025, 1025), height_m: (0, 1500)), \
     camera: Still(eye: (15000, -200, 2600), look_at: (15000, 20000, 300), clearance_m: 200), viewport: (1024, 768))";

/// Chains that between them have every stage of the registry.
const CHAINS: [(&str, &str); 6] = [
    ("grid", "[HeightPyramid, ViewGrid(size: (512, 384)), Project, Rasterize, Shade]"),
    (
        "warped, filled",
        "[HeightPyramid, ViewGrid(size: (512, 384)), AspectImportance, Warp, Project, GridError, Rasterize, Compact, RayFill, Scan(of: \"pixels\")]",
    ),
    (
        "proven",
        "[HeightPyramid, PlanePyramid, ViewGrid(size: (96, 72)), Project(filter: Finest), GridError(rule: Proven), LeadRays, Rasterize, Compact, RayFill]",
    ),
    (
        "splitting",
        "[HeightPyramid, Roughness(error: Proven), VertexSplitting(threshold_px: 2), TriangleSplitting, Rasterize, Shade]",
    ),
    ("ray cast", "[HeightPyramid, RayCast, Shade]"),
    (
        "kernel",
        "[Kernel(file: \"kernels/smooth.wgsl\", bind: {\"src\": \"height\", \"dst\": New(name: \"smooth\", of: F32, like: \"height\")}, over: \"smooth\")]",
    ),
];

fn prepare(stages: &str) -> Result<(Prepared, Plan), Diagnostic> {
    let text = format!("Experiment({SCENE}, chains: {{\"bench\": {stages}}}, measure: [Time])");
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments");
    let experiment = Experiment::read(Source::new("bench", text), folder)?;
    let prepared = run::prepare(&experiment, &[])?.remove(0);
    let plan = run::plan(&prepared, &Options::default())?;
    Ok((prepared, plan))
}

fn stages(criterion: &mut Criterion) {
    let gpu = match Gpu::open(None) {
        Ok(gpu) => gpu,
        Err(error) => return println!("skipped: {error}"),
    };
    println!("{} {}", gpu.summary.name, gpu.summary.driver);
    for (name, text) in CHAINS {
        let (prepared, plan) = prepare(text).unwrap_or_else(|error| panic!("{error}"));
        let executor = Executor::new(&gpu, &plan, &prepared.data).unwrap_or_else(|error| panic!("{error}"));
        executor.setup().unwrap_or_else(|error| panic!("{error}"));
        let mut group = criterion.benchmark_group(name);
        for (at, step) in plan.steps.iter().enumerate() {
            let often = if step.often == Often::Once { "once" } else { "frame" };
            group.bench_function(format!("{} {} ({often})", step.stage, step.label), |bench| {
                bench.iter(|| executor.step(at, 0).unwrap_or_else(|error| panic!("{error}")));
            });
        }
        group.bench_function("whole frame", |bench| {
            bench.iter(|| executor.frame(0).unwrap_or_else(|error| panic!("{error}")))
        });
        group.finish();
    }
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
