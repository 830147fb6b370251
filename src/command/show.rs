//! What can be said without running anything: plans, stages and measures, devices.

use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

use lodlab::experiment::Experiment;
use lodlab::experiment::diagnostic::Diagnostic;
use lodlab::experiment::parameters::{Parameter, describe};
use lodlab::experiment::scene::{self, Part};
use lodlab::experiment::sweep::Setting;
use lodlab::gpu::{Gpu, device};
use lodlab::plan::explain;
use lodlab::run::{self, Options};
use lodlab::{measure, stages};

/// The plans of all cells; cells whose plans read the same are named together.
pub fn plans(file: &Path, settings: Vec<Setting>) -> Result<(), Diagnostic> {
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
    let cells: usize = shown.iter().map(|(_, labels)| labels.len()).sum();
    for (text, labels) in &shown {
        say!("{}\n{text}", labels.join("\n"));
    }
    if cells > 1 {
        say!("{cells} cells, {} plans", shown.len());
    }
    Ok(())
}

pub fn stages(name: Option<&str>) -> Result<(), Diagnostic> {
    let Some(name) = name else {
        let line = |name: &str, room: &str, summary: &str| say!("{name:<17} {room:<9} {summary}");
        stages::REGISTRY.iter().for_each(|entry| line(entry.info.name, entry.room, entry.info.summary));
        measure::REGISTRY.iter().for_each(|info| line(info.name, "measure", info.summary));
        scene::PARTS.iter().for_each(|part| line(part_name(part), kind(part), &meaning(part)));
        return Ok(());
    };
    let stage = stages::find(name);
    let measure = measure::REGISTRY.iter().find(|info| info.name == name);
    let parts: Vec<&Part> = scene::PARTS.iter().filter(|part| part_name(part) == name).collect();
    if stage.is_none() && measure.is_none() && parts.is_empty() {
        let stages = stages::REGISTRY.iter().map(|entry| entry.info.name);
        let known =
            stages.chain(measure::REGISTRY.iter().map(|info| info.name)).chain(scene::PARTS.iter().map(part_name));
        return Err(
            Diagnostic::input(format!("there is no stage, measure or part of a scene `{name}`")).suggest(name, known)
        );
    }
    if let Some(entry) = stage {
        show_stage(entry);
    }
    if let Some(info) = measure {
        say!("{}: {}\n  version: {}", info.name, info.summary, info.version);
        for figure in info.figures {
            say!(
                "  gives {} ({}): {}",
                figure.name,
                if figure.unit.is_empty() { "-" } else { figure.unit },
                figure.meaning
            );
        }
        describe(&(info.parameters)()).iter().for_each(show_parameter);
    }
    for part in parts {
        say!("{} ({}, at `{}`): {}", part_name(part), kind(part), part.path, meaning(part));
        describe(&(part.parameters)()).iter().for_each(show_parameter);
    }
    Ok(())
}

/// What a part of a scene is called: its own name, or the field that it is.
fn part_name(part: &Part) -> &'static str {
    if part.name.is_empty() { kind(part) } else { part.name }
}

/// The field of the scene that a part can be.
fn kind(part: &Part) -> &'static str {
    part.path.rsplit('.').next().unwrap_or(part.path)
}

/// The first sentence of what is written of it.
fn meaning(part: &Part) -> String {
    let schema = (part.parameters)();
    let text = schema.get("description").and_then(|text| text.as_str()).unwrap_or_default();
    text.lines().collect::<Vec<_>>().join(" ")
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

pub fn devices() -> Result<(), Diagnostic> {
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
