//! Helpers for tests that use lodlab as a user does.
#![allow(dead_code)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

pub const ROOT: &str = env!("CARGO_MANIFEST_DIR");

pub fn lodlab(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lodlab"));
    command.current_dir(folder);
    command
}

pub fn run(folder: &Path, arguments: &[&str]) -> Output {
    lodlab(folder).args(arguments).output().expect("the program starts")
}

/// Standard error without what drivers print on their own.
pub fn errors(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr);
    let own: Vec<&str> = text.lines().filter(|line| !line.contains("XDG_RUNTIME_DIR")).collect();
    own.join("\n")
}

pub fn succeeded(output: &Output) {
    assert!(output.status.success(), "{}\n{}", String::from_utf8_lossy(&output.stdout), errors(output));
}

/// Elevation data beside the checkout, or `None` after saying that it is not there.
pub fn shared_dem() -> Option<PathBuf> {
    let folder = Path::new(ROOT).join("../shared/dem");
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: no shared data");
    None
}

pub fn records(folder: &Path) -> Vec<serde_json::Value> {
    let text = std::fs::read_to_string(folder.join("records.json")).expect("records.json is there");
    serde_json::from_str(&text).expect("records.json is JSON")
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
    pub fn chain(gpu: &lodlab::gpu::Gpu, scene: &str, chain: &str) -> Self {
        use lodlab::experiment::{Experiment, diagnostic::Source};
        let text = format!("Experiment(scene: ({scene}), chains: {{\"test\": {chain}}}, measure: [Time])");
        let folder = Path::new(ROOT).join("tests/kernels_of_tests");
        let experiment = Experiment::read(Source::new("test", text), folder).unwrap_or_else(|error| panic!("{error}"));
        let prepared = lodlab::run::prepare(&experiment, &[]).unwrap_or_else(|error| panic!("{error}")).remove(0);
        let options = lodlab::run::Options { keep_everything: true, ..Default::default() };
        let plan = lodlab::run::plan(&prepared, &options).unwrap_or_else(|error| panic!("{error}"));
        let executor = lodlab::gpu::Executor::new(gpu, &plan, &prepared.data).unwrap();
        executor.setup().unwrap();
        executor.frame(0).unwrap();
        let names = plan.buffers.iter().map(|buffer| buffer.name.clone());
        let read = |name: String| {
            let id = plan.find(&name).unwrap();
            (name, executor.read(id).unwrap())
        };
        Self { buffers: names.map(read).collect() }
    }

    /// The last buffer of that name.
    pub fn read<T: bytemuck::Pod>(&self, name: &str) -> Vec<T> {
        bytemuck::pod_collect_to_vec(&self.buffers[name])
    }
}
