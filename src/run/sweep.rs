//! The cells of a sweep, one after the other: in which order, what becomes of those that fail, and their records.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::cell::{self, Ended};
use super::overflow::Overflow;
use super::{Event, Job, Options, Truth, own_buffers, truth};
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::{Gpu, GpuError};
use crate::measure::Picture;
use crate::plan::{Capacities, Plan};
use crate::report::page::{PICTURES, picture_name};
use crate::report::records::{Failure, Head, Identity, Made, Name, Record, Results};
use crate::report::{Store, pictures};

/// Why a sweep is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    Done,
    /// Somebody has asked for the end.
    Stopped,
}

pub struct Sweep<'a> {
    title: &'a str,
    gpu: &'a Arc<Gpu>,
    store: &'a Store,
    options: &'a Options,
    tell: &'a dyn Fn(Event),
    identities: &'a [Identity],
    /// Hashes of the cells that this run has run.
    ran: RefCell<BTreeSet<String>>,
    /// Jobs without results, by their place.
    failed: RefCell<BTreeMap<usize, Failure>>,
    /// By scene: cells that are finished. In a large sweep a cell that one of them beats gets no picture, and those that it beats lose theirs.
    fronts: RefCell<BTreeMap<String, Vec<OnFront>>>,
}

/// A cell that can be on the front.
struct OnFront {
    hash: String,
    cost: f64,
    error: f64,
}

/// In a sweep of more cells only those on the front have pictures, unless all are asked for.
const MOST_PICTURED: usize = 200;

/// What came of one cell.
enum Measured {
    Done(Box<Record>, Vec<Picture>),
    DoesNotFit(GpuError),
    Stopped,
}

impl<'a> Sweep<'a> {
    pub fn new(
        title: &'a str,
        gpu: &'a Arc<Gpu>,
        store: &'a Store,
        options: &'a Options,
        tell: &'a dyn Fn(Event),
        identities: &'a [Identity],
    ) -> Self {
        let mut fronts: BTreeMap<String, Vec<OnFront>> = BTreeMap::new();
        for record in store.all().into_iter().filter(|record| record.faults().is_empty()) {
            if let Some((cost, error)) = record.method_ms().zip(record.measure("error_rms")) {
                let hash = record.head.hash.clone();
                fronts.entry(record.head.scene.key.clone()).or_default().push(OnFront { hash, cost, error });
            }
        }
        let (ran, failed, fronts) = (RefCell::default(), RefCell::default(), RefCell::new(fronts));
        Self { title, gpu, store, options, tell, identities, ran, failed, fronts }
    }

    /// How many cells were run.
    pub fn ran(&self) -> usize {
        self.ran.borrow().len()
    }

    /// Runs the jobs that must run and that fit; those that another process has begun come last, if it has not finished them by then.
    pub fn run(&self, jobs: &[Job], mut must_run: Vec<bool>, misfits: &[(usize, GpuError)]) -> Result<End, Diagnostic> {
        for (at, why) in misfits {
            if std::mem::take(&mut must_run[*at]) {
                self.does_not_fit(&jobs[*at], *at, why)?;
            }
        }
        let others = RefCell::new(vec![false; jobs.len()]);
        let is_mine = |at: usize| {
            let is_claimed = self.store.is_claimed(&self.identities[at].hash());
            others.borrow_mut()[at] = is_claimed;
            !is_claimed
        };
        match self.pass(jobs, &must_run, &is_mine)? {
            End::Stopped => Ok(End::Stopped),
            End::Done => self.pass(jobs, &others.into_inner(), &|_| true),
        }
    }

    /// Cells that look at the same frames run one after the other and share their ground truth.
    fn pass(&self, jobs: &[Job], wanted: &[bool], is_mine: &dyn Fn(usize) -> bool) -> Result<End, Diagnostic> {
        let mut done = vec![false; jobs.len()];
        for first in 0..jobs.len() {
            if done[first] || !wanted[first] {
                continue;
            }
            let job = &jobs[first];
            if let Some(text) = job.truth.as_ref().and_then(|_| truth::in_f64(&job.prepared.data)) {
                (self.tell)(Event::Warning { text });
            }
            let mut truth = job.truth.as_ref().map(|plan| Truth::new(self.gpu, plan, &job.prepared)).transpose()?;
            let is_with_first = |at: &usize| wanted[*at] && (*at == first || job.goes_with(&jobs[*at]));
            for at in interleaved(jobs, (first..jobs.len()).filter(is_with_first).collect()) {
                done[at] = true;
                if is_mine(at) && self.run_cell(&jobs[at], at, truth.as_mut())? == End::Stopped {
                    return Ok(End::Stopped);
                }
            }
        }
        Ok(End::Done)
    }

    fn run_cell(&self, job: &Job, at: usize, truth: Option<&mut Truth>) -> Result<End, Diagnostic> {
        let identity = &self.identities[at];
        let hash = identity.hash();
        let cell = &job.prepared.cell;
        let label = crate::experiment::label(&cell.chain, &cell.varied());
        // another process may have run it by now
        let is_done = self.store.finished(&hash).is_none() && self.store.read(&hash).is_some();
        if self.ran.borrow().contains(&hash) {
            (self.tell)(Event::CellIsTheSame { label });
            return Ok(End::Done);
        }
        if is_done && !self.options.force {
            (self.tell)(Event::CellIsDone { label });
            return Ok(End::Done);
        }
        let reason = match self.store.finished(&hash) {
            Some(_) if !self.options.dump.is_empty() => "dump asked for".into(),
            Some(_) if !self.options.pictures.is_empty() => "picture asked for".into(),
            Some(_) => "forced".into(),
            None => self.store.reason(&cell.chain, &cell.varied(), identity),
        };
        (self.tell)(Event::CellStarted { label: label.clone(), chain: cell.chain.clone(), reason });
        self.store.claim(&hash)?;
        let measured = self.measured(job, at, truth);
        self.store.give_up_claim(&hash);
        let (record, pictures) = match measured {
            Ok(Measured::Done(record, pictures)) => (record, pictures),
            Ok(Measured::Stopped) => return Ok(End::Stopped),
            Ok(Measured::DoesNotFit(why)) => return self.does_not_fit(job, at, &why).map(|()| End::Done),
            // what is wrong with the disk or the device is wrong with all that would follow
            Err(error) if self.store.is_full() || !self.gpu.is_alive() => return Err(error),
            Err(error) => return self.fail(job, at, &error, false).map(|()| End::Done),
        };
        self.keep_pictures(&record, &pictures)?;
        self.store.save(&record)?;
        self.ran.borrow_mut().insert(hash);
        let (chain, error_rms_px) = (cell.chain.clone(), record.measure("error_rms"));
        (self.tell)(Event::CellDone { label, chain, frame_ms: record.frame_ms(), error_rms_px });
        Ok(End::Done)
    }

    /// Says what kernels of one's own have made; what is wrong with it is a warning of the record.
    fn look_at_own(&self, job: &Job, record: &mut Record) -> Result<(), Diagnostic> {
        for own_buffers::Line { text, is_warning } in own_buffers::look(self.gpu, job)? {
            match is_warning {
                false => (self.tell)(Event::Note { text }),
                true => {
                    (self.tell)(Event::Warning { text: text.clone() });
                    record.warnings.push(text);
                }
            }
        }
        Ok(())
    }

    /// Writes the pictures of a cell; in a large sweep only those of a cell that no other one beats so far.
    fn keep_pictures(&self, record: &Record, pictures: &[Picture]) -> Result<(), Diagnostic> {
        let cost_and_error = record.method_ms().zip(record.measure("error_rms"));
        if let Some((cost, error)) = cost_and_error.filter(|_| self.is_large()) {
            let mut fronts = self.fronts.borrow_mut();
            let front = fronts.entry(record.head.scene.key.clone()).or_default();
            let is_beaten = front.iter().any(|own| own.cost <= cost && own.error <= error);
            if is_beaten || !record.faults().is_empty() {
                return Ok(());
            }
            let (beaten, stays): (Vec<OnFront>, Vec<OnFront>) =
                front.drain(..).partition(|own| cost <= own.cost && error <= own.error);
            *front = stays;
            front.push(OnFront { hash: record.head.hash.clone(), cost, error });
            for (kind, _) in PICTURES {
                beaten.iter().for_each(|own| self.store.remove(&picture_name(&own.hash, kind)));
            }
        }
        for picture in pictures {
            let png = pictures::png(picture.width, &picture.rgb)?;
            let name = picture_name(&record.head.hash, picture.kind);
            self.store.write(&name, &png)?;
            if self.is_large() {
                self.store.forget(&name);
            }
        }
        Ok(())
    }

    fn is_large(&self) -> bool {
        (self.identities.len() > MOST_PICTURED || self.options.is_part) && !self.options.all_pictures
    }

    /// Notes a cell that the adapter cannot carry out; the others run.
    fn does_not_fit(&self, job: &Job, at: usize, why: &GpuError) -> Result<(), Diagnostic> {
        self.fail(job, at, &Diagnostic::from(why.clone()), true)
    }

    /// Notes a cell without results; the others run.
    fn fail(&self, job: &Job, at: usize, error: &Diagnostic, does_not_fit: bool) -> Result<(), Diagnostic> {
        let head = self.head(job, at);
        let (why, help) = (error.message.clone(), error.help.clone());
        (self.tell)(Event::CellFailed { label: head.label(), why: why.clone(), does_not_fit });
        let failure = Failure { head, why, help, does_not_fit };
        self.store.save_failure(&failure)?;
        self.failed.borrow_mut().insert(at, failure);
        Ok(())
    }

    /// Runs a cell until its lists are long enough, or too long for the adapter.
    fn measured(&self, job: &Job, at: usize, mut truth: Option<&mut Truth>) -> Result<Measured, Diagnostic> {
        let hash = self.identities[at].hash();
        let mut capacities = Capacities::new();
        let mut longer: Option<Job> = None;
        loop {
            let job = longer.as_ref().unwrap_or(job);
            let Sweep { gpu, store, options, tell, .. } = *self;
            let plan = &job.plan()?;
            let context = cell::Context { gpu, job, plan, store, hash: &hash, options, tell };
            match cell::run(&context, truth.as_deref_mut())? {
                Ended::Done(mut results) => {
                    let pictures = std::mem::take(&mut results.pictures);
                    let mut record = self.record(job, at, plan, *results);
                    self.look_at_own(job, &mut record)?;
                    return Ok(Measured::Done(record.into(), pictures));
                }
                Ended::Stopped => return Ok(Measured::Stopped),
                Ended::Overflowed(Overflow { list, capacity, needed }) => {
                    let larger = needed.saturating_add(needed / 4);
                    let text =
                        format!("the list `{list}` holds {capacity} elements and needed {needed}: again with {larger}");
                    tell(Event::Warning { text });
                    capacities.insert(list, larger);
                    let plan = job.prepared.plan(options, &capacities)?;
                    if let Err(why) = gpu.check_plan(&plan) {
                        return Ok(Measured::DoesNotFit(why));
                    }
                    longer = Some(job.with_plan(plan));
                }
            }
        }
    }

    fn head(&self, job: &Job, at: usize) -> Head {
        let (cell, identity) = (&job.prepared.cell, &self.identities[at]);
        Head {
            hash: identity.hash(),
            experiment: self.title.into(),
            chain: cell.chain.clone(),
            settings: cell.varied(),
            scene: job.scene(identity),
            baseline: self.options.baseline.clone(),
            adapter: self.gpu.summary.clone(),
            made: Made::now(),
            identity: identity.clone(),
        }
    }

    fn record(&self, job: &Job, at: usize, plan: &Plan, results: cell::Results) -> Record {
        for text in results.warnings.iter().cloned() {
            (self.tell)(Event::Warning { text });
        }
        Record {
            head: self.head(job, at),
            measures: results.measures,
            by_frame: results.by_frame,
            looks: results.looks,
            timings: results.timings,
            bytes: plan.bytes(),
            buffers: results.buffers,
            warnings: results.warnings,
            plan: crate::plan::explain(plan),
            left_out: plan.left_out.clone(),
        }
    }

    /// What has come of all cells, in the order of the file and under its names: an earlier run, or another cell that computes the same,
    /// may have called it something else.
    pub fn results(&self, jobs: &[Job]) -> Result<Results, Diagnostic> {
        let mut results = Results::default();
        let failed = self.failed.borrow();
        // what a report would take for each place, by what was there when this run began
        let mut latest: BTreeMap<String, (String, String)> = BTreeMap::new();
        for record in self.store.named() {
            let (hash, date) = (record.head.hash.clone(), record.head.made.date.clone());
            let known = latest.entry(format!("{:?}", record.head.point())).or_insert((hash.clone(), date.clone()));
            if known.1 < date {
                *known = (hash, date);
            }
        }
        for (at, job) in jobs.iter().enumerate() {
            let (chain, settings) = (job.prepared.cell.chain.clone(), job.prepared.cell.varied());
            let named = |head: Head| Head { experiment: self.title.into(), chain, settings, ..head };
            if let Some(failure) = failed.get(&at) {
                results.failures.push(failure.clone());
                continue;
            }
            let Some(record) = self.store.read(&self.identities[at].hash()) else { continue };
            let head = named(record.head.clone());
            let key = format!("{:?}", head.point());
            let is_newest = latest.get(&key).is_some_and(|(hash, _)| *hash == head.hash);
            let has_run_here = self.ran.borrow().contains(&head.hash) && head.is_same_point(&record.head);
            if !is_newest && !has_run_here {
                let Head { hash, experiment, chain, settings, .. } = head.clone();
                self.store.save_name(&Name { hash, experiment, chain, settings, date: Made::now().date })?;
            }
            results.records.push(Record { head, ..record });
        }
        Ok(results)
    }
}

/// Cells in an order in which the chains take turns, so that a machine that becomes slower does so for all of them alike.
fn interleaved(jobs: &[Job], mut places: Vec<usize>) -> Vec<usize> {
    let chain = |at: usize| jobs[at].prepared.cell.chain.as_str();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let ranks: BTreeMap<usize, usize> = places
        .iter()
        .map(|&at| {
            let count = counts.entry(chain(at)).or_default();
            *count += 1;
            (at, *count)
        })
        .collect();
    let place = |at: usize| (ranks[&at] as f64 - 0.5) / counts[chain(at)] as f64;
    places.sort_by(|&a, &b| place(a).total_cmp(&place(b)));
    places
}
