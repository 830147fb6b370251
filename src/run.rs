//! A run: experiments to cells, cells to records, records to reports. Finished cells are not run again.

mod cell;
pub mod dump;
mod job;
mod overflow;
mod reports;
mod setup;
pub mod sight;
mod timings;
mod truth;
pub mod walk;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::sweep::Setting;
use crate::gpu::{Gpu, GpuError};
use crate::plan::{Capacities, Plan};
use crate::report::records::{Identity, Misfit, Record, Store};

pub use overflow::Overflow;

pub use job::{Job, jobs};
pub use setup::{Keep, Prepared, Scenes, Setup, Tap, Tapped, plan, prepare, prepare_each};
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
    /// Leave nothing out.
    pub keep_everything: bool,
}

/// What happens while a run goes on, for whoever shows it.
#[derive(Clone, Debug)]
pub enum Event {
    /// Cells in all, and how many of them are finished from before.
    Started {
        cells: usize,
        finished: usize,
    },
    CellStarted {
        label: String,
        reason: String,
    },
    Frame {
        done: usize,
        of: usize,
    },
    CellDone {
        label: String,
        frame_ms: Option<f64>,
    },
    /// The cell is more than the adapter can do.
    CellDoesNotFit {
        label: String,
        why: String,
    },
    /// The cell computes what another one of this run has computed.
    CellIsTheSame {
        label: String,
    },
    Warning(String),
}

/// What a run left behind.
#[derive(Debug)]
pub struct Outcome {
    pub records: Vec<Record>,
    pub folder: PathBuf,
    pub ran: usize,
    /// Cells that were finished before.
    pub finished: usize,
    /// Cells that did not run, because they are more than the adapter can do.
    pub misfits: Vec<Misfit>,
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
    let Checked { identities, misfits } = checked(&jobs, gpu, options)?;
    let store = Store::open(folder)?;
    for (path, why) in &store.refused {
        tell(Event::Warning(format!("`{}` {why}, so its cell counts as not run", path.display())));
    }
    let is_finished = |identity: &Identity| store.finished(&identity.hash()).is_some();
    let runs_anyway = options.force || !options.dump.is_empty() || !options.pictures.is_empty();
    let mut must_run: Vec<bool> = identities.iter().map(|identity| runs_anyway || !is_finished(identity)).collect();
    let finished = must_run.iter().filter(|must| !**must).count();
    tell(Event::Started { cells: jobs.len(), finished });
    let (ran, unfit) = Default::default();
    let sweep = Sweep { title, gpu, store: &store, options, tell, identities: &identities, ran, unfit };
    for (at, why) in misfits {
        if std::mem::take(&mut must_run[at]) {
            sweep.leave_out(&jobs[at], at, &why);
        }
    }
    let result = sweep.run(&jobs, &must_run);
    // reports are made of what there is, also after a failure
    let records = sweep.records(&jobs);
    let Sweep { ran, unfit, .. } = sweep;
    let (ran, unfit) = (ran.into_inner().len(), unfit.into_inner());
    // without any result of this run, those of an earlier one stay
    if !records.is_empty() || unfit.is_empty() {
        reports::write(title, &store, &records)?;
    }
    let misfits: Vec<Misfit> = unfit.values().cloned().collect();
    reports::write_misfits(&store, &misfits)?;
    result?;
    let is_there = |at: &usize| !unfit.contains_key(at);
    store.check_complete((0..jobs.len()).filter(is_there).map(|at| identities[at].hash()))?;
    Ok(Outcome { records, folder: folder.to_path_buf(), ran, finished, misfits })
}

/// What is known of the jobs before the first one runs.
struct Checked {
    identities: Vec<Identity>,
    /// Those that do not fit the adapter, and why.
    misfits: Vec<(usize, GpuError)>,
}

/// The identities of all jobs and which of them do not fit, or the first thing that is wrong with one.
fn checked(jobs: &[Job], gpu: &Gpu, options: &Options) -> Result<Checked, Diagnostic> {
    let mut hashes = job::InputHashes::default();
    let looked_at = options.dump.iter().chain(&options.pictures);
    let mut absent: Vec<(&String, Option<Diagnostic>)> = looked_at.map(|name| (name, None)).collect();
    let (mut identities, mut misfits) = (Vec::new(), Vec::new());
    for (at, job) in jobs.iter().enumerate() {
        let plan = job.plan()?;
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
        if !jobs.iter().any(has) {
            let stages = jobs.iter().flat_map(|job| job.prepared.cell.stages.iter().map(|call| call.name.as_str()));
            return Err(Diagnostic::input(format!("there is no cell with a stage `{name}`"))
                .suggest(name, stages.collect::<BTreeSet<_>>()));
        }
    }
    match absent.into_iter().next() {
        Some((name, why)) => Err(why.unwrap_or_else(|| nothing_to_dump(name))),
        None => Ok(Checked { identities, misfits }),
    }
}

fn nothing_to_dump(name: &str) -> Diagnostic {
    Diagnostic::input(format!("there is no cell that could have a buffer `{name}`"))
}

struct Sweep<'a> {
    title: &'a str,
    gpu: &'a Arc<Gpu>,
    store: &'a Store,
    options: &'a Options,
    tell: &'a dyn Fn(Event),
    identities: &'a [Identity],
    /// Hashes of the cells that this run has run.
    ran: RefCell<BTreeSet<String>>,
    /// Jobs that do not fit the adapter, by their place.
    unfit: RefCell<BTreeMap<usize, Misfit>>,
}

impl Sweep<'_> {
    /// Cells that look at the same frames run one after the other and share their ground truth.
    fn run(&self, jobs: &[Job], must_run: &[bool]) -> Result<(), Diagnostic> {
        let mut done = vec![false; jobs.len()];
        for first in 0..jobs.len() {
            if done[first] || !must_run[first] {
                continue;
            }
            let job = &jobs[first];
            if let Some(why) = job.truth.as_ref().and_then(|_| truth::in_f64(&job.prepared.data)) {
                (self.tell)(Event::Warning(why));
            }
            let mut truth = job.truth.as_ref().map(|plan| Truth::new(self.gpu, plan, &job.prepared)).transpose()?;
            for at in (first..jobs.len()).filter(|&at| must_run[at]) {
                if at == first || job.shares_truth(&jobs[at]) {
                    self.run_cell(&jobs[at], at, truth.as_mut())?;
                    done[at] = true;
                }
            }
        }
        Ok(())
    }

    fn run_cell(&self, job: &Job, at: usize, truth: Option<&mut Truth>) -> Result<(), Diagnostic> {
        let identity = &self.identities[at];
        let hash = identity.hash();
        let cell = &job.prepared.cell;
        let label = cell.label();
        if self.ran.borrow().contains(&hash) {
            (self.tell)(Event::CellIsTheSame { label });
            return Ok(());
        }
        let reason = match self.store.finished(&hash) {
            Some(_) if !self.options.dump.is_empty() => "dump asked for".into(),
            Some(_) if !self.options.pictures.is_empty() => "picture asked for".into(),
            Some(_) => "forced".into(),
            None => self.store.reason(&cell.chain, &cell.settings, identity),
        };
        (self.tell)(Event::CellStarted { label: label.clone(), reason });
        let record = match self.measured(job, identity, truth)? {
            Ok(record) => record,
            Err(why) => {
                self.leave_out(job, at, &why);
                return Ok(());
            }
        };
        self.store.save(&record)?;
        self.ran.borrow_mut().insert(hash);
        (self.tell)(Event::CellDone { label, frame_ms: record.frame_ms() });
        Ok(())
    }

    /// Notes a cell that the adapter cannot carry out; the others run.
    fn leave_out(&self, job: &Job, at: usize, why: &GpuError) {
        let cell = &job.prepared.cell;
        let why = Diagnostic::from(why.clone());
        let misfit =
            Misfit { chain: cell.chain.clone(), settings: cell.settings.clone(), why: why.message, help: why.help };
        (self.tell)(Event::CellDoesNotFit { label: cell.label(), why: misfit.why.clone() });
        self.unfit.borrow_mut().insert(at, misfit);
    }

    /// Runs a cell until its lists are long enough, or too long for the adapter.
    fn measured(
        &self,
        job: &Job,
        identity: &Identity,
        mut truth: Option<&mut Truth>,
    ) -> Result<Result<Record, GpuError>, Diagnostic> {
        let hash = identity.hash();
        let mut capacities = Capacities::new();
        let mut longer: Option<Job> = None;
        loop {
            let job = longer.as_ref().unwrap_or(job);
            let Sweep { gpu, store, options, tell, .. } = *self;
            let plan = &job.plan()?;
            let context = cell::Context { gpu, job, plan, store, hash: &hash, options, tell };
            match cell::run(&context, truth.as_deref_mut())? {
                cell::Ended::Done(results) => return Ok(Ok(self.record(job, plan, identity, *results))),
                cell::Ended::Overflowed(Overflow { list, capacity, needed }) => {
                    let larger = needed.saturating_add(needed / 4);
                    tell(Event::Warning(format!(
                        "the list `{list}` holds {capacity} elements and needed {needed}: again with {larger}"
                    )));
                    capacities.insert(list, larger);
                    let plan = job.prepared.plan(options, &capacities)?;
                    if let Err(why) = gpu.check_plan(&plan) {
                        return Ok(Err(why));
                    }
                    longer = Some(job.with_plan(plan));
                }
            }
        }
    }

    fn record(&self, job: &Job, plan: &Plan, identity: &Identity, results: cell::Results) -> Record {
        for warning in &results.warnings {
            (self.tell)(Event::Warning(warning.clone()));
        }
        let cell = &job.prepared.cell;
        Record {
            hash: identity.hash(),
            experiment: self.title.into(),
            chain: cell.chain.clone(),
            settings: cell.settings.clone(),
            measures: results.measures,
            looks: results.looks,
            timings: results.timings,
            bytes: plan.bytes(),
            buffers: results.buffers,
            warnings: results.warnings,
            plan: crate::plan::explain(plan),
            left_out: plan.left_out.clone(),
            adapter: self.gpu.summary.clone(),
            identity: identity.clone(),
        }
    }

    /// The records of all finished cells, in the order of the file and under its names: an earlier run, or another cell that computes the
    /// same, may have called it something else.
    fn records(&self, jobs: &[Job]) -> Vec<Record> {
        let mut records = Vec::new();
        for (identity, job) in self.identities.iter().zip(jobs) {
            let Some(record) = self.store.read(&identity.hash()) else { continue };
            let (chain, settings) = (job.prepared.cell.chain.clone(), job.prepared.cell.settings.clone());
            records.push(Record { experiment: self.title.into(), chain, settings, ..record });
        }
        records
    }
}
