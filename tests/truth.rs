//! The ground truth is good to a hundredth of a pixel from any eye: standing on the ground, under it, on a line of samples, on a border,
//! below sea level, over needles.

mod common;

use std::sync::Arc;

use lodlab::gpu::Gpu;
use lodlab::measure::truth::MOST_ERROR_PX;
use lodlab::run::{Keep, Prepared, Setup, Truth, truth_plan};
use lodlab::scene::SceneData;

fn prepared(text: String) -> Prepared {
    Setup::first(text, ".".into(), &[], Keep::Last).unwrap().prepared
}

/// The largest error of the truth over the frames of a camera, in pixels.
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
    let mut truth = Truth::new(&gpu, &plan, &prepared).unwrap();
    let frames = 0..prepared.data.cameras().len();
    frames.map(|frame| truth.frame(frame).unwrap().error_px).fold(0.0, f64::max)
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
                assert!(px < MOST_ERROR_PX, "{px} px on {terrain}, {surface}, from {eye}");
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
            assert!(px < MOST_ERROR_PX, "{px} px from {eye}");
        }
    }
    let circle = "Orbit(frames: 2, center: (0, 3000, 100), radius_m: 10, height_m: -50, clearance_m: 0)";
    let px = error_px(STEEP, circle, "viewport: (64, 16), fov_deg: 20", true);
    assert!(px < MOST_ERROR_PX, "{px} px over the border");
}

#[test]
fn from_under_the_surface() {
    for depth_m in [0.02, 0.5, 30.0] {
        let eye =
            format!("Still(eye: (1118.72, 1564.16, {}), yaw_deg: 33, pitch_deg: 20)", surface_of_deep() - depth_m);
        let px = error_px(DEEP, &eye, "viewport: (97, 73)", true);
        assert!(px < MOST_ERROR_PX, "{px} px from {eye}");
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
    assert!(worst > MOST_ERROR_PX, "{worst} px without the formulas");
    let scene = format!(
        "Experiment(scene: (terrain: {HIGH}, camera: Still(eye: (5123, 6789, 0), clearance_m: 200)), chains: {{\"c\": [HeightPyramid, RayCast]}}, \
         measure: [Time])"
    );
    assert!(!prepared(scene).data.has_foreground);
}
