//! What is known of a cell when it is done: its record, or why it has none.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::experiment::sweep::Varied;
use crate::gpu::AdapterSummary;
use crate::measure::Measured;
use crate::measure::time::Spread;
use crate::plan::LeftOut;

/// Changes whenever a record would mean something else than before.
pub const FORMAT: u32 = 6;

/// Everything that decides a cell's results: what is carried out, on what, and what is measured. A change in any part makes it another
/// cell, except in how it was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Fingerprint of the plan.
    pub plan: String,
    /// Kernel files of the plan and the hashes of their assembled texts; they are part of the fingerprint.
    pub kernels: Vec<(String, String)>,
    /// The same of the ground truth, if a measure compares with it.
    pub truth: Option<String>,
    pub truth_kernels: Vec<(String, String)>,
    /// Fingerprint of the frames, if a measure looks at them.
    pub frames: Option<String>,
    /// Each measure with its version and all of its parameters.
    pub measures: Vec<String>,
    /// The ground, and each other map that is uploaded, by name.
    pub terrain: String,
    pub inputs: Vec<(String, String)>,
    /// Adapter, backend and driver.
    pub adapter: String,
    pub format: u32,
    /// Stages, scene and measures as they were written. Not part of the hash: what counts is what is carried out.
    pub parameters: String,
}

impl Identity {
    pub fn hash(&self) -> String {
        let Self { plan, truth, frames, measures, terrain, inputs, adapter, format, .. } = self;
        let carried_out = (plan, truth, frames, measures, terrain, inputs, adapter, format);
        // a tuple of strings always serializes
        let text = serde_json::to_string(&carried_out).unwrap_or_default();
        blake3::hash(text.as_bytes()).to_hex().as_str()[..16].to_string()
    }

    /// What differs from the record of an earlier run of the same cell, in the user's words where it was written, else in ours.
    pub(super) fn changes(&self, earlier: &Identity) -> Vec<String> {
        let mut changes = Vec::new();
        let is_other_text = self.parameters != earlier.parameters;
        let kernels = changed_kernels(&self.kernels, &earlier.kernels);
        let truth_kernels = changed_kernels(&self.truth_kernels, &earlier.truth_kernels);
        if self.plan != earlier.plan || self.frames != earlier.frames {
            match (is_other_text, kernels.is_empty()) {
                (true, _) => changes.push("parameters".to_string()),
                (false, true) => changes.push("what lodlab makes of the same parameters".to_string()),
                (false, false) => {}
            }
        }
        changes.extend(kernels.into_iter().map(|name| format!("kernel {name}")));
        if self.truth != earlier.truth {
            let of = |name: String| format!("kernel {name} of the ground truth");
            match truth_kernels.is_empty() {
                true => changes.push("the ground truth".into()),
                false => changes.extend(truth_kernels.into_iter().map(of)),
            }
        }
        let measured = self.measures.iter().filter(|measure| !earlier.measures.contains(measure));
        changes.extend(measured.map(|measure| format!("measure {measure}")));
        if self.measures.len() < earlier.measures.len() {
            changes.push("fewer measures".into());
        }
        if self.terrain != earlier.terrain {
            changes.push("terrain".into());
        }
        let new = self.inputs.iter().filter(|input| !earlier.inputs.contains(input));
        changes.extend(new.map(|(name, _)| format!("input {name}")));
        if self.adapter != earlier.adapter {
            changes.push(format!("adapter (was {})", earlier.adapter));
        }
        if self.format != earlier.format {
            changes.push(format!("format of records (was {})", earlier.format));
        }
        changes
    }
}

/// Files that an earlier run had with another text, or not at all.
fn changed_kernels(kernels: &[(String, String)], earlier: &[(String, String)]) -> Vec<String> {
    let old = |name: &String| earlier.iter().find(|(known, _)| known == name).map(|(_, hash)| hash);
    let changed = kernels.iter().filter(|(name, hash)| old(name) != Some(hash));
    changed.map(|(name, _)| name.clone()).collect()
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KernelTime {
    pub stage: String,
    pub step: String,
    pub once: bool,
    /// The surface as it was drawn last does not depend on it: it is not of the method.
    #[serde(default)]
    pub after_surface: bool,
    /// Milliseconds; `None` is "not measured".
    pub ms: Option<Spread>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timings {
    /// "timestamps" of the GPU, or the "clock" with a submission for each step where those are not to be believed.
    pub kernels_by: String,
    /// GPU time of the method, milliseconds: of a frame that leaves out the steps that the drawn surface does not depend on, such as
    /// those that shade it. `None` without timestamps to believe.
    pub method_gpu_ms: Option<Spread>,
    /// Wall time of the same frame, milliseconds. If there are no such steps, it is that of the whole frame.
    pub method_wall_ms: Option<Spread>,
    /// Time of those steps by themselves, milliseconds in the sum, by the stamps or the clock as that of each kernel.
    pub after_surface_ms: Option<Spread>,
    /// GPU time of a whole frame, milliseconds; `None` without timestamps to believe.
    pub frame_gpu_ms: Option<Spread>,
    /// Wall time of a whole frame, milliseconds.
    pub frame_wall_ms: Option<Spread>,
    /// Share of a frame's wall time outside kernels.
    pub outside_kernels: Option<f64>,
    /// Median of each frame of the path, in the order of the frames: of the method and of whole frames, by the stamps or the clock as
    /// [`Record::method_ms`]. `None` where a frame was not timed.
    pub method_ms_by_frame: Vec<Option<f64>>,
    pub frame_ms_by_frame: Vec<Option<f64>>,
    /// How often the path was timed, and why not more often.
    pub repeats: u32,
    pub ended_by: String,
    /// What runs once a terrain, milliseconds on the wall clock.
    pub once_ms: f64,
    /// Buffers, pipelines, upload.
    pub prepare_ms: f64,
    pub kernels: Vec<KernelTime>,
}

/// What a cell looks at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneSummary {
    /// The same for cells that look at the same ground with the same cameras: only these can be compared.
    pub key: String,
    /// The terrain as it was written.
    pub terrain: String,
    /// Columns and rows of pixels.
    pub viewport: (u32, u32),
    pub frames: usize,
}

/// When a cell was run, and by what.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Made {
    /// Coordinated universal time, as ISO 8601 has it.
    pub date: String,
    /// The version of lodlab.
    pub lodlab: String,
}

impl Made {
    pub fn now() -> Self {
        let date = chrono::Utc::now().to_rfc3339_opts(chrono::SecondsFormat::Millis, true);
        Self { date, lodlab: env!("CARGO_PKG_VERSION").into() }
    }
}

/// Experiment, chain, settings and adapter: a place that a cell can have.
pub type Point<'a> = (&'a str, &'a str, &'a [Varied], &'a str);

/// What a cell is and where it was run: the same for cells with results and for those without.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Head {
    pub hash: String,
    pub experiment: String,
    pub chain: String,
    /// What was swept and what the command line has set, in this order.
    pub settings: Vec<Varied>,
    pub scene: SceneSummary,
    /// The chain that the experiment compares the others with, if it names one.
    #[serde(default)]
    pub baseline: Option<String>,
    pub adapter: AdapterSummary,
    pub made: Made,
    pub identity: Identity,
}

impl Head {
    /// Chain and settings: what the user calls this cell.
    pub fn label(&self) -> String {
        crate::experiment::label(&self.chain, &self.settings)
    }

    /// What tells it from the others of its chain that look at the same scene.
    pub fn label_in_scene(&self) -> String {
        let own: Vec<Varied> = self.settings.iter().filter(|setting| !setting.is_of_scene()).cloned().collect();
        crate::experiment::label("", &own).trim().to_string()
    }

    /// The same place in the same experiment, whatever has changed in what it computes.
    pub fn is_same_point(&self, other: &Head) -> bool {
        self.point() == other.point()
    }

    pub fn point(&self) -> Point<'_> {
        (&self.experiment, &self.chain, &self.settings, &self.identity.adapter)
    }
}

/// One cell's results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    #[serde(flatten)]
    pub head: Head,
    pub measures: Vec<Measured>,
    /// Figures that a measure has of each frame, by their names.
    pub by_frame: BTreeMap<String, Vec<Option<f64>>>,
    /// Pictures of buffers that were asked for: what each shows, and its file.
    #[serde(default)]
    pub looks: Vec<(String, String)>,
    pub timings: Timings,
    /// Bytes of memory the plan asked for.
    pub bytes: u64,
    /// Hash over the contents of each read-back buffer, all frames.
    pub buffers: Vec<(String, String)>,
    pub warnings: Vec<String>,
    pub plan: String,
    pub left_out: Vec<LeftOut>,
}

impl Record {
    /// A figure by name; `method_ms` and `frame_ms` are those of the clock or the stamps.
    pub fn figure(&self, name: &str) -> Option<f64> {
        match name {
            "method_ms" => self.method_ms(),
            "frame_ms" => self.frame_ms(),
            "once_ms" => Some(self.timings.once_ms),
            "prepare_ms" => Some(self.timings.prepare_ms),
            "bytes" => Some(self.bytes as f64),
            _ => self.measure(name),
        }
    }

    pub fn measure(&self, name: &str) -> Option<f64> {
        self.measures.iter().find(|measure| measure.name == name)?.value
    }

    /// GPU time of what makes the drawn surface if it was measured, wall time if not: the time that stands against the error.
    pub fn method(&self) -> Option<&Spread> {
        self.timings.method_gpu_ms.as_ref().or(self.timings.method_wall_ms.as_ref())
    }

    /// GPU time of a whole frame if it was measured, wall time if not.
    pub fn frame(&self) -> Option<&Spread> {
        self.timings.frame_gpu_ms.as_ref().or(self.timings.frame_wall_ms.as_ref())
    }

    pub fn method_ms(&self) -> Option<f64> {
        self.method().map(|spread| spread.median)
    }

    pub fn frame_ms(&self) -> Option<f64> {
        self.frame().map(|spread| spread.median)
    }

    /// What is wrong with what was drawn, by what the measures say of it: a promise that was broken, holes.
    pub fn faults(&self) -> Vec<String> {
        crate::measure::faults(&self.measures)
    }

    pub fn label(&self) -> String {
        self.head.label()
    }
}

/// A cell without results: it is more than the adapter can do, or something went wrong while it ran.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    #[serde(flatten)]
    pub head: Head,
    /// What it needs and what the adapter has, or what went wrong.
    pub why: String,
    pub help: Option<String>,
    /// Nothing was tried, since it is more than the adapter can do.
    pub does_not_fit: bool,
}

/// Another name of a finished cell: one that computes the same shares its record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Name {
    pub hash: String,
    pub experiment: String,
    pub chain: String,
    pub settings: Vec<Varied>,
    /// When the cell was last found to have this record, as [`Made::date`].
    pub date: String,
}

/// What came of the cells of one or several runs.
#[derive(Clone, Debug, Default)]
pub struct Results {
    pub records: Vec<Record>,
    pub failures: Vec<Failure>,
}

impl Results {
    pub fn heads(&self) -> impl Iterator<Item = &Head> {
        self.records.iter().map(|record| &record.head).chain(self.failures.iter().map(|failure| &failure.head))
    }
}
