//! Helpers for tests that use lodlab as a user does.
#![allow(dead_code)]

pub mod bounds;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;

use lodlab::gpu::Gpu;
use lodlab::plan::BufferId;
use lodlab::run::{Keep, Setup};

pub const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Terrains of 129 x 129 samples that are hard on a bound.
pub const SHAPES: [(&str, &str); 5] = [
    ("spike", "Shape(kind: Spike, size: (129, 129), cell_m: 10, height_m: (0, 500))"),
    ("cliff", "Shape(kind: Cliff, size: (129, 129), cell_m: 10, height_m: (0, 400))"),
    ("checkerboard", "Shape(kind: Checkerboard, size: (129, 129), cell_m: 10, height_m: (0, 100), period_cells: 8)"),
    ("ridges", "Noise(kind: Ridged, seed: 5, size: (129, 129), cell_m: 10, height_m: (0, 500), wavelength_m: 600)"),
    ("flat", "Shape(kind: Flat, size: (129, 129), cell_m: 10, height_m: (40, 40))"),
];

/// Cameras for them.
pub const VIEWS: [(&str, &str); 7] = [
    ("orbit", "Orbit(frames: 4, center: (640, 640, 100), radius_m: 500, height_m: 400, clearance_m: 20)"),
    ("near the ground", "Still(eye: (300, 300, 0), yaw_deg: 40, pitch_deg: -2, clearance_m: 1.5)"),
    ("horizon", "Still(eye: (640, 20, 600), yaw_deg: 0, pitch_deg: 0, clearance_m: 20)"),
    ("straight down", "Still(eye: (640, 640, 900), pitch_deg: -90)"),
    ("behind a ridge", "Still(eye: (520, 300, 0), yaw_deg: 10, pitch_deg: 8, clearance_m: 5)"),
    ("rolled", "Still(eye: (300, 900, 700), look_at: (700, 600, 0), roll_deg: 50, clearance_m: 20)"),
    ("from outside", "Still(eye: (-300, -200, 500), look_at: (640, 640, 50))"),
];

pub fn lodlab(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lodlab"));
    command.current_dir(folder);
    command
}

pub fn run(folder: &Path, arguments: &[&str]) -> Output {
    lodlab(folder).args(arguments).output().expect("the program starts")
}

/// Standard error.
pub fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).trim_end().to_string()
}

pub fn succeeded(output: &Output) {
    assert!(output.status.success(), "{}\n{}", String::from_utf8_lossy(&output.stdout), errors(output));
}

/// A TIFF of nothing but its tags: number, type (3: u16, 4: u32), count, value.
pub fn tiff(entries: &[(u16, u16, u32, u32)]) -> Vec<u8> {
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, kind, count, value) in entries {
        bytes
            .extend([&tag.to_le_bytes()[..], &kind.to_le_bytes(), &count.to_le_bytes(), &value.to_le_bytes()].concat());
    }
    bytes.extend(0u32.to_le_bytes());
    bytes
}

/// Elevation data beside the checkout, which need not be there: tests that want it are shown as ignored without it.
pub fn shared_dem() -> PathBuf {
    Path::new(ROOT).join("../shared/dem")
}

/// The rows of the last run's cells, in the order of its file.
pub fn rows(folder: &Path) -> Vec<serde_json::Value> {
    let text = std::fs::read_to_string(folder.join("records.json")).expect("records.json is there");
    serde_json::from_str(&text).expect("records.json is JSON")
}

/// The records of those of them that have one, in the same order.
pub fn records(folder: &Path) -> Vec<serde_json::Value> {
    let record = |row: serde_json::Value| {
        let path = folder.join(format!("cells/{}.json", row["cell"].as_str()?));
        let text = std::fs::read_to_string(path).ok()?;
        serde_json::from_str(&text).ok()
    };
    rows(folder).into_iter().filter_map(record).collect()
}

pub fn measure(record: &serde_json::Value, name: &str) -> Option<f64> {
    let measures = record["measures"].as_array()?;
    measures.iter().find(|measure| measure["name"] == name)?["value"].as_f64()
}

/// A chain that ran once, with all its buffers as they are after the first frame.
pub struct Ran {
    buffers: std::collections::BTreeMap<String, Vec<u8>>,
}

impl Ran {
    /// Runs the chain in a folder that has the tests' kernels; `scene` is what stands between `scene: (` and `)`.
    pub fn chain(gpu: &Arc<Gpu>, scene: &str, chain: &str) -> Self {
        Self::frames(gpu, scene, chain).remove(0)
    }

    /// The same after each frame of the path.
    pub fn frames(gpu: &Arc<Gpu>, scene: &str, chain: &str) -> Vec<Self> {
        let folder = Path::new(ROOT).join("tests/kernels_of_tests");
        let setup = Setup::chain(scene, chain, &folder, Keep::Everything).unwrap_or_else(|error| panic!("{error}"));
        let mut executor = setup.executor(gpu).unwrap();
        let frame = |frame: usize| {
            executor.frame(frame).unwrap();
            let read = |&id: &BufferId| (setup.plan.buffer(id).name.clone(), executor.read(id).unwrap());
            Self { buffers: setup.plan.outputs.iter().map(read).collect() }
        };
        (0..setup.plan.frames).map(frame).collect()
    }

    /// The last buffer of that name.
    pub fn read<T: bytemuck::Pod>(&self, name: &str) -> Vec<T> {
        bytemuck::pod_collect_to_vec(&self.buffers[name])
    }
}

/// Writes an experiment, runs it as a user does, and returns its records.
pub fn records_of(folder: &Path, experiment: &str, extra: &[&str]) -> Vec<serde_json::Value> {
    std::fs::write(folder.join("made.ron"), experiment).unwrap();
    succeeded(&run(folder, &[&["run", "made.ron", "--out", "made"], extra].concat()));
    records(&folder.join("made"))
}
