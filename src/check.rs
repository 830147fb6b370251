//! Numerical check: every stage of the registry against its f64 reference, on ordinary and extreme input.
//!
//! Each case is a small scene and a chain. The chain runs on the GPU with every buffer kept; then each stage's
//! reference is fed once with what the GPU fed its kernel (*local*: is this kernel right?) and once with the
//! reference chain (*accumulated*: how much has the chain lost by then?).

use crate::experiment::Experiment;
use crate::experiment::diagnostic::{Diagnostic, Source};
use crate::gpu::{Executor, Gpu};
use crate::kernel::Elem;
use crate::plan::{Buffer, BufferId, Chain, Demand, Often, Plan, Storage};
use crate::reference::{self, Buffers, Difference, Frame, Values};
use crate::run::{self, Prepared};
use std::fmt;

/// One buffer of one stage in one case.
#[derive(Clone, Debug)]
pub struct Outcome {
    pub case: String,
    pub stage: String,
    pub buffer: String,
    pub local: Difference,
    pub accumulated: Difference,
}

/// Share of values that may hang on a decision; with more, the case would say nothing.
const MOST_UNDECIDED: f64 = 0.25;

impl Outcome {
    pub fn passed(&self) -> bool {
        let total = (self.local.compared + self.local.undecided).max(1) as f64;
        self.local.beyond == 0 && self.accumulated.beyond == 0 && self.local.undecided as f64 / total <= MOST_UNDECIDED
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let verdict = if self.passed() { "ok  " } else { "FAIL" };
        write!(
            f,
            "{verdict} {:<28} {:<14} {:<12} {:>7} values, {:>5} undecided; local {:.2e} ({:.2} of bound, {} beyond), accumulated {:.2e} ({} beyond)",
            self.case,
            self.stage,
            self.buffer,
            self.local.compared,
            self.local.undecided,
            self.local.largest,
            self.local.largest_of_bound,
            self.local.beyond,
            self.accumulated.largest,
            self.accumulated.beyond,
        )
    }
}

/// Runs all cases on one adapter.
pub fn run(gpu: &Gpu) -> Result<Vec<Outcome>, Diagnostic> {
    let mut outcomes = Vec::new();
    for (name, text) in cases() {
        let experiment = Experiment::read(Source::new(name.clone(), text), Default::default())?;
        for prepared in run::prepare(&experiment, &[])? {
            let case = format!("{name} {}", prepared.cell.chain);
            outcomes.extend(check_chain(gpu, &prepared, &case)?);
        }
    }
    Ok(outcomes)
}

/// Terrains from 2 x 2 samples to large, kind and unkind; cameras above, below, beside, far and near.
fn cases() -> Vec<(String, String)> {
    let terrains = [
        ("smallest", "Shape(kind: Ramp, size: (2, 2), cell_m: 500.0, height_m: (0, 100))"),
        ("strip", "Shape(kind: Sine, size: (2, 65), cell_m: 30.0, height_m: (0, 50), period_cells: 9)"),
        ("odd", "Noise(kind: Fbm, seed: 1, size: (37, 53), cell_m: 30.0, height_m: (0, 400), wavelength_m: 700)"),
        (
            "anisotropic",
            "Noise(kind: Ridged, seed: 2, size: (130, 97), cell_m: (20.0, 31.5), height_m: (200, 900), wavelength_m: 1500)",
        ),
        (
            "large",
            "Noise(kind: Billow, seed: 3, size: (1025, 515), cell_m: 10.0, height_m: (-300, 700), wavelength_m: 3000)",
        ),
        ("flat", "Shape(kind: Flat, size: (65, 65), height_m: (120, 120))"),
        ("spike", "Shape(kind: Spike, size: (65, 65), cell_m: 30.0, height_m: (0, 8000))"),
        ("cliff", "Shape(kind: Cliff, size: (64, 64), cell_m: 1.0, height_m: (0, 3000))"),
        (
            "checkerboard",
            "Shape(kind: Checkerboard, size: (100, 100), cell_m: 30.0, height_m: (0, 300), period_cells: 8)",
        ),
        ("high", "Shape(kind: Sine, size: (129, 129), cell_m: 0.5, height_m: (8000, 8001), period_cells: 30)"),
    ];
    let scene = |terrain: &str, surface: &str, camera: &str, rows: u32| {
        // a mesh of triangles bounds its distance to triangles only
        let bounded = match surface {
            "Triangles" => {
                ", \"bounded splitting\": [HeightPyramid, Roughness(error: Proven), VertexSplitting(threshold_px: 8, carry_flag: false, \
                 carry_size: false), TriangleSplitting, Rasterize]"
            }
            _ => "",
        };
        format!(
            "Experiment(scene: (terrain: {terrain}, surface: {surface}, camera: {camera}, viewport: (67, 45)), chains: {{ \
             \"cast\": [HeightPyramid, RayCast, Shade], \
             \"grid\": [HeightPyramid, ViewGrid(size: (23, 17)), Project, Rasterize, Shade], \
             \"finer\": [HeightPyramid(max_level: 2), ViewGrid(size: (2, 5)), Project(filter: Bilinear), Rasterize], \
             \"paper\": [HeightPyramid, ViewGrid(size: (23, 17)), AspectImportance(size: (21, 17)), Warp(rounds: 2, uniform_share: 0.1), \
             Project, GridError(threshold_px: 0.5), Rasterize, Compact, RayFill], \
             \"proven\": [HeightPyramid, PlanePyramid, ViewGrid(size: (17, 23)), AspectImportance(size: (5, 8)), Warp, \
             Project(filter: Finest), GridError(rule: Proven, threshold_px: 2), LeadRays, Rasterize, Compact(rows: {rows}), RayFill], \
             \"splitting\": [HeightPyramid, Roughness, VertexSplitting(threshold_px: 5), TriangleSplitting, Rasterize]{bounded} }})"
        )
    };
    let mut cases = Vec::new();
    for (name, terrain) in terrains {
        let orbit = "Orbit(frames: 2, turns: 0.6666666666666666, center: (600, 600, 0), radius_m: 900, height_m: 700, clearance_m: 20)";
        for surface in ["Triangles", "Bilinear"] {
            // one ray a pixel, or one for several
            let rows = if surface == "Triangles" { 3 } else { 1 };
            cases.push((format!("{name} {surface}"), scene(terrain, surface, orbit, rows)));
        }
    }
    let rough = terrains[3].1;
    let views = [
        ("ground", "Still(eye: (1300, 1500, 0), yaw_deg: 30, pitch_deg: 1, clearance_m: 2)"),
        ("down", "Still(eye: (1300, 1500, 3000), pitch_deg: -90)"),
        ("rolled", "Still(eye: (900, 900, 1200), yaw_deg: 200, pitch_deg: -20, roll_deg: 35)"),
        ("far", "Still(eye: (-40000, -30000, 9000), look_at: (1300, 1500, 500))"),
        ("under", "Still(eye: (1300, 1500, -500), yaw_deg: 10, pitch_deg: 30)"),
        ("sky", "Still(eye: (1300, 1500, 2000), pitch_deg: 60)"),
    ];
    for (name, camera) in views {
        cases.push((format!("view {name}"), scene(rough, "Triangles", camera, 1)));
        cases.push((format!("view {name} Bilinear"), scene(rough, "Bilinear", camera, 3)));
    }
    // looked at along gentle slopes, the pixels of a column are near enough for one ray
    let gentle = "Noise(kind: Billow, seed: 5, size: (151, 150), cell_m: 10.0, height_m: (0, 150), wavelength_m: 700)";
    let along = "Still(eye: (700, 50, 0), yaw_deg: 5, pitch_deg: -4, clearance_m: 60)";
    for surface in ["Triangles", "Bilinear"] {
        cases.push((format!("gentle {surface}"), scene(gentle, surface, along, 2)));
    }
    cases
}

fn check_chain(gpu: &Gpu, prepared: &Prepared, case: &str) -> Result<Vec<Outcome>, Diagnostic> {
    let plan = plan_everything(prepared)?;
    let executor = Executor::new(gpu, &plan, &prepared.data)?;
    executor.setup()?;
    let mut outcomes: Vec<Outcome> = Vec::new();
    for (number, camera) in prepared.data.cameras.iter().enumerate() {
        let frame = Frame { data: &prepared.data, camera };
        let mut accumulated = Buffers::of_scene(&prepared.data);
        let mut local = Buffers::of_scene(&prepared.data);
        for (index, (stage, call)) in prepared.stages.iter().zip(&prepared.cell.stages).enumerate() {
            stage.reference(&frame, &mut accumulated);
            stage.reference(&frame, &mut local);
            // read before a later stage makes a buffer of the same name, or changes this one in place
            for id in run_stage(&executor, &plan, index, number)? {
                let buffer = plan.buffer(id);
                let name = &buffer.name;
                if !crate::stages::writes(&call.name).contains(&name.as_str()) || !local.contains(name) {
                    continue;
                }
                let values = read(&executor.read(id)?, buffer);
                let outcome = Outcome {
                    case: case.into(),
                    stage: call.name.clone(),
                    buffer: name.clone(),
                    local: reference::compare(&values.value, &local.get(name), f64::is_nan),
                    accumulated: reference::compare(&values.value, &accumulated.get(name), f64::is_nan),
                };
                // the next stage's reference gets what the GPU's kernel got
                local.put(name, without_gaps(&values, &local.get(name)));
                merge(&mut outcomes, outcome);
            }
        }
    }
    Ok(outcomes)
}

/// Runs the steps of one stage for one frame; the buffers it wrote, now or once.
fn run_stage(executor: &Executor, plan: &Plan, index: usize, frame: usize) -> Result<Vec<BufferId>, Diagnostic> {
    let mut written = Vec::new();
    for (at, step) in plan.steps.iter().enumerate().filter(|(_, step)| step.stage_index == index) {
        if step.often == Often::EveryFrame {
            executor.step(at, frame)?;
        }
        let new: Vec<BufferId> = step.writes.iter().filter(|id| !written.contains(*id)).copied().collect();
        written.extend(new);
    }
    // of several with one name, the last is what the stage leaves
    let is_last =
        |at: usize| written[at + 1..].iter().all(|&later| plan.buffer(later).name != plan.buffer(written[at]).name);
    let left = (0..written.len()).filter(|&at| plan.buffer(written[at]).storage == Storage::Buffer && is_last(at));
    let written: Vec<BufferId> = left.map(|at| written[at]).collect();
    Ok(written)
}

/// GPU values, with nothing where the reference has a gap (a level that is not made): the memory there holds anything.
fn without_gaps(values: &Values, reference: &Values) -> Values {
    let mut values = values.clone();
    let gaps = reference.value.iter().zip(&reference.bound).map(|(value, bound)| value.is_nan() && *bound == 0.0);
    values.value.iter_mut().zip(gaps).filter(|(_, gap)| *gap).for_each(|(value, _)| *value = f64::NAN);
    values
}

/// Frames of a case are one line: the worst of them.
fn merge(outcomes: &mut Vec<Outcome>, outcome: Outcome) {
    let same = outcomes.iter_mut().find(|known| known.stage == outcome.stage && known.buffer == outcome.buffer);
    let Some(known) = same else { return outcomes.push(outcome) };
    for (known, new) in [(&mut known.local, outcome.local), (&mut known.accumulated, outcome.accumulated)] {
        known.compared += new.compared;
        known.undecided += new.undecided;
        known.beyond += new.beyond;
        known.largest = known.largest.max(new.largest);
        known.largest_of_bound = known.largest_of_bound.max(new.largest_of_bound);
    }
}

fn plan_everything(prepared: &Prepared) -> Result<Plan, Diagnostic> {
    let mut chain = Chain::new(&prepared.cell.chain, &prepared.data, &prepared.cell.scene_node.origin);
    for (index, (stage, call)) in prepared.stages.iter().zip(&prepared.cell.stages).enumerate() {
        chain.begin_stage(&call.name, index, &call.node.head());
        stage.plan(&mut chain)?;
    }
    let outputs = chain.made();
    Plan::finish(chain, &Demand { outputs, keep_everything: true })
}

/// A GPU buffer in f64; bytes of a picture apart, NaN where there is no surface.
fn read(bytes: &[u8], buffer: &Buffer) -> Values {
    let is_picture = buffer.unit == crate::stages::RGBA8;
    let value: Vec<f64> = match buffer.elem {
        _ if is_picture => bytes.iter().map(|&byte| byte.into()).collect(),
        _ if buffer.elem.is_float() => {
            bytemuck::pod_collect_to_vec::<u8, f32>(bytes).into_iter().map(f64::from).collect()
        }
        Elem::I32 => bytemuck::pod_collect_to_vec::<u8, i32>(bytes).into_iter().map(f64::from).collect(),
        _ => bytemuck::pod_collect_to_vec::<u8, u32>(bytes).into_iter().map(f64::from).collect(),
    };
    let nothing = |value: f64| if buffer.missing.is_some() && value < 0.0 { f64::NAN } else { value };
    let components = if is_picture { 4 } else { buffer.elem.components() };
    debug_assert!(buffer.storage != Storage::Input);
    Values::exact(&buffer.dims, components, value.into_iter().map(nothing).collect())
}
