//! The ground truth is good to a hundredth of a pixel from any eye: standing on the ground, under it, on a line of samples, on a border,
//! below sea level, over needles.

mod common;

use std::sync::Arc;

use lodlab::camera::Camera;
use lodlab::gpu::{Executor, Gpu};
use lodlab::ground::EXACT_PX;
use lodlab::measure::truth;
use lodlab::run::{Keep, Options, Prepared, Setup, Truth, plan, truth_in_f64, truth_plan};
use lodlab::scene::SceneData;

fn prepared(text: String) -> Prepared {
    Setup::first(text, ".".into(), &[], Keep::Last).unwrap().prepared
}

/// The largest error of the rays that the GPU casts over the frames of a camera, in pixels.
fn error_px(terrain: &str, camera: &str, rest: &str, has_foreground: bool) -> f64 {
    let text = format!(
        "Experiment(scene: (terrain: {terrain}, camera: {camera}, {rest}), chains: {{\"cast\": [HeightPyramid, RayCast]}}, \
         measure: [ScreenError])"
    );
    let gpu = Gpu::open(None).unwrap();
    let mut prepared = prepared(text);
    if !has_foreground {
        prepared.data = Arc::new(SceneData { has_foreground: false, ..(*prepared.data).clone() });
    }
    let plan = Arc::new(truth_plan(&prepared).unwrap());
    let mut executor = Executor::new(&gpu, &plan, &prepared.data).unwrap();
    executor.setup().unwrap();
    let mut of_frame = |(frame, camera): (usize, &Camera)| {
        executor.frame(frame).unwrap();
        let hit_m: Vec<f32> = bytemuck::pod_collect_to_vec(&executor.read(plan.outputs[0]).unwrap());
        let hit_m: Vec<f64> = hit_m.into_iter().map(f64::from).collect();
        truth::error_px(prepared.data.ground.as_ref(), camera, &hit_m)
    };
    prepared.data.cameras().iter().enumerate().map(&mut of_frame).fold(0.0, f64::max)
}

const STEEP: &str = "Noise(kind: Hybrid, seed: 717, size: (65, 129), cell_m: 30, height_m: (-500, 8000), wavelength_m: 300, octaves: 8)";
const HIGH: &str =
    "Noise(kind: Ridged, seed: 3, size: (129, 129), cell_m: 90, height_m: (3000, 6900), wavelength_m: 4000)";
const DEEP: &str =
    "Noise(kind: Fbm, seed: 8, size: (128, 128), cell_m: 20, height_m: (-5200, -4700), wavelength_m: 900)";
const NARROW: &str =
    "Noise(kind: Billow, seed: 5, size: (128, 65), cell_m: (1, 100), height_m: (0, 60), wavelength_m: 200)";

/// Eyes that stand on the ground, and a little over and under it, looking around and down.
fn eyes(x_m: f64, y_m: f64) -> Vec<String> {
    let still = |clearance: &str, yaw_deg: f64, pitch_deg: f64, roll_deg: f64| {
        format!(
            "Still(eye: ({x_m}, {y_m}, -90000), yaw_deg: {yaw_deg}, pitch_deg: {pitch_deg}, roll_deg: {roll_deg}, clearance_m: {clearance})"
        )
    };
    vec![
        still("0", 0.0, -8.0, 0.0),
        still("0", 216.5, 20.0, 0.0),
        still("0.05", 90.0, -89.0, 0.0),
        still("0.5", 33.0, -1.0, 45.0),
        still("1.7", 270.0, -30.0, 0.0),
    ]
}

#[test]
fn next_to_the_eye() {
    let places = [(STEEP, 700.1, 1999.9), (HIGH, 5123.4, 6789.0), (DEEP, 1118.72, 1564.16), (NARROW, 55.936, 3820.8)];
    for (terrain, x_m, y_m) in places {
        for surface in ["Triangles", "Bilinear"] {
            for eye in eyes(x_m, y_m) {
                let px = error_px(terrain, &eye, &format!("viewport: (97, 73), surface: {surface}"), true);
                assert!(px < EXACT_PX, "{px} px on {terrain}, {surface}, from {eye}");
            }
        }
    }
}

/// A sample, a line of samples, a diagonal, a border, a corner.
#[test]
fn on_lines_and_borders() {
    for (x_m, y_m) in [(900.0, 1800.0), (900.0, 1815.0), (915.0, 1815.0), (0.0, 1000.0), (0.0, 0.0), (1920.0, 3840.0)] {
        for eye in eyes(x_m, y_m) {
            let px = error_px(STEEP, &eye, "viewport: (97, 73), fov_deg: 70", true);
            assert!(px < EXACT_PX, "{px} px from {eye}");
        }
    }
    // straight along a line of samples and along the border, where a ray comes into each cell at a corner of it
    let lines = [
        (
            "Noise(kind: Billow, seed: 20206, size: (200, 16), cell_m: (0.53705, 0.072142), height_m: (0, 352), wavelength_m: 26.7182375, octaves: 1)",
            "(0, 1, 0), clearance_m: 0.3, pitch_deg: -8",
        ),
        (
            "Shape(kind: Sine, size: (2, 200), cell_m: (0.26905, 0.26905), height_m: (0, 38), period_cells: 8)",
            "(0, 47, 0), clearance_m: 0.05, pitch_deg: -1",
        ),
    ];
    for (terrain, eye) in lines {
        let px = error_px(terrain, &format!("Still(eye: {eye})"), "viewport: (97, 81)", true);
        assert!(px < EXACT_PX, "{px} px over {terrain}");
    }
    // from a sample along the grid, over a patch whose bend f32 can hardly hold
    let flat = "Noise(kind: Ridged, seed: 14311, size: (64, 16), cell_m: (0.3719, 5.3055), height_m: (3000, 3000.0038916), wavelength_m: 2.65275, octaves: 1)";
    let px = error_px(
        flat,
        "Still(eye: (5.5785, 63.666, 3000), pitch_deg: -1)",
        "viewport: (129, 97), surface: Bilinear",
        true,
    );
    assert!(px < EXACT_PX, "{px} px over a patch that is nearly flat");
    let circle = "Orbit(frames: 2, center: (0, 3000, 100), radius_m: 10, height_m: -50, clearance_m: 0)";
    let px = error_px(STEEP, circle, "viewport: (64, 16), fov_deg: 20", true);
    assert!(px < EXACT_PX, "{px} px over the border");
}

/// What the octaves add is part of it: from foot and from the air, and as many octaves as there can be.
#[test]
fn over_octaves() {
    for detail in
        ["octaves: 6, amplitude_m: 3", "octaves: 30, amplitude_m: 2, persistence: 0.45, origin: (333333, -333333)"]
    {
        for surface in ["Triangles", "Bilinear"] {
            let rest = format!("viewport: (97, 73), surface: {surface}, detail: ({detail})");
            for (terrain, x_m, y_m) in [(HIGH, 5123.4, 6789.0), (DEEP, 1118.72, 1564.16)] {
                let far = format!("Still(eye: ({x_m}, {y_m}, 9000), pitch_deg: -30)");
                for eye in eyes(x_m, y_m).into_iter().skip(2).chain([far]) {
                    let px = error_px(terrain, &eye, &rest, true);
                    assert!(px < EXACT_PX, "{px} px on {terrain}, {surface}, {detail}, from {eye}");
                }
            }
        }
    }
}

#[test]
fn from_under_the_surface() {
    for depth_m in [0.02, 0.5, 30.0] {
        let eye =
            format!("Still(eye: (1118.72, 1564.16, {}), yaw_deg: 33, pitch_deg: 20)", surface_of_deep() - depth_m);
        let px = error_px(DEEP, &eye, "viewport: (97, 73)", true);
        assert!(px < EXACT_PX, "{px} px from {eye}");
    }
}

/// Height of the ground where the eyes of the test above are.
fn surface_of_deep() -> f64 {
    let scene = format!(
        "Experiment(scene: (terrain: {DEEP}, camera: Still(eye: (1118.72, 1564.16, -90000), clearance_m: 0)), chains: {{\"c\": [HeightPyramid, \
         RayCast]}}, measure: [Time])"
    );
    let prepared = prepared(scene);
    let eye_m = prepared.data.cameras()[0].eye_m;
    prepared.data.ground.surface_at(eye_m).z
}

/// What the test is of: without the formulas of the cells around the eye, f32 has too few digits. An eye in the air does without them.
#[test]
fn the_error_would_be_seen() {
    let worst =
        eyes(700.1, 1999.9).iter().map(|eye| error_px(STEEP, eye, "viewport: (97, 73)", false)).fold(0.0, f64::max);
    assert!(worst > EXACT_PX, "{worst} px without the formulas");
    let scene = format!(
        "Experiment(scene: (terrain: {HIGH}, camera: Still(eye: (5123, 6789, 0), clearance_m: 200)), chains: {{\"c\": [HeightPyramid, RayCast]}}, \
         measure: [Time])"
    );
    assert!(!prepared(scene).data.has_foreground);
}

/// Cliffs so steep that a place rounded to f32 is another height.
const CLIFFS: &str =
    "Noise(kind: Ridged, seed: 5, size: (97, 65), cell_m: (3, 5), height_m: (0, 90000), wavelength_m: 60)";

#[test]
fn what_f32_cannot_cast_f64_does() {
    let gpu = Gpu::open(None).unwrap();
    let mut worst_px = 0.0f64;
    for surface in ["Triangles", "Bilinear"] {
        let rest = format!("viewport: (64, 48), surface: {surface}");
        for eye in
            ["Still(eye: (140, 160, 0), clearance_m: 20, pitch_deg: -20)", "Still(eye: (-50, 100, 3000), yaw_deg: 60)"]
        {
            worst_px = worst_px.max(error_px(CLIFFS, eye, &rest, true));
            let text = format!(
                "Experiment(scene: (terrain: {CLIFFS}, camera: {eye}, {rest}), chains: {{\"cast\": [HeightPyramid, RayCast]}}, \
                 measure: [ScreenError])"
            );
            let prepared = prepared(text);
            assert!(truth_in_f64(&prepared.data).is_some());
            let plan = Arc::new(truth_plan(&prepared).unwrap());
            let frame = Truth::new(&gpu, &plan, &prepared).unwrap().frame(0).unwrap();
            assert!(frame.error_px < 1e-6, "{} px, {surface}, {eye}", frame.error_px);
            assert!(frame.distance_m.iter().filter(|distance_m| **distance_m >= 0.0).count() > 300);
        }
    }
    assert!(worst_px > EXACT_PX, "{worst_px} px in f32");
}

/// Where f64 has too few digits as well, nothing runs; nor does a stage that promises less than rounding moves.
#[test]
fn what_nobody_can_know_is_refused() {
    let planned = |terrain: &str, camera: &str, chain: &str| {
        let text = format!(
            "Experiment(scene: (terrain: {terrain}, camera: {camera}, viewport: (64, 48)), chains: {{\"c\": {chain}}}, measure: [ScreenError])"
        );
        plan(&Prepared::first(text, ".".into(), &[]).unwrap(), &Options::default())
            .map(|_| ())
            .map_err(|error| error.message)
    };
    let needles = "Shape(kind: Checkerboard, size: (32, 32), cell_m: 1.25, height_m: (0, 90000))";
    let standing = "Still(eye: (19, 0, 0), clearance_m: 0)";
    let error = planned(needles, standing, "[HeightPyramid, RayCast]").unwrap_err();
    assert!(error.contains("not even in f64"), "{error}");
    let grid = |bound_px: &str| {
        format!(
            "[HeightPyramid, PlanePyramid, ViewGrid(size: (17, 23)), Project(filter: Finest), GridError(rule: Proven, threshold_px: {bound_px}), \
                 LeadRays, Rasterize, Compact, RayFill]"
        )
    };
    let blocks = |bound_px: &str| {
        format!(
            "[HeightPyramid, Roughness(error: Proven), VertexSplitting(threshold_px: {bound_px}), TriangleSplitting, Rasterize]"
        )
    };
    let eye = "Still(eye: (140, 160, 0), clearance_m: 20)";
    for chain in [grid("0.1"), blocks("0.1")] {
        let error = planned(CLIFFS, eye, &chain).unwrap_err();
        assert!(error.contains("promises 0.1 px, and rounding in f32"), "{error}");
    }
    // of a bound that has room for it, what rounding moves is kept
    assert!(planned(CLIFFS, eye, &grid("20")).is_ok() && planned(CLIFFS, eye, &blocks("20")).is_ok());
    let hills = "Noise(kind: Ridged, seed: 5, size: (97, 65), cell_m: 30, height_m: (0, 900), wavelength_m: 900)";
    for bound_px in ["1e-30", "0.00001"] {
        for chain in [grid(bound_px), blocks(bound_px)] {
            let error = planned(hills, eye, &chain).unwrap_err();
            assert!(error.contains("rounding in f32"), "{error}");
        }
    }
    assert!(planned(hills, eye, &blocks("0")).is_err());
    assert!(planned(hills, eye, &grid("0.01")).is_ok() && planned(hills, eye, &blocks("0.01")).is_ok());
}
