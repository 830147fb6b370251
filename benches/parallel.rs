//! Prefix sums and compaction of 16 million elements against a kernel that copies them, one vector of four a thread:
//! `cargo bench --bench parallel`.
//!
//! The rate of a run is taken beside the copy's of the same moment; the medians of many such pairs are compared.

use std::path::Path;

use lodlab::experiment::diagnostic::Diagnostic;
use lodlab::gpu::{Executor, Gpu};
use lodlab::plan::Plan;
use lodlab::run::{Keep, Setup};

const SIDE: u32 = 4096;

const COPY: &str = "
@group(0) @binding(0) var<storage, read> source: array<vec4<u32>>;
@group(0) @binding(1) var<storage, read_write> copy: array<vec4<u32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    copy[at] = source[at];
}
";

const FILL: &str = "
@group(0) @binding(0) var<storage, read_write> counts: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    counts[at] = (at * 2654435761u) >> 31u;
}
";

fn set_up(folder: &Path, chain: &str) -> Result<Setup, Diagnostic> {
    let scene = "terrain: Shape(kind: Flat, size: (9, 9)), camera: Still(eye: (100, 10, 50)), viewport: (8, 8)";
    let fill = format!(
        "Kernel(file: \"fill.wgsl\", bind: {{\"counts\": New(name: \"counts\", of: U32, size: ({SIDE}, {SIDE}))}}, over: ({SIDE}, {SIDE}))"
    );
    Setup::chain(scene, &format!("[{fill}, {chain}]"), folder, Keep::Everything)
}

/// Milliseconds of all steps but the first, which makes the numbers.
fn time_ms(executor: &mut Executor, plan: &Plan) -> Result<f64, Diagnostic> {
    let mut ms = 0.0;
    executor.begin_path_frame(0)?;
    let kernels = (0..plan.steps.len()).filter(|&step| plan.steps[step].run().is_some());
    for step in kernels.skip(1) {
        ms += executor.submit_step(step)?.wall_ms;
    }
    Ok(ms)
}

fn compare(folder: &Path) -> Result<(), Diagnostic> {
    let gpu = Gpu::open(None)?;
    println!("{} {}", gpu.summary.name, gpu.summary.driver);
    let bytes = f64::from(SIDE) * f64::from(SIDE) * 4.0;
    let copy = format!(
        "Kernel(file: \"copy.wgsl\", bind: {{\"source\": \"counts\", \"copy\": New(name: \"copy\", of: U32, like: \"counts\")}}, over: ({}, {SIDE}))",
        SIDE / 4
    );
    let chains = [("copy", copy.as_str()), ("scan", "Scan"), ("compact", "Compact(of: \"counts\", to: \"list\")")];
    let setups = chains.iter().map(|(_, chain)| set_up(folder, chain)).collect::<Result<Vec<_>, _>>()?;
    let mut executors = Vec::new();
    for setup in &setups {
        executors.push((setup.executor(&gpu)?, &setup.plan));
    }
    let mut samples: Vec<Vec<f64>> = vec![Vec::new(); chains.len()];
    for round in 0..12 {
        for (at, (executor, plan)) in executors.iter_mut().enumerate() {
            let ms = time_ms(executor, plan)?;
            if round > 0 {
                samples[at].push(ms);
            }
        }
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    for (at, (name, _)) in chains.iter().enumerate() {
        let ratios = samples[0].iter().zip(&samples[at]).map(|(copy, own)| copy / own).collect();
        let ms = median(samples[at].clone());
        println!(
            "{name:<8} {ms:8.2} ms, {:6.2} GB/s of input, {:.2} of the copy's rate",
            bytes / ms / 1e6,
            median(ratios)
        );
    }
    Ok(())
}

fn main() {
    let folder = match tempfile::tempdir() {
        Ok(folder) => folder,
        Err(error) => return println!("skipped: no place for temporary files ({error})"),
    };
    for (name, text) in [("copy.wgsl", COPY), ("fill.wgsl", FILL)] {
        if let Err(error) = std::fs::write(folder.path().join(name), text) {
            return println!("skipped: {error}");
        }
    }
    if let Err(error) = compare(folder.path()) {
        println!("{error}");
    }
}
