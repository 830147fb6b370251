//! `lodlab run`

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use lodlab::experiment::Experiment;
use lodlab::experiment::diagnostic::Diagnostic;
use lodlab::gpu::{Gpu, Waiting};
use lodlab::report::records::{Failure, Results};
use lodlab::report::table;
use lodlab::run::{self, Options, Outcome, Prepared, Stop};

use super::cells::Chosen;
use super::progress::{Manner, Progress};
use super::results::{say_answers, say_files};
use super::{set, settings};
use crate::arguments::Running;
use crate::output;

/// Cells of which the table is printed; of more, it is in the reports.
const MOST_ROWS: usize = 60;
/// Faulty cells that are named.
const MOST_FAULTY: usize = 5;

/// Says what is waited for; what has taken too long ends the program, since neither a device nor its driver can be interrupted. The records of
/// cells are files by then.
fn say_waiting(waiting: &Waiting) {
    let (what, waited_s) = (&waiting.what, waiting.waited.as_secs());
    if !waiting.is_over {
        say!("  still waiting for {what} ({waited_s} s)");
        return;
    }
    let message = format!("not done after {waited_s} s: {what}");
    let help = "the records of finished cells are kept; `--patience SECONDS` waits longer";
    output::complain(Diagnostic::run(message).help(help));
    std::process::exit(1);
}

pub fn run(wanted: Running) -> Result<(), Diagnostic> {
    let options = Options {
        settings: settings(&set(&wanted.set, wanted.frames))?,
        adapter: wanted.adapter.clone(),
        dump: wanted.dump.clone(),
        pictures: wanted.picture.clone(),
        every_frame: wanted.every_frame,
        on_cpu: wanted.on_cpu.clone(),
        all_pictures: wanted.all_pictures,
        force: wanted.force,
        keep_everything: wanted.keep_everything,
        baseline: wanted.baseline.clone(),
        is_part: wanted.shard.is_some() || wanted.cells.is_some(),
        stop: Stop::default(),
    };
    let manner = match (wanted.json, wanted.quiet) {
        (true, _) => Manner::Json,
        (_, true) => Manner::Quiet,
        _ => Manner::Lines,
    };
    let chosen = Chosen::new(wanted.shard, wanted.cells.as_deref())?;
    end_when_asked(&options.stop)?;
    run_files(&wanted, &chosen, manner, &options)
}

/// The first interrupt ends the run after its frame, with reports; a second one at once.
fn end_when_asked(stop: &Stop) -> Result<(), Diagnostic> {
    let stop = stop.clone();
    let ask = move || match stop.is_wanted() {
        true => std::process::exit(130),
        false => stop.wish(),
    };
    ctrlc::set_handler(ask).map_err(|error| Diagnostic::run(format!("interrupts cannot be heard: {error}")))
}

fn check_stems(files: &[PathBuf]) -> Result<(), Diagnostic> {
    for (at, file) in files.iter().enumerate() {
        if files[..at].iter().any(|other| other.file_stem() == file.file_stem()) {
            return Err(Diagnostic::input(format!(
                "two experiments would leave their results in one folder: `{}`",
                file.display()
            ))
            .help("run them one by one, each with its own --out"));
        }
    }
    Ok(())
}

fn prepare(experiment: &Experiment, chosen: &Chosen, options: &Options) -> Result<Vec<Prepared>, Diagnostic> {
    run::prepare_some(experiment, &options.settings, |at, cell| chosen.has(at, cell))?.collect()
}

fn run_files(wanted: &Running, chosen: &Chosen, manner: Manner, options: &Options) -> Result<(), Diagnostic> {
    let Running { files, out, patience, .. } = wanted;
    check_stems(files)?;
    // a mistake in the last file should not show after an hour of the first
    let experiments: Vec<Experiment> = files.iter().map(|file| Experiment::load(file)).collect::<Result<_, _>>()?;
    // the first one's terrains stay in memory until it runs; to keep those of all would take the sum of them
    let mut ready = None;
    for experiment in &experiments {
        check_baseline(experiment, options)?;
        match ready {
            None => {
                let prepared = prepare(experiment, chosen, options)?;
                chosen.check_found(prepared.len())?;
                ready = Some(prepared);
            }
            Some(_) => run::prepare_each(experiment, &options.settings)?.try_for_each(|cell| cell.map(|_| ()))?,
        }
    }
    let gpu = Gpu::open(options.adapter.as_deref())?;
    gpu.watch(Duration::from_secs((*patience).into()), |waiting| say_waiting(&waiting))?;
    let mut failures: Vec<Failure> = Vec::new();
    for (file, experiment) in files.iter().zip(&experiments) {
        let stem = file.file_stem().unwrap_or_default();
        let folder = match out {
            Some(out) if files.len() == 1 => out.clone(),
            Some(out) => out.join(stem),
            None => PathBuf::from("out").join(stem),
        };
        let prepared = ready.take().map_or_else(|| prepare(experiment, chosen, options), Ok)?;
        let outcome = run_one(experiment, prepared, &gpu, &folder, manner, options)?;
        if outcome.is_stopped {
            return Err(stopped(&outcome));
        }
        failures.extend(outcome.results.failures);
    }
    did_all(&failures)
}

fn check_baseline(experiment: &Experiment, options: &Options) -> Result<(), Diagnostic> {
    match &options.baseline {
        Some(baseline) if experiment.chain_names().all(|name| name != baseline) => {
            Err(Diagnostic::input(format!("there is no chain `{baseline}` to compare with"))
                .suggest(baseline, experiment.chain_names()))
        }
        _ => Ok(()),
    }
}

fn run_one(
    experiment: &Experiment,
    prepared: Vec<Prepared>,
    gpu: &Arc<Gpu>,
    folder: &Path,
    manner: Manner,
    options: &Options,
) -> Result<Outcome, Diagnostic> {
    if manner == Manner::Lines {
        say!("{} on {}", experiment.title, gpu.summary.name);
    }
    let progress = RefCell::new(Progress::new(manner));
    let tell = |event| progress.borrow_mut().show(&event);
    let baseline = options.baseline.clone().or(experiment.baseline.clone());
    let options = Options { baseline, ..options.clone() };
    let outcome = run::run(&experiment.title, prepared, gpu, folder, &options, &tell);
    progress.borrow().finish();
    let outcome = outcome?;
    if manner != Manner::Json {
        show_outcome(&outcome, &options);
    }
    Ok(outcome)
}

/// What a run ends with: which method wins, the table of its cells, what it came to, and where its files are.
fn show_outcome(outcome: &Outcome, options: &Options) {
    let records = &outcome.results.records;
    if options.is_part {
        say!("{}, of a part; `lodlab report {}` makes the reports of all", tally(outcome), outcome.folder.display());
        return;
    }
    say_answers(&outcome.answers);
    match records.len() {
        0 => {}
        1..=MOST_ROWS => say!("{}", table::table(records)),
        count => say!("(the table of {count} cells is in the report)"),
    }
    let faulty: Vec<_> = records.iter().filter(|record| !record.faults().is_empty()).collect();
    for record in faulty.iter().take(MOST_FAULTY) {
        say!("! {}: {}; it is on no front", record.label(), record.faults().join(", "));
    }
    if faulty.len() > MOST_FAULTY {
        say!("! {} more cells are faulty: the column `why` of the report says how", faulty.len() - MOST_FAULTY);
    }
    say!("{}", tally(outcome));
    say_files(&outcome.folder);
    for record in records.iter().filter(|_| !options.dump.is_empty()) {
        let path = outcome.folder.join("dumps").join(&record.head.hash);
        say!("dump:     {} ({})", path.display(), record.label());
    }
}

/// How many cells a run came to.
fn tally(outcome: &Outcome) -> String {
    let Results { records, failures } = &outcome.results;
    let same = records.len().saturating_sub(outcome.ran + outcome.finished);
    let same = if same > 0 { format!(", {same} that another cell or process had run") } else { String::new() };
    let failed = match failures.len() {
        0 => String::new(),
        count => format!(", {count} without results"),
    };
    format!("{} cells run, {} finished before{same}{failed}", outcome.ran, outcome.finished)
}

fn stopped(outcome: &Outcome) -> Diagnostic {
    let kept = outcome.results.records.len();
    Diagnostic::interrupted(format!(
        "the run was ended; {kept} finished cells are kept in `{}`",
        outcome.folder.display()
    ))
    .help("the same command goes on where it was")
}

/// Cells without results are a failure, told when all others are done.
fn did_all(failures: &[Failure]) -> Result<(), Diagnostic> {
    let Some(first) = failures.first() else { return Ok(()) };
    let others = match failures.len() - 1 {
        0 => String::new(),
        1 => " (and 1 more cell)".to_string(),
        several => format!(" (and {several} more cells)"),
    };
    let what = if first.does_not_fit { "does not fit" } else { "failed" };
    let failed = Diagnostic::run(format!("{} {what}: {}{others}", first.head.label(), first.why));
    Err(Diagnostic { help: first.help.clone(), ..failed })
}
