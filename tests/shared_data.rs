//! What is tested on large real terrain beside the checkout. Without it, these tests are shown as ignored.

mod common;

use common::bounds::{BOTH, proven_holds, splitting_holds};
use libtest_mimic::{Arguments, Failed, Trial};
use lodlab::gpu::Gpu;
use lodlab::plan::product::Drawn;
use lodlab::reference::{self, Buffers, Frame};
use lodlab::run::{Keep, Setup};

const PUGET: &str = "puget_sound_cascades_2049x1025.png\", cell_m: 90, height_scale_m: 0.125";
const JACKSBORO: &str = "jacksboro_403x344.png\", cell_m: (74.48, 92.61), height_offset_m: 236";
const MOON: &str = "moon_apennines_4096.png\", cell_m: 114";
const OVER_PUGET: &str = "Flight(frames: 2, clearance_m: 200, keys: [(eye: (90000, 42000, 2500), look_at: (150000, 50000, 1200)), (eye: (130000, 46000, 2600), look_at: (180000, 60000, 1500))])";
const OVER_JACKSBORO: &str = "Flight(frames: 2, clearance_m: 150, keys: [(eye: (3000, 2000, 2600), look_at: (14000, 16000, 900)), (eye: (15000, 17000, 2300), look_at: (24000, 28000, 1200))])";

fn main() {
    let is_absent = !common::shared_dem().is_dir();
    let mut trials = Vec::new();
    for (name, file, camera) in [
        ("puget", PUGET, "Still(eye: (60e3, 20e3, 1500), look_at: (120e3, 50e3, 1000))"),
        ("moon", MOON, "Still(eye: (100e3, 300e3, 6000), look_at: (200e3, 350e3, 1500))"),
    ] {
        for surface in ["Triangles", "Bilinear"] {
            let trial = move || ground_truth(&terrain(file), surface, camera);
            trials.push(Trial::test(format!("ground truth {name} {surface}"), trial));
        }
    }
    for (name, file, camera) in [("puget", PUGET, OVER_PUGET), ("jacksboro", JACKSBORO, OVER_JACKSBORO)] {
        trials.push(Trial::test(format!("proven grid {name}"), move || {
            proven_holds(name, &terrain(file), camera, "(320, 240)", "Triangles", (2, 1));
            Ok(())
        }));
        trials.push(Trial::test(format!("splitting {name}"), move || {
            splitting_holds(&terrain(file), camera, "(320, 240)", BOTH);
            Ok(())
        }));
    }
    let trials = trials.into_iter().map(|trial| trial.with_ignored_flag(is_absent)).collect();
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

fn terrain(file: &str) -> String {
    format!("Dem(file: \"{}/{file})", common::shared_dem().display())
}

/// The ray cast, large and at grazing angles, against the brute-force reference at a few thousand pixels.
fn ground_truth(terrain: &str, surface: &str, camera: &str) -> Result<(), Failed> {
    let gpu = Gpu::open(None)?;
    let scene = format!("terrain: {terrain}, surface: {surface}, camera: {camera}, viewport: (64, 48)");
    let setup = Setup::chain(&scene, "[HeightPyramid, RayCast]", "".as_ref(), Keep::Last)?;
    let mut executor = setup.executor(&gpu)?;
    executor.frame(0)?;
    let distance = setup.plan.products.latest::<Drawn<_>>().ok_or("nothing is drawn")?.distance;
    let ours = setup.plan.buffer(distance).values(&executor.read(distance)?);
    let data = &setup.prepared.data;
    let mut buffers = Buffers::of_scene(data);
    setup.prepared.stages[1].reference(&Frame::first(data, &data.cameras()[0]), &mut buffers)?;
    let difference = reference::compare(&ours, &*buffers.get("distance")?);
    assert_eq!(difference.beyond, 0, "{difference:?}");
    assert!(difference.undecided < 200, "{difference:?}");
    Ok(())
}
