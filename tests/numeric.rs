//! Every stage of the registry against its f64 reference, on the first adapter (`lodlab check` does all adapters).

mod common;

use lodlab::check;
use lodlab::experiment::Experiment;
use lodlab::experiment::diagnostic::Source;
use lodlab::gpu::{Executor, Gpu};
use lodlab::reference::{self, Frame};
use lodlab::run::{self, Options};

#[test]
fn every_stage_agrees_with_its_reference() {
    let gpu = Gpu::open(None).unwrap();
    let outcomes = check::run(&gpu).unwrap();
    let failed: Vec<String> =
        outcomes.iter().filter(|outcome| !outcome.passed()).map(|outcome| outcome.to_string()).collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    // nothing in the catalogue makes numbers to sum but `Compact`, for itself; tests/parallel.rs has both to themselves
    let elsewhere = ["Kernel", "Scan"];
    for info in lodlab::stages::REGISTRY.iter().filter(|info| !elsewhere.contains(&info.name)) {
        let of_stage = outcomes.iter().filter(|outcome| outcome.stage == info.name);
        let compared: usize = of_stage.map(|outcome| outcome.local.compared).sum();
        // the fewest are of LeadRays, which has one for 64 pixels
        assert!(compared > 400, "{} is not checked: {compared} values", info.name);
    }
}

/// Real data, large and at grazing angles, against the brute-force reference at a few thousand pixels.
#[test]
fn ground_truth_agrees_with_f64_on_real_terrain() {
    let Some(dem) = common::shared_dem() else { return };
    let gpu = Gpu::open(None).unwrap();
    let scenes = [
        ("puget_sound_cascades_2049x1025.png", 90.0, 0.125, "eye: (60e3, 20e3, 1500), look_at: (120e3, 50e3, 1000)"),
        ("moon_apennines_4096.png", 114.0, 1.0, "eye: (100e3, 300e3, 6000), look_at: (200e3, 350e3, 1500)"),
    ];
    for (file, cell_m, scale, camera) in scenes {
        for surface in ["Triangles", "Bilinear"] {
            let text = format!(
                "Experiment(scene: (terrain: Dem(file: \"{file}\", cell_m: {cell_m}, height_scale_m: {scale}), surface: {surface}, \
                 camera: Still({camera}), viewport: (64, 48)), chains: {{\"cast\": [HeightPyramid, RayCast]}}, measure: [ScreenError])"
            );
            let experiment = Experiment::read(Source::new(file, text), dem.clone()).unwrap();
            let prepared = run::prepare(&experiment, &[]).unwrap().remove(0);
            let plan = run::plan(&prepared, &Options::default()).unwrap();
            let executor = Executor::new(&gpu, &plan, &prepared.data).unwrap();
            executor.setup().unwrap();
            executor.frame(0).unwrap();
            let ours: Vec<f32> = bytemuck::pod_collect_to_vec(&executor.read(plan.outputs[0]).unwrap());
            let ours: Vec<f64> = ours.into_iter().map(|t| if t < 0.0 { f64::NAN } else { t.into() }).collect();
            let frame = Frame { data: &prepared.data, camera: &prepared.data.cameras[0] };
            let mut buffers = reference::Buffers::of_scene(&prepared.data);
            prepared.stages[1].reference(&frame, &mut buffers);
            let difference = reference::compare(&ours, &buffers.get("distance"), f64::is_nan);
            assert_eq!(difference.beyond, 0, "{file} {surface}: {difference:?}");
            assert!(difference.undecided < 200, "{file} {surface}: {difference:?}");
        }
    }
}
