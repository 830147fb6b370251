//! A run: experiments to cells, cells to records, records to reports. Finished cells are not run again.

mod cell;
pub mod dump;
mod job;
mod overflow;
mod own_buffers;
mod setup;
pub mod sight;
mod sweep;
mod timings;
mod truth;
pub mod walk;
mod warnings;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::regular;
use crate::experiment::sweep::Setting;
use crate::gpu::{Gpu, GpuError};
use crate::report::equal::Answer;
use crate::report::records::{Identity, Results};
use crate::report::{self, Store, Wanted};
use sweep::Sweep;

pub use overflow::Overflow;

pub use job::{Job, jobs};
pub use setup::{Keep, Prepared, Scenes, Setup, Tap, Tapped, plan, prepare, prepare_each, prepare_some};
pub use truth::{Truth, in_f64 as truth_in_f64, plan as truth_plan};

#[derive(Clone, Debug, Default)]
pub struct Options {
    /// `--set` arguments.
    pub settings: Vec<Setting>,
    pub adapter: Option<String>,
    /// Buffers to write as `.npy`, every frame.
    pub dump: Vec<String>,
    /// Buffers whose looks go into the page, as dumps are named; of the frame in the middle, or of every one.
    pub pictures: Vec<String>,
    pub every_frame: bool,
    /// Stages whose f64 result takes the place of what their kernels make.
    pub on_cpu: Vec<String>,
    /// Run finished cells again.
    pub force: bool,
    /// Keep the pictures of every cell, also in a large sweep.
    pub all_pictures: bool,
    /// Leave nothing out.
    pub keep_everything: bool,
    /// The chain that tables compare the others with, instead of the one that the experiment names.
    pub baseline: Option<String>,
    /// Only some cells of the experiment are run, and others in other processes: reports are made of all, later.
    pub is_part: bool,
    /// Ends the run after the frame that is being drawn.
    pub stop: Stop,
}

/// Somebody's wish that a run ends; whoever runs looks at it between frames.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    pub fn wish(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    pub fn is_wanted(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// What happens while a run goes on, for whoever shows it.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// So many cells have been planned, to see whether they are in order.
    Planned {
        cells: usize,
        of: usize,
    },
    /// Cells in all, and how many of them are finished from before.
    Started {
        cells: usize,
        finished: usize,
    },
    CellStarted {
        label: String,
        chain: String,
        reason: String,
    },
    Frame {
        done: usize,
        of: usize,
    },
    CellDone {
        label: String,
        chain: String,
        frame_ms: Option<f64>,
        error_rms_px: Option<f64>,
    },
    /// The cell has no record: it is more than the adapter can do, or something went wrong while it ran.
    CellFailed {
        label: String,
        why: String,
        does_not_fit: bool,
    },
    /// Another process has run the cell meanwhile.
    CellIsDone {
        label: String,
    },
    /// The cell computes what another one has computed.
    CellIsTheSame {
        label: String,
    },
    Warning {
        text: String,
    },
    /// What somebody who watches may want to know.
    Note {
        text: String,
    },
}

/// What a run left behind.
#[derive(Debug)]
pub struct Outcome {
    /// Of all cells of the experiment that are finished or have failed, in the order of the file.
    pub results: Results,
    /// The tables at equal error and equal time.
    pub answers: Vec<Answer>,
    pub folder: PathBuf,
    pub ran: usize,
    /// Cells that were finished before.
    pub finished: usize,
    /// Somebody has ended it.
    pub is_stopped: bool,
}

/// Runs the cells of an experiment into a folder. What was computed stays, also if a later cell fails. (Whoever has prepared the cells to
/// see whether they are in order has their terrains in memory, and reading one can take long.)
pub fn run(
    title: &str,
    prepared: Vec<Prepared>,
    gpu: &Arc<Gpu>,
    folder: &Path,
    options: &Options,
    tell: &dyn Fn(Event),
) -> Result<Outcome, Diagnostic> {
    let jobs = jobs(prepared, options)?;
    carry_out(title, jobs, gpu, folder, options, tell)
}

/// Runs jobs into a folder.
pub fn carry_out(
    title: &str,
    jobs: Vec<Job>,
    gpu: &Arc<Gpu>,
    folder: &Path,
    options: &Options,
    tell: &dyn Fn(Event),
) -> Result<Outcome, Diagnostic> {
    // every cell is planned before the first one runs, so that a mistake shows at once; the plans are made again when they are needed
    let Checked { identities, misfits } = checked(&jobs, gpu, options, tell)?;
    let store = Store::open(folder)?;
    for (path, why) in &store.refused {
        let text = format!("`{}` {why}, so its cell counts as not run", path.display());
        tell(Event::Warning { text });
    }
    let is_finished = |identity: &Identity| store.finished(&identity.hash()).is_some();
    let runs_anyway = options.force || !options.dump.is_empty() || !options.pictures.is_empty();
    let must_run: Vec<bool> = identities.iter().map(|identity| runs_anyway || !is_finished(identity)).collect();
    let finished = must_run.iter().filter(|must| !**must).count();
    tell(Event::Started { cells: jobs.len(), finished });
    let sweep = Sweep::new(title, gpu, &store, options, tell, &identities);
    let result = sweep.run(&jobs, must_run, &misfits);
    // reports are made of what there is, also after a failure
    let results = sweep.results(&jobs)?;
    let ran = sweep.ran();
    let mut answers = Vec::new();
    // without any result of this run, those of an earlier one stay
    if !options.is_part && (!results.records.is_empty() || results.failures.is_empty()) {
        let put = |name: &str, bytes: Option<&[u8]>| match bytes {
            Some(bytes) => store.write(name, bytes),
            None => {
                store.remove(name);
                Ok(())
            }
        };
        let picture = |name: &str| regular::read(&folder.join(name)).ok();
        answers = report::write(&results, &Wanted::new(title, options.baseline.as_deref()), &put, &picture)?;
    }
    let is_stopped = result? == sweep::End::Stopped;
    if !is_stopped {
        let failed: BTreeSet<&str> = results.failures.iter().map(|failure| failure.head.hash.as_str()).collect();
        let hashes = identities.iter().map(Identity::hash);
        store.check_complete(hashes.filter(|hash| !failed.contains(hash.as_str())))?;
    }
    Ok(Outcome { results, answers, folder: folder.to_path_buf(), ran, finished, is_stopped })
}

/// What is known of the jobs before the first one runs.
struct Checked {
    identities: Vec<Identity>,
    /// Those that do not fit the adapter, and why.
    misfits: Vec<(usize, GpuError)>,
}

/// The identities of all jobs and which of them do not fit, or the first thing that is wrong with one.
fn checked(jobs: &[Job], gpu: &Gpu, options: &Options, tell: &dyn Fn(Event)) -> Result<Checked, Diagnostic> {
    let mut hashes = job::InputHashes::default();
    let looked_at = options.dump.iter().chain(&options.pictures);
    let mut absent: Vec<(&String, Option<Diagnostic>)> = looked_at.map(|name| (name, None)).collect();
    let (mut identities, mut misfits) = (Vec::new(), Vec::new());
    let mut idle = warnings::Idle::default();
    for (at, job) in jobs.iter().enumerate() {
        tell(Event::Planned { cells: at, of: jobs.len() });
        let plan = job.plan()?;
        idle.look(&job.prepared.cell, &plan);
        absent.retain_mut(|(name, why)| match plan.find(name) {
            Ok(_) => false,
            Err(error) => {
                why.get_or_insert(error);
                true
            }
        });
        let fits =
            gpu.check_plan(&plan).and_then(|()| job.truth.as_ref().map_or(Ok(()), |truth| gpu.check_plan(truth)));
        misfits.extend(fits.err().map(|why| (at, why)));
        identities.push(job.identity(&plan, &mut hashes, gpu));
    }
    for name in &options.on_cpu {
        let has = |job: &Job| !walk::find_stages(&job.prepared.cell, std::slice::from_ref(name)).is_empty();
        if !jobs.iter().any(has) && !options.is_part {
            let stages = jobs.iter().flat_map(|job| job.prepared.cell.stages.iter().map(|call| call.name.as_str()));
            return Err(Diagnostic::input(format!("there is no cell with a stage `{name}`"))
                .suggest(name, stages.collect::<BTreeSet<_>>()));
        }
    }
    let cells = jobs.iter().map(|job| &job.prepared.cell).zip(&identities);
    idle.told().into_iter().chain(warnings::axes(cells)).for_each(|text| tell(Event::Warning { text }));
    match absent.into_iter().next().filter(|_| !options.is_part) {
        Some((name, why)) => Err(why.unwrap_or_else(|| nothing_to_dump(name))),
        None => Ok(Checked { identities, misfits }),
    }
}

fn nothing_to_dump(name: &str) -> Diagnostic {
    Diagnostic::input(format!("there is no cell that could have a buffer `{name}`"))
}
