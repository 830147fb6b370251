//! One record a cell, written when the cell is done and never half.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::regular;
use crate::gpu::AdapterSummary;
use crate::measure::Measured;
use crate::measure::time::Spread;
use crate::plan::LeftOut;

/// Changes whenever a record would mean something else than before.
pub const FORMAT: u32 = 5;

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
    fn changes(&self, earlier: &Identity) -> Vec<String> {
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
    /// What runs once a terrain, milliseconds on the wall clock.
    pub once_ms: f64,
    /// Buffers, pipelines, upload.
    pub prepare_ms: f64,
    pub kernels: Vec<KernelTime>,
}

/// One cell's results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    pub hash: String,
    pub experiment: String,
    pub chain: String,
    /// Swept paths and their values.
    pub settings: Vec<(String, String)>,
    pub measures: Vec<Measured>,
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
    pub adapter: AdapterSummary,
    pub identity: Identity,
}

impl Record {
    /// A figure by name; `method_ms` and `frame_ms` are those of the clock or the stamps.
    pub fn figure(&self, name: &str) -> Option<f64> {
        match name {
            "method_ms" => self.method_ms(),
            "frame_ms" => self.frame_ms(),
            _ => self.measure(name),
        }
    }

    pub fn measure(&self, name: &str) -> Option<f64> {
        self.measures.iter().find(|measure| measure.name == name)?.value
    }

    /// GPU time of what makes the drawn surface if it was measured, wall time if not: the time that stands against the error.
    pub fn method_ms(&self) -> Option<f64> {
        self.timings.method_gpu_ms.as_ref().or(self.timings.method_wall_ms.as_ref()).map(|spread| spread.median)
    }

    /// GPU time of a whole frame if it was measured, wall time if not.
    pub fn frame_ms(&self) -> Option<f64> {
        self.timings.frame_gpu_ms.as_ref().or(self.timings.frame_wall_ms.as_ref()).map(|spread| spread.median)
    }

    /// Chain and settings: what the user calls this cell.
    pub fn label(&self) -> String {
        crate::experiment::label(&self.chain, &self.settings)
    }

    fn is_same_point(&self, chain: &str, settings: &[(String, String)]) -> bool {
        self.chain == chain && self.settings == settings
    }
}

/// A cell without results, because it is more than the adapter can do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Misfit {
    pub chain: String,
    /// Swept paths and their values.
    pub settings: Vec<(String, String)>,
    /// What it needs, and what the adapter has.
    pub why: String,
    pub help: Option<String>,
}

impl Misfit {
    /// Chain and settings: what the user calls this cell.
    pub fn label(&self) -> String {
        crate::experiment::label(&self.chain, &self.settings)
    }
}

/// The folder a run leaves its results in.
pub struct Store {
    pub folder: PathBuf,
    earlier: BTreeMap<String, Record>,
    /// Files in the place of records that are not taken for one, and why.
    pub refused: Vec<(PathBuf, &'static str)>,
    /// Names of the files that were written and have to be there in the end.
    written: RefCell<BTreeSet<String>>,
}

/// Letters of the digest that a record's file begins with.
const DIGEST_LENGTH: usize = 32;

fn digest(rest: &str) -> String {
    blake3::hash(rest.as_bytes()).to_hex().as_str()[..DIGEST_LENGTH].to_string()
}

/// The text of a record's file: its first field is the digest of all that follows, so that what somebody changes later is seen.
fn seal(record: &Record) -> Result<String, serde_json::Error> {
    let text = serde_json::to_string_pretty(record)?;
    let rest = text.strip_prefix('{').unwrap_or(&text);
    Ok(format!("{SEAL_START}{}{SEAL_END}{rest}", digest(rest)))
}

const SEAL_START: &str = "{\n  \"digest\": \"";
const SEAL_END: &str = "\",";

/// The record in a file, if it is the one that was written under this name.
fn unseal(path: &Path) -> Result<Record, &'static str> {
    let no_record = "is no record of this version";
    let text = regular::read_to_string(path).map_err(|_| "cannot be read as a file")?;
    let record: Record = serde_json::from_str(&text).map_err(|_| no_record)?;
    let sealed =
        text.strip_prefix(SEAL_START).and_then(|text| text.split_at_checked(DIGEST_LENGTH)).ok_or(no_record)?;
    let rest = sealed.1.strip_prefix(SEAL_END).ok_or(no_record)?;
    let is_its_own = path.file_stem().is_some_and(|stem| stem == record.hash.as_str());
    if digest(rest) != sealed.0 || !is_its_own || record.identity.hash() != record.hash {
        return Err("is not what was written there");
    }
    Ok(record)
}

impl Store {
    pub fn open(folder: &Path) -> Result<Self, Diagnostic> {
        let cells = folder.join("cells");
        fs::create_dir_all(&cells).map_err(|error| cannot_write(folder, &error))?;
        // found out now, not after the first cell's minutes
        tempfile::NamedTempFile::new_in(&cells).map_err(|error| cannot_write(folder, &error))?;
        Self::look(folder)
    }

    /// The results that are there, to be looked at.
    pub fn look(folder: &Path) -> Result<Self, Diagnostic> {
        let (mut earlier, mut refused) = (BTreeMap::new(), Vec::new());
        let entries = fs::read_dir(folder.join("cells"))
            .map_err(|error| Diagnostic::input(format!("`{}` is no folder of results: {error}", folder.display())))?;
        for entry in entries.flatten().filter(|entry| entry.path().extension().is_some_and(|kind| kind == "json")) {
            match unseal(&entry.path()) {
                Ok(record) => {
                    earlier.insert(record.hash.clone(), record);
                }
                // it is not a finished cell: it is run again and written anew
                Err(why) => refused.push((entry.path(), why)),
            }
        }
        refused.sort();
        Ok(Self { folder: folder.to_path_buf(), earlier, refused, written: RefCell::default() })
    }

    /// All records, chain by chain.
    pub fn all(&self) -> Vec<&Record> {
        let mut all: Vec<&Record> = self.earlier.values().collect();
        all.sort_by_key(|record| (record.chain.clone(), record.settings.clone()));
        all
    }

    pub fn finished(&self, hash: &str) -> Option<&Record> {
        self.earlier.get(hash)
    }

    /// Why a cell that is not finished has to run.
    pub fn reason(&self, chain: &str, settings: &[(String, String)], identity: &Identity) -> String {
        let same = self.earlier.values().filter(|record| record.is_same_point(chain, settings));
        let closest = same.map(|record| identity.changes(&record.identity)).min_by_key(Vec::len);
        match closest {
            None => "new".into(),
            Some(changes) if changes.is_empty() => "forced".into(),
            Some(changes) => format!("changed: {}", changes.join(", ")),
        }
    }

    /// The record of a cell as it is on disk now; `None` if the cell is not finished.
    pub fn read(&self, hash: &str) -> Option<Record> {
        unseal(&self.folder.join(cell_name(hash))).ok()
    }

    /// Looks whether all that was written is there, and the records of these cells, of which some were finished before.
    pub fn check_complete(&self, cells: impl Iterator<Item = String>) -> Result<(), Diagnostic> {
        let mut names = self.written.borrow().clone();
        let lost = cells.filter(|hash| self.read(hash).is_none()).map(|hash| cell_name(&hash));
        let lost: BTreeSet<String> = lost.collect();
        let is_missing = |name: &&str| lost.contains(*name) || !self.folder.join(name).is_file();
        names.extend(lost.iter().cloned());
        let missing: Vec<&str> = names.iter().map(String::as_str).filter(is_missing).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let shown = missing.iter().take(MOST_NAMED).copied().collect::<Vec<_>>().join(", ");
        let more = missing.len().saturating_sub(MOST_NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        Err(Diagnostic::run(format!(
            "{} files of this run are gone from `{}` or were changed: {shown}{more}",
            missing.len(),
            self.folder.display()
        ))
        .help("something moved them while it ran: run it again, with --force if pictures are among them"))
    }

    pub fn save(&self, record: &Record) -> Result<(), Diagnostic> {
        let text = seal(record).map_err(|error| Diagnostic::run(format!("a record cannot be written: {error}")))?;
        self.write(&cell_name(&record.hash), text.as_bytes())
    }

    /// Removes a file of an earlier run that would not be true any more.
    pub fn remove(&self, name: &str) {
        self.written.borrow_mut().remove(name);
        // most often it is not there
        let _ = fs::remove_file(self.folder.join(name));
    }

    /// Writes a file under the folder in one step: it is there whole or not at all.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), Diagnostic> {
        let path = self.folder.join(name);
        let folder = path.parent().unwrap_or(&self.folder);
        let written = fs::create_dir_all(folder).and_then(|()| shared_file(folder)).and_then(|mut file| {
            file.write_all(bytes)?;
            file.as_file().sync_all()?;
            file.persist(&path).map_err(|error| error.error)
        });
        written.map_err(|error| cannot_write(&path, &error))?;
        self.written.borrow_mut().insert(name.to_string());
        Ok(())
    }
}

/// Missing files that a message names.
const MOST_NAMED: usize = 5;

fn cell_name(hash: &str) -> String {
    format!("cells/{hash}.json")
}

/// A temporary file that, once it has its name, others can read as they can any other file.
fn shared_file(folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

fn cannot_write(path: &Path, error: &std::io::Error) -> Diagnostic {
    Diagnostic::run(format!("cannot write `{}`: {error}", path.display())).help("choose another folder with --out")
}

/// One line a record, one column a measure; times in milliseconds.
pub fn csv(records: &[Record]) -> Result<Vec<u8>, csv::Error> {
    let mut names: Vec<&str> = Vec::new();
    let mut paths: Vec<&str> = Vec::new();
    for record in records {
        names.extend(record.measures.iter().map(|measure| measure.name.as_str()));
        paths.extend(record.settings.iter().map(|(path, _)| path.as_str()));
    }
    let (names, paths) = (in_order(names), in_order(paths));
    let mut writer = csv::Writer::from_writer(Vec::new());
    let fixed = ["cell", "experiment", "chain"];
    let times = [
        "method_gpu_ms",
        "method_gpu_ms_q1",
        "method_gpu_ms_q3",
        "method_wall_ms",
        "method_wall_ms_q1",
        "method_wall_ms_q3",
        "after_surface_ms",
        "frame_gpu_ms",
        "frame_gpu_ms_q1",
        "frame_gpu_ms_q3",
        "frame_wall_ms",
        "samples",
        "once_ms",
        "bytes",
        "adapter",
    ];
    writer.write_record(fixed.iter().chain(&paths).chain(&names).chain(&times))?;
    for record in records {
        let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        let mut row = vec![record.hash.clone(), record.experiment.clone(), record.chain.clone()];
        let setting = |path: &&str| {
            record.settings.iter().find(|(known, _)| known == path).map_or(String::new(), |(_, value)| value.clone())
        };
        row.extend(paths.iter().map(setting));
        row.extend(names.iter().map(|name| number(record.measure(name))));
        let spread = |spread: Option<&Spread>| {
            let parts: [fn(&Spread) -> f64; 3] = [|s| s.median, |s| s.lower_quartile, |s| s.upper_quartile];
            parts.map(|part| number(spread.map(part)))
        };
        let gpu = record.timings.frame_gpu_ms.as_ref();
        let wall = record.timings.frame_wall_ms.as_ref();
        row.extend(spread(record.timings.method_gpu_ms.as_ref()));
        row.extend(spread(record.timings.method_wall_ms.as_ref()));
        row.push(number(record.timings.after_surface_ms.as_ref().map(|spread| spread.median)));
        row.extend(spread(gpu));
        row.extend([
            number(wall.map(|spread| spread.median)),
            number(wall.map(|spread| spread.samples as f64)),
            record.timings.once_ms.to_string(),
            record.bytes.to_string(),
            record.adapter.name.clone(),
        ]);
        writer.write_record(row)?;
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

fn in_order(names: Vec<&str>) -> Vec<&str> {
    let mut seen = Vec::new();
    for name in names {
        if !seen.contains(&name) {
            seen.push(name);
        }
    }
    seen
}
