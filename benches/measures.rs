//! What each measure of the registry takes to look at one frame of 1024 x 768 pixels: `cargo bench --bench measures`.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use lodlab::experiment::Experiment;
use lodlab::experiment::diagnostic::{Diagnostic, Source};
use lodlab::gpu::{Executor, Gpu};
use lodlab::measure::{Info, REGISTRY, Seen};
use lodlab::run::{self, Options, Truth};

const SCENE: &str = "scene: (terrain: Noise(kind: Ridged, seed: 4, size: (1025, 1025), height_m: (0, 1500)), \
     camera: Still(eye: (15000, -200, 2600), look_at: (15000, 20000, 300), clearance_m: 200), viewport: (1024, 768))";

/// A grid with an error of its own, a list of triangles, and a grid with a demand; all are shaded.
const CHAINS: [(&str, &str); 3] = [
    ("grid", "HeightPyramid, ViewGrid, Project, GridError, Rasterize, Shade"),
    ("list", "HeightPyramid, Roughness, VertexSplitting(threshold_px: 2), TriangleSplitting, Rasterize, Shade"),
    ("image", "HeightPyramid, SketchMap, SketchImportance, ViewGrid, Warp, GeometryImage, Rasterize, Shade"),
];

fn measures(criterion: &mut Criterion) {
    let gpu = match Gpu::open(None) {
        Ok(gpu) => gpu,
        Err(error) => return println!("skipped: {error}"),
    };
    for (info, chain) in REGISTRY.iter().flat_map(|info| CHAINS.map(|chain| (info, chain))) {
        bench(criterion, &gpu, info, chain).unwrap_or_else(|error| panic!("{error}"));
    }
}

fn bench(
    criterion: &mut Criterion,
    gpu: &Arc<Gpu>,
    info: &Info,
    (name, chain): (&str, &str),
) -> Result<(), Diagnostic> {
    let text = format!("Experiment({SCENE}, chains: {{\"{name}\": [{chain}]}}, measure: [{}])", info.name);
    let experiment = Experiment::read(Source::new("bench", text), "".into())?;
    for job in run::jobs(run::prepare(&experiment, &[])?, &Options::default())? {
        let plan = job.plan()?;
        let mut executor = Executor::new(gpu, &plan, &job.prepared.data)?;
        executor.setup()?;
        executor.frame(0)?;
        let mut buffers = BTreeMap::new();
        for &id in &plan.outputs {
            buffers.insert(id, executor.read(id)?);
        }
        let mut truth = job.truth.as_ref().map(|plan| Truth::new(gpu, plan, &job.prepared)).transpose()?;
        let truth = truth.as_mut().map(|truth| truth.frame(0)).transpose()?;
        let seen = Seen { plan: &plan, data: &job.prepared.data, frame: 0, buffers: &buffers, truth: truth.as_ref() };
        let measure = &job.prepared.measures[0].measure;
        criterion.bench_function(&format!("{} of a {name}", info.name), |bench| {
            bench.iter(|| measure.begin().frame(&seen));
        });
    }
    Ok(())
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    targets = measures
}
criterion_main!(benches);
