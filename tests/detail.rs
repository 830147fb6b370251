//! Octaves over the ground: the same ground from everywhere, on the device as in f64, in meshes, rays and pictures; and nothing of them where
//! a scene has none.

mod common;

use std::path::Path;

use common::{Ran, lodlab, measure, records, succeeded};
use glam::DVec2;
use lodlab::experiment::scene::Detail;
use lodlab::frame::octaves::{for_light, for_meshes};
use lodlab::gpu::Gpu;
use lodlab::ground::octaves::Octaves;
use lodlab::ground::{Detailed, Gap, Ground, Ray};
use lodlab::plan::product::Drawn;
use lodlab::reference::Frame;
use lodlab::run::{Keep, Setup};
use lodlab::stages::shared::octaves::in_mesh;

const RELIEF: &str =
    "Noise(kind: Ridged, seed: 4, size: (201, 157), cell_m: 30, height_m: (0, 900), wavelength_m: 2500)";
const FLIGHT: &str = "Flight(frames: 9, clearance_m: 3, keys: [(eye: (500, 600, 0), look_at: (3000, 2000, 300)), \
                      (eye: (3000.5, 2017.3, 900), look_at: (4000, 3000, 200)), (eye: (90000, -20000, 5000), look_at: (3000, 2000, 0))])";

fn scene(detail: &str, camera: &str) -> String {
    format!("terrain: {RELIEF}, detail: ({detail}), camera: {camera}, viewport: (64, 48)")
}

fn setup(detail: &str, camera: &str, chain: &str) -> Setup {
    Setup::chain(&scene(detail, camera), chain, Path::new(""), Keep::Last).unwrap_or_else(|error| panic!("{error}"))
}

fn places(first: (i32, i32), step: u32) -> String {
    format!(
        "[Kernel(file: \"octaves.wgsl\", bind: {{\"fixed\": New(name: \"fixed\", of: F32, size: (1000, 1)), \
         \"seen\": New(name: \"seen\", of: F32, size: (1000, 1)), \"beside\": New(name: \"beside\", of: F32, size: (1000, 1))}}, params: (first_cell: ({}, {}), step: {step}), over: \"fixed\")]",
        first.0, first.1
    )
}

/// The same places as `octaves.wgsl` has them.
fn height_m(octaves: &Octaves, first: (i32, i32), step: u32, at: u32) -> f64 {
    let row = f64::from(at / 50);
    let parts =
        [at.wrapping_mul(step), at.wrapping_mul(step).wrapping_mul(3)].map(|part| f64::from(part) / 2f64.powi(32));
    let sample = DVec2::new(f64::from(first.0) + 7.0 * row + parts[0], f64::from(first.1) + 3.0 * row + parts[1]);
    octaves.all_m(&octaves.place(sample))
}

/// A thousand places of the ground over a flight that goes from foot to far outside: their height does not change by a bit.
#[test]
fn the_ground_under_a_still_point_does_not_change() {
    let gpu = Gpu::open(None).unwrap();
    let detail = "octaves: 9, amplitude_m: 4, seed: 5";
    let (first, step) = ((3, 5), 77_777_777);
    let frames = Ran::frames(&gpu, &scene(detail, FLIGHT), &places(first, step));
    assert_eq!(frames.len(), 9);
    let still: Vec<u32> = frames[0].read("fixed");
    let own = Octaves::new(&Detail { octaves: 9, amplitude_m: 4.0, seed: 5, ..Detail::default() }).unwrap();
    for ran in &frames {
        assert!(ran.read::<u32>("fixed") == still);
        let (fixed, seen): (Vec<f32>, Vec<f32>) = (ran.read("fixed"), ran.read("seen"));
        for at in 0..1000 {
            let height_m = height_m(&own, first, step, at as u32);
            assert!(
                (f64::from(fixed[at]) - height_m).abs() < 200.0 * 6e-8 * own.most_m(),
                "{at}: {} {height_m}",
                fixed[at]
            );
            // a place that is seen from the eye is rounded to 2^-24 of its way
            let off_cells = 4000.0 * 2f64.powi(-23);
            assert!(
                (f64::from(seen[at]) - height_m).abs() < own.steepest() * off_cells,
                "{at}: {} {height_m}",
                seen[at]
            );
        }
    }
    let heights: Vec<f32> = bytemuck::cast_vec(still);
    let spread = heights.iter().fold((0.0f32, 0.0f32), |(low, high), height| (low.min(*height), high.max(*height)));
    assert!(spread.0 < -1.0 && spread.1 > 1.0, "{spread:?}");
}

/// Seen from an eye, too, if the way to the places has no more digits than f32: to the bit. And next to the eye, whichever side of a cell's
/// border it is on, nothing jumps.
#[test]
fn a_place_is_the_same_from_every_eye() {
    let gpu = Gpu::open(None).unwrap();
    // quarters of a cell of 30 m, and a hair's breadth beside a corner of cells
    let keys: Vec<String> = [(25.25, 40.5), (0.0, 0.0), (100.75, 33.0), (-7.5, 160.25), (60.0, 59.999_999_999_999)]
        .map(|(x, y): (f64, f64)| {
            let (x_m, y_m) = (30.0 * x, 30.0 * y);
            format!("(eye: ({x_m:?}, {y_m:?}, 2000), look_at: ({x_m:?}, {:?}, 0))", y_m + 900.0)
        })
        .into();
    let camera = format!("Flight(frames: 5, keys: [{}])", keys.join(", "));
    let own = Octaves::new(&Detail { octaves: 9, amplitude_m: 4.0, ..Detail::default() }).unwrap();
    let frames = Ran::frames(&gpu, &scene("octaves: 9, amplitude_m: 4", &camera), &places((3, 5), 3 << 22));
    for (frame, ran) in frames.iter().enumerate() {
        if frame < 4 {
            assert!(ran.read::<u32>("seen") == ran.read::<u32>("fixed"), "frame {frame}");
        }
        let beside: Vec<f32> = ran.read("beside");
        let most = (2.0 * own.steepest() * 2f64.powi(-20) + 400.0 * 6e-8 * own.most_m()) as f32;
        for (at, height_m) in beside.iter().enumerate() {
            assert!((height_m - beside[0]).abs() <= most, "frame {frame}, {at}: {height_m} beside {}", beside[0]);
        }
    }
}

/// The ground that a part of a terrain has is that of the whole, wherever the origin is; all octaves have their own numbers there, too.
#[test]
fn the_origin_can_be_anywhere() {
    let gpu = Gpu::open(None).unwrap();
    let eye = |east: i32, south: i32| {
        let eye = DVec2::new(3000.0, 2000.0) + 30.0 * DVec2::new(f64::from(east), f64::from(-south));
        format!("Still(eye: ({}, {}, 1500), pitch_deg: -30)", eye.x, eye.y)
    };
    // 0, 1e5 m and 1e7 m, to the east and to the north
    for cells in [0, 3_333, 333_333, 100_000_007] {
        let at = |first: (i32, i32), origin: (i32, i32)| {
            let detail = format!("octaves: 30, amplitude_m: 4, persistence: 0.5, origin: ({}, {})", origin.0, origin.1);
            let ran = Ran::chain(&gpu, &scene(&detail, &eye(first.0, first.1)), &places(first, 123_456_789));
            ran.read::<u32>("fixed")
        };
        let whole = at((40, 20), (cells, -cells));
        // the same places of a part that begins elsewhere
        for from in [(7, 0), (33, 12), (40, 20)] {
            assert!(at((40 - from.0, 20 - from.1), (cells + from.0, -cells + from.1)) == whole, "{cells} {from:?}");
        }
        if cells != 0 {
            assert!(at((40, 20), (0, 0)) != whole);
        }
    }
    // no step of the surface where two places are a millimetre apart
    let (cells, step) = (333_333, (2f64.powi(32) * 1e-3 / 30.0) as u32);
    let detail = format!("octaves: 12, amplitude_m: 4, origin: ({cells}, {cells})");
    let close: Vec<f32> = Ran::chain(&gpu, &scene(&detail, &eye(0, 0)), &places((60, 60), step)).read("fixed");
    let own = Octaves::new(&Detail { octaves: 12, amplitude_m: 4.0, ..Detail::default() }).unwrap();
    let most = own.steepest() * 10f64.sqrt() * 1e-3 / 30.0 + 400.0 * 6e-8 * own.most_m();
    let rows = close.chunks(50).flat_map(|row| row.windows(2));
    let largest = rows.map(|pair| f64::from((pair[1] - pair[0]).abs())).fold(0.0, f64::max);
    assert!(largest > 0.0 && largest < most, "{largest} of {most}");
}

/// Eq. 1 at its ends: cells without a size, cells larger than the waves, and no step of the mesh where an octave begins.
#[test]
fn a_mesh_takes_octaves_in_without_a_step() {
    let setup =
        setup("octaves: 5, amplitude_m: 8", "Still(eye: (3000, 2000, 0), clearance_m: 5)", "[HeightPyramid, RayCast]");
    let data = &setup.prepared.data;
    let frame = Frame::first(data, &data.cameras()[0]);
    let detail = data.ground.detail().unwrap();
    let sample = DVec2::new(77.3, 41.8);
    let at = |extent: f64| in_mesh(&frame, 0.0, (sample, 0.0), (extent, 0.0)).map(|(value, _)| value);
    for extent in [0.0, 1e-300, 1e-30, 2f64.powi(-7)] {
        let [height_m, split] = at(extent);
        assert_eq!(split, 6.0, "{extent}");
        assert!((height_m - detail.octaves().all_m(&detail.octaves().place(sample))).abs() < 1e-12);
    }
    for extent in [1.0, 2.5, 1e9, f64::INFINITY] {
        assert_eq!(at(extent), [0.0, 0.0], "{extent}");
    }
    // across o = 0, 1, .., 6: no more than the octave that fades, for each part of an octave
    let mut before = at(4.0);
    for step in 1..=20_000 {
        let now = at(4.0 * 2f64.powf(-f64::from(step) / 2000.0));
        let most_m = 8.0 * (now[1] - before[1]) + 1e-9;
        assert!((now[0] - before[0]).abs() <= most_m, "at {}: {} to {}", now[1], before[0], now[0]);
        before = now;
    }
    assert_eq!(before[1], 6.0);
}

/// The cast of all rays ends on the surface and passes nothing of it, from anywhere: compared with the octaves in small steps.
#[test]
fn rays_meet_the_octaves_first() {
    for camera in [
        "Still(eye: (3000, 2000, 0), yaw_deg: 40, pitch_deg: -9, clearance_m: 2)",
        "Still(eye: (-900, -500, 1500), look_at: (3000, 2000, 200))",
        "Still(eye: (3000, 2000, -300), yaw_deg: 70, pitch_deg: 25)",
    ] {
        let setup = setup("octaves: 4, amplitude_m: 9", camera, "[HeightPyramid, RayCast]");
        let data = &setup.prepared.data;
        let (ground, camera) = (data.ground.as_ref(), &data.cameras()[0]);
        let mut hits = 0;
        for pixel in (0..64 * 48).step_by(7) {
            let pixel = DVec2::new(f64::from(pixel % 64) + 0.5, f64::from(pixel / 64) + 0.5);
            let ray = Ray { eye_m: camera.eye_m, direction: camera.ray(pixel) };
            let Some((enter, leave)) = ground.stay(&ray) else { continue };
            let hit = ground.first_hit(&ray);
            let end = hit.unwrap_or(leave);
            let above_m = |t: f64| ground.above_m(ray.at(t));
            let side = above_m(enter).signum();
            // waves of octave 4 are 3.75 m long
            let steps = ((end - enter) / 0.2).ceil().min(60_000.0);
            let passed = (0..steps as u32).map(|step| enter + (end - enter) * f64::from(step) / steps);
            let least = passed.map(|t| side * above_m(t)).fold(f64::INFINITY, f64::min);
            assert!(least > -1e-6, "{pixel}: a ray was under the surface by {least} m before its hit");
            if let Some(hit) = hit {
                hits += 1;
                assert!(above_m(hit).abs() < 2e-8 * hit + 1e-9, "{pixel}: {}", above_m(hit));
            }
        }
        assert!(hits > 100, "{hits}");
    }
}

/// Octaves that nobody can see are not evaluated: by their height in meshes, by their length in light.
#[test]
fn octaves_that_cannot_be_seen_are_left_out() {
    let octaves_from = |clearance_m: f64| {
        let eye = format!("Still(eye: (3000, 2000, 0), pitch_deg: -40, clearance_m: {clearance_m})");
        let setup = setup("octaves: 16, amplitude_m: 4", &eye, "[HeightPyramid, RayCast]");
        let data = &setup.prepared.data;
        let (detail, camera) = (data.ground.detail().unwrap(), &data.cameras()[0]);
        (for_meshes(detail, camera), for_light(detail, camera))
    };
    let all: Vec<(u32, u32)> = [0.5, 100.0, 1000.0, 1e6].map(octaves_from).into();
    assert_eq!(all[0], (16, 16));
    assert!(all.windows(2).all(|pair| pair[1].0 <= pair[0].0 && pair[1].1 <= pair[0].1), "{all:?}");
    assert!(all[1].0 < 16 && all[1].1 < 16 && all[2].0 > 0, "{all:?}");
    assert_eq!(all[3], (0, 0));
}

/// Who knows samples only says so; everybody else runs on it.
#[test]
fn stages_run_on_octaves_or_say_why_not() {
    let camera = "Still(eye: (3000, 2000, 900), yaw_deg: 40, pitch_deg: -9)";
    let plan = |chain: &str| Setup::chain(&scene("octaves: 4", camera), chain, Path::new(""), Keep::Last);
    for chain in [
        "[HeightPyramid, RayCast, Shade]",
        "[HeightPyramid, LeadRays]",
        "[HeightPyramid, ViewGrid, AspectImportance, Warp, Project, Rasterize, Shade]",
        "[HeightPyramid, SketchMap, SketchImportance, ViewGrid, Warp, GeometryImage, Rasterize, Shade(octaves: Mesh)]",
        "[HeightPyramid, SketchMap, SketchImportance, ViewGrid, Warp, GeometryImage(heights: SketchMap), Rasterize, Shade]",
        "[HeightPyramid, Roughness, VertexSplitting, TriangleSplitting, Rasterize, Shade]",
    ] {
        let setup = plan(chain).unwrap_or_else(|error| panic!("{chain}: {error}"));
        let drawn: Option<Drawn<_>> = setup.plan.products.latest();
        assert!(drawn.is_none_or(|drawn| drawn.mesh.is_none() || drawn.promise.is_none()), "{chain} promises a bound");
    }
    for (chain, stage) in [
        ("[HeightPyramid, ViewGrid, Project, GridError, Rasterize, Compact, RayFill]", "GridError"),
        (
            "[HeightPyramid, PlanePyramid, ViewGrid, Project, GridError(rule: Proven), Rasterize, Compact, RayFill]",
            "PlanePyramid",
        ),
        ("[HeightPyramid, Roughness(error: Proven), VertexSplitting, TriangleSplitting, Rasterize]", "Roughness"),
    ] {
        let why = plan(chain).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(why.contains(stage) && why.contains("octaves"), "{chain}: {why}");
    }
}

/// A scene without octaves runs none of their code, and the plan says so.
#[test]
fn without_octaves_nothing_of_them_runs() {
    let folder = tempfile::tempdir().unwrap();
    let plan = |detail: &str| {
        let scene = scene(detail, "Still(eye: (3000, 2000, 900))");
        let chains = "{\"image\": [HeightPyramid, SketchMap, SketchImportance, ViewGrid, Warp, GeometryImage, Rasterize, Shade], \
                      \"cast\": [HeightPyramid, RayCast, Shade]}";
        std::fs::write(folder.path().join("a.ron"), format!("Experiment(scene: ({scene}), chains: {chains})")).unwrap();
        let output = lodlab(folder.path()).args(["plan", "a.ron"]).output().unwrap();
        succeeded(&output);
        String::from_utf8(output.stdout).unwrap()
    };
    for none in ["", "octaves: 0, amplitude_m: 9", "octaves: 5, amplitude_m: 0"] {
        let plan = plan(none);
        assert_eq!(plan.matches("octaves between samples").count(), 2, "{plan}");
        assert!(plan.contains("the scene has no detail") && !plan.contains("mesh_level"), "{plan}");
        assert!(!plan.contains("OCTAVES"), "{plan}");
    }
    let some = plan("octaves: 5");
    assert!(!some.contains("the scene has no detail") && some.contains("mesh_level"), "{some}");
    assert!(some.contains("OCTAVES"), "{some}");
}

/// What octaves are for: a mesh that takes them in is closer to the ground, and the less of them it takes the farther from it.
#[test]
fn a_mesh_with_octaves_is_closer_to_the_ground() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(
        "octaves: 6, amplitude_m: 6",
        "Still(eye: (3000, 2000, 0), yaw_deg: 40, pitch_deg: -12, clearance_m: 60)",
    );
    let scene = scene.replace("(64, 48)", "(160, 120)");
    let image = "HeightPyramid, SketchMap, SketchImportance, ViewGrid(size: (256, 256)), Warp, GeometryImage";
    let text = format!(
        "Experiment(scene: ({scene}), chains: {{\"image\": [{image}, Rasterize]}}, sweep: {{\"image.GeometryImage.bias\": [0, 0.5, 1, 30]}}, \
         measure: [ScreenError])"
    );
    std::fs::write(folder.path().join("a.ron"), text).unwrap();
    succeeded(&lodlab(folder.path()).args(["run", "a.ron", "--out", "out"]).output().unwrap());
    let records = records(&folder.path().join("out"));
    let errors: Vec<f64> = records.iter().map(|record| measure(record, "error_rms").unwrap()).collect();
    assert_eq!(errors.len(), 4);
    assert!(errors.windows(2).all(|pair| pair[1] > pair[0]) && errors[3] > 1.5 * errors[0], "{errors:?}");
    assert!(records.iter().all(|record| measure(record, "truth_error_max").unwrap() < 0.01));
}

/// What a ray is at most a gap above: not before, and no later than all of it.
#[test]
fn a_gap_is_kept() {
    let setup = setup(
        "octaves: 5, amplitude_m: 3",
        "Still(eye: (3000, 2000, 800), yaw_deg: 40, pitch_deg: -20)",
        "[HeightPyramid, RayCast]",
    );
    let data = &setup.prepared.data;
    let (detail, camera): (&Detailed, _) = (data.ground.detail().unwrap(), &data.cameras()[0]);
    for x in 0..40 {
        let ray = Ray { eye_m: camera.eye_m, direction: camera.ray(DVec2::new(1.5 * f64::from(x), 30.5)) };
        let at = |m: f64, of_way: f64| detail.first_within(&ray, 1.0, Gap { m, of_way }).unwrap();
        let all = [at(5.0, 1e-3), at(5.0, 0.0), at(0.5, 0.0), at(0.0, 0.0), at(-0.5, 0.0), at(-0.5, -1e-3)];
        assert!(all.windows(2).all(|pair| pair[0] <= pair[1]), "{all:?}");
        assert!(
            (detail.above_m(ray.at(all[1])) - 5.0).abs() < 1e-4 && (detail.above_m(ray.at(all[4])) + 0.5).abs() < 1e-4
        );
    }
}
