//! The command line; what it prints goes through `output`.

mod arguments;
mod output;
mod threads;

use std::cell::RefCell;
use std::collections::HashMap;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};

use lodlab::check;
use lodlab::experiment::Experiment;
use lodlab::experiment::diagnostic::Diagnostic;
use lodlab::experiment::parameters::{Parameter, describe};
use lodlab::experiment::sweep::{self, Setting};
use lodlab::gpu::{Gpu, Waiting, device};
use lodlab::hunt::{self, Found, Hunt, Summary};
use lodlab::plan::explain;
use lodlab::report::records::Misfit;
use lodlab::report::table;
use lodlab::run::{self, Event, Options, Outcome};
use lodlab::{measure, stages};

use arguments::{Cli, Command, Hunting, Inspect};

/// Prints a line to standard output.
macro_rules! say {
    ($($what:tt)*) => { output::say(format_args!($($what)*)) };
}

fn hunt_for(wanted: Hunting) -> Result<(), Diagnostic> {
    let time = wanted.seconds.map(|seconds| Duration::from_secs(seconds.into()));
    let Hunting { seed, frames, finds, tries, stage, dem: dems, .. } = wanted;
    let hunt = Hunt { seed, frames, time, finds, tries, stage, dems };
    let gpu = Gpu::open(wanted.adapter.as_deref())?;
    say!("seed {} on {}", hunt.seed, gpu.summary.name);
    let bar = progress_bar();
    let mut found = 0;
    let mut failure = None;
    let mut note = |broken: Found| {
        found += 1;
        let file = wanted.out.join(format!("{}_{found}.ron", wanted.seed));
        let settings: String = broken.settings.iter().map(|(path, value)| format!(" --set '{path}={value}'")).collect();
        say!("BROKEN {} ({}): lodlab run {}{settings}", broken.promise, broken.value, file.display());
        let written = std::fs::create_dir_all(&wanted.out).and_then(|()| std::fs::write(&file, &broken.experiment));
        failure = failure.take().or(written.err());
    };
    let tell = |summary: &Summary| {
        bar.set_length(hunt.frames as u64);
        bar.set_position(summary.frames as u64);
    };
    let summary = hunt::hunt(&gpu, &hunt, &mut note, &tell);
    bar.finish_and_clear();
    let Summary { frames, promised, in_f64, refused } = summary?;
    say!("{frames} frames, {promised} of them with a proven bound: {found} broken promises");
    say!("({in_f64} scenes with a truth in f64; {refused} are no experiment, promise too much or do not fit)");
    match failure {
        Some(error) => Err(Diagnostic::run(format!("`{}` cannot be written: {error}", wanted.out.display()))),
        None if found > 0 => Err(Diagnostic::run("a promise is broken")),
        None => Ok(()),
    }
}

#[cfg(not(feature = "inspector"))]
fn inspect(_wanted: Inspect) -> Result<(), Diagnostic> {
    Err(Diagnostic::input("this lodlab was built without the inspector")
        .help("`scripts/inspect` builds it with, or `cargo build --release --features inspector`"))
}

#[cfg(feature = "inspector")]
fn inspect(wanted: Inspect) -> Result<(), Diagnostic> {
    use lodlab::inspector::{Shot, window};
    lodlab::kernel::read_from_checkout();
    let gpu = Gpu::open(wanted.adapter.as_deref())?;
    let shot = Shot {
        file: wanted.file,
        out: wanted.screenshot.clone().unwrap_or_default(),
        set: wanted.set,
        chain: wanted.chain,
        buffers: wanted.buffer,
        after: wanted.after,
        frame: wanted.frame,
        form: wanted.look,
        range: wanted.range,
        level: wanted.level,
        against: wanted.against,
        only_views: wanted.only_views,
        results: wanted.results,
        size: wanted.size,
    };
    match wanted.screenshot {
        Some(out) => {
            shot.take(&gpu)?;
            say!("wrote {}", out.display());
            Ok(())
        }
        None => window(&gpu, &shot),
    }
}

/// Without a display, Mesa's layer for choosing a device asks Wayland for one and complains in front of a user's first table.
fn quiet_driver() {
    let has_display = ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|name| std::env::var_os(name).is_some());
    if !has_display && std::env::var_os("NODEVICE_SELECT").is_none() {
        // SAFETY: this is the first thing that the program does, and there is no other thread yet.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}

fn main() -> ExitCode {
    quiet_driver();
    let command = match Cli::try_parse() {
        Ok(Cli { command }) => command,
        Err(message) => return show_message(&message),
    };
    let result = threads::start().and_then(|()| carry_out(command)).and_then(|()| output::finish());
    status(result)
}

/// Tells what went wrong, if something did, and says so to the shell.
fn status(result: Result<(), Diagnostic>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(diagnostic) => {
            output::complain(&diagnostic);
            ExitCode::from(diagnostic.exit_code())
        }
    }
}

/// A mistake on the command line, or the help that was asked for.
fn show_message(message: &clap::Error) -> ExitCode {
    let written = message.print();
    if message.use_stderr() {
        return ExitCode::from(2);
    }
    output::note(written);
    status(output::finish())
}

fn carry_out(command: Command) -> Result<(), Diagnostic> {
    match command {
        Command::Run {
            files,
            set,
            out,
            adapter,
            frames,
            dump,
            picture,
            every_frame,
            on_cpu,
            force,
            keep_everything,
            patience,
        } => {
            let set = set.into_iter().chain(frames.map(|frames| format!("scene.camera.frames={frames}")));
            let pictures = picture;
            let settings = settings(set)?;
            let options = Options { settings, adapter, dump, pictures, every_frame, on_cpu, force, keep_everything };
            run_files(&files, out, Duration::from_secs(patience.into()), &options)
        }
        Command::Plan { file, set } => show_plans(&file, settings(set.into_iter())?),
        Command::Stages { name } => show_stages(name.as_deref()),
        Command::Check { stage, adapter } => run_checks(stage.as_deref(), adapter.as_deref()),
        Command::Hunt(wanted) => hunt_for(wanted),
        Command::Inspect(wanted) => inspect(wanted),
        Command::Devices => show_devices(),
    }
}

fn settings(arguments: impl Iterator<Item = String>) -> Result<Vec<Setting>, Diagnostic> {
    arguments.map(|argument| sweep::read_setting(&argument)).collect()
}

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

fn run_files(files: &[PathBuf], out: Option<PathBuf>, patience: Duration, options: &Options) -> Result<(), Diagnostic> {
    for (at, file) in files.iter().enumerate() {
        if files[..at].iter().any(|other| other.file_stem() == file.file_stem()) {
            return Err(Diagnostic::input(format!(
                "two experiments would leave their results in one folder: `{}`",
                file.display()
            ))
            .help("run them one by one, each with its own --out"));
        }
    }
    // a mistake in the last file should not show after an hour of the first
    let experiments: Vec<Experiment> = files.iter().map(|file| Experiment::load(file)).collect::<Result<_, _>>()?;
    // the first one's terrains stay in memory until it runs; to keep those of all would take the sum of them
    let mut ready = None;
    for experiment in &experiments {
        match ready {
            None => ready = Some(run::prepare(experiment, &options.settings)?),
            Some(_) => run::prepare_each(experiment, &options.settings)?.try_for_each(|cell| cell.map(|_| ()))?,
        }
    }
    let gpu = Gpu::open(options.adapter.as_deref())?;
    gpu.watch(patience, |waiting| say_waiting(&waiting))?;
    let mut misfits: Vec<Misfit> = Vec::new();
    for (file, experiment) in files.iter().zip(&experiments) {
        let stem = file.file_stem().unwrap_or_default();
        let folder = match &out {
            Some(out) if files.len() == 1 => out.clone(),
            Some(out) => out.join(stem),
            None => PathBuf::from("out").join(stem),
        };
        let prepared = ready.take().map_or_else(|| run::prepare(experiment, &options.settings), Ok)?;
        say!("{} on {}", experiment.title, gpu.summary.name);
        let bar = progress_bar();
        let told = RefCell::new(Vec::new());
        let tell = |event| show(&bar, &mut told.borrow_mut(), event);
        let outcome = run::run(&experiment.title, prepared, &gpu, &folder, options, &tell);
        bar.finish_and_clear();
        let outcome = outcome?;
        show_outcome(&outcome, options);
        misfits.extend(outcome.misfits);
    }
    did_all_fit(&misfits)
}

/// The table that a run ends with, what it came to, and where its files are.
fn show_outcome(outcome: &Outcome, options: &Options) {
    if !outcome.records.is_empty() {
        say!("{}", table::table(&outcome.records));
    }
    let same = outcome.records.len().saturating_sub(outcome.ran + outcome.finished);
    let same = if same > 0 { format!(", {same} the same as another one") } else { String::new() };
    let unfit = match outcome.misfits.len() {
        0 => String::new(),
        1 => ", 1 does not fit".to_string(),
        several => format!(", {several} do not fit"),
    };
    say!("{} cells run, {} finished before{same}{unfit}", outcome.ran, outcome.finished);
    for (what, name) in [("report:  ", "report.html"), ("plot:    ", "pareto.svg"), ("pictures:", "pictures")] {
        let path = outcome.folder.join(name);
        if path.exists() {
            say!("{what} {}", path.display());
        }
    }
    for record in outcome.records.iter().filter(|_| !options.dump.is_empty()) {
        let path = outcome.folder.join("dumps").join(&record.hash);
        say!("dump:     {} ({})", path.display(), record.label());
    }
}

/// Cells that did not run are a failure, told when all others are done.
fn did_all_fit(misfits: &[Misfit]) -> Result<(), Diagnostic> {
    let Some(first) = misfits.first() else { return Ok(()) };
    let others = match misfits.len() - 1 {
        0 => String::new(),
        1 => " (and 1 more cell)".to_string(),
        several => format!(" (and {several} more cells)"),
    };
    let failed = Diagnostic::run(format!("{} does not fit: {}{others}", first.label(), first.why));
    Err(Diagnostic { help: first.help.clone(), ..failed })
}

/// A bar with the time left on a terminal; elsewhere nothing, and plain lines instead.
fn progress_bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} cells, {eta} left: {msg}");
    ProgressBar::new(0).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// Shows an event; a warning that was `told` before is not told again.
fn show(bar: &ProgressBar, told: &mut Vec<String>, event: Event) {
    let line = |text: String| if bar.is_hidden() { say!("{text}") } else { bar.println(text) };
    match event {
        Event::Started { cells, finished } => {
            bar.set_length(cells as u64);
            bar.set_position(finished as u64);
            if finished > 0 {
                line(format!("{finished} of {cells} cells are finished and stay as they are"));
            }
        }
        Event::CellStarted { label, reason } => {
            bar.set_message(label.clone());
            line(format!("run {label} ({reason})"));
        }
        Event::Frame { done, of } => bar.set_message(format!("frame {done} of {of}")),
        Event::CellDone { label, frame_ms } => {
            bar.inc(1);
            let time = frame_ms.map_or("not timed".into(), |ms| format!("{ms:.2} ms a frame"));
            line(format!("  done {label}: {time}"));
        }
        Event::CellDoesNotFit { label, why } => {
            bar.inc(1);
            line(format!("skip {label} (it does not fit: {why})"));
        }
        Event::CellIsTheSame { label } => {
            bar.inc(1);
            line(format!("skip {label} (another cell of this run computes the same)"));
        }
        Event::Warning(text) if told.contains(&text) => {}
        Event::Warning(text) => {
            line(format!("  warning: {text}"));
            told.push(text);
        }
    }
}

/// The plans of all cells; cells whose plans read the same are named together.
fn show_plans(file: &std::path::Path, settings: Vec<Setting>) -> Result<(), Diagnostic> {
    let experiment = Experiment::load(file)?;
    let options = Options { settings, ..Options::default() };
    let mut shown: Vec<(Rc<str>, Vec<String>)> = Vec::new();
    let mut places: HashMap<Rc<str>, usize> = HashMap::new();
    for prepared in run::prepare_each(&experiment, &options.settings)? {
        let prepared = prepared?;
        let truth = prepared.wants_truth().then(|| run::truth_in_f64(&prepared.data)).flatten();
        let truth = truth.map_or(String::new(), |why| format!("  {why}\n"));
        let text: Rc<str> = (explain(&run::plan(&prepared, &options)?) + &truth).into();
        let at = *places.entry(text.clone()).or_insert(shown.len());
        if at == shown.len() {
            shown.push((text, Vec::new()));
        }
        shown[at].1.push(prepared.cell.label());
    }
    for (text, labels) in shown {
        say!("{}\n{text}", labels.join("\n"));
    }
    Ok(())
}

fn show_stages(name: Option<&str>) -> Result<(), Diagnostic> {
    let Some(name) = name else {
        stages::REGISTRY
            .iter()
            .for_each(|entry| say!("{:<17} {:<9} {}", entry.info.name, entry.room, entry.info.summary));
        measure::REGISTRY.iter().for_each(|info| say!("{:<17} {:<9} {}", info.name, "measure", info.summary));
        return Ok(());
    };
    if let Some(entry) = stages::find(name) {
        show_stage(entry);
        return Ok(());
    }
    if let Some(info) = measure::REGISTRY.iter().find(|info| info.name == name) {
        say!("{}: {}\n  version: {}", info.name, info.summary, info.version);
        describe(&(info.parameters)()).iter().for_each(show_parameter);
        return Ok(());
    }
    let known =
        stages::REGISTRY.iter().map(|entry| entry.info.name).chain(measure::REGISTRY.iter().map(|info| info.name));
    Err(Diagnostic::input(format!("there is no stage or measure `{name}`")).suggest(name, known))
}

fn show_stage(entry: &stages::Entry) {
    let info = entry.info;
    say!("{} ({}): {}", info.name, entry.room, info.summary);
    let list = |names: &[&str]| if names.is_empty() { "-".to_string() } else { names.join(", ") };
    let kernels = entry.kernels();
    let rows = [
        ("formula", info.formula.to_string()),
        ("source", info.source.to_string()),
        ("reads", list(info.reads)),
        ("writes", list(info.writes)),
        ("needs", list(info.needs)),
        ("offers", list(info.offers)),
        ("kernels", list(&kernels.iter().map(String::as_str).collect::<Vec<_>>())),
        ("example", info.examples.first().map_or(String::new(), |example| example.chain.to_string())),
    ];
    rows.iter().for_each(|(name, text)| say!("  {:<8} {text}", format!("{name}:")));
    describe(&(info.parameters)()).iter().for_each(show_parameter);
}

/// Name, default, range and meaning of a parameter, and of a choice each name.
fn show_parameter(parameter: &Parameter) {
    let default = parameter.default.as_ref().map_or("required".into(), |default| format!("default {default}"));
    let range = parameter.range.as_ref().map_or(String::new(), |range| format!(", {range}"));
    say!("  {} ({default}{range}): {}", parameter.name, parameter.meaning);
    for (name, meaning) in &parameter.choices {
        say!("      {name}: {meaning}");
    }
}

fn run_checks(stage: Option<&str>, adapter: Option<&str>) -> Result<(), Diagnostic> {
    let cases = check::cases::cases(stage)?;
    let known = device::list();
    if known.is_empty() {
        return Err(lodlab::gpu::GpuError::NoAdapter.into());
    }
    let gpus: Vec<Arc<Gpu>> = match adapter {
        Some(name) => vec![Gpu::open(Some(name))?],
        None => (0..known.len()).map(Gpu::open_nth).collect::<Result<_, _>>()?,
    };
    let mut failures = 0;
    for gpu in gpus {
        say!("{}", gpu.summary.name);
        for case in &cases {
            let outcomes = check::run_case(&gpu, case)?;
            // of one stage, what leads to it is not asked for
            let is_wanted =
                |outcome: &&check::Outcome| stage.is_none_or(|stage| outcome.stage == stage || !outcome.passed());
            for outcome in outcomes.iter().filter(is_wanted) {
                say!("  {outcome}");
                failures += usize::from(!outcome.passed());
            }
        }
    }
    match failures {
        0 => Ok(()),
        _ => Err(Diagnostic::run(format!("{failures} checks failed"))),
    }
}

fn show_devices() -> Result<(), Diagnostic> {
    let adapters = device::list();
    if adapters.is_empty() {
        return Err(lodlab::gpu::GpuError::NoAdapter.into());
    }
    for (at, adapter) in adapters.into_iter().enumerate() {
        // what only an open device tells
        let opened = Gpu::open_nth(at);
        let adapter = opened.as_ref().map_or(adapter, |gpu| gpu.summary.clone());
        say!("{} ({}, {})", adapter.name, adapter.backend, adapter.kind);
        say!("  driver           {}", adapter.driver);
        say!("  subgroup size    {} to {}", adapter.subgroup_min_size, adapter.subgroup_max_size);
        say!("  storage binding  {}", lodlab::plan::megabytes(adapter.storage_binding_bytes));
        say!(
            "  timestamps       {}",
            if adapter.timestamps {
                "yes, if they agree with the clock"
            } else {
                "none to be believed: times are wall times"
            }
        );
        let turns = match (&opened, adapter.loop_turns) {
            (Err(error), _) => format!("not known: {error}"),
            (Ok(_), Some(turns)) => format!("ended after {turns} turns of a thread in all, in silence"),
            (Ok(_), None) => "not ended".to_string(),
        };
        say!("  loops            {turns}");
    }
    Ok(())
}
