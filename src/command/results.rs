//! What is made of finished cells, without a device: reports, comparisons, the schema.

use std::path::{Path, PathBuf};

use lodlab::experiment::diagnostic::Diagnostic;
use lodlab::experiment::regular;
use lodlab::measure;
use lodlab::report::compare::{self, Comparison, Limits, Pair, Verdict};
use lodlab::report::equal::Answer;
use lodlab::report::folders::{self, Found};
use lodlab::report::page::{PICTURES, picture_name};
use lodlab::report::store::write_file;
use lodlab::report::table::digits;
use lodlab::report::{self, Wanted, data};

use crate::arguments::{Comparing, Reporting};
use crate::output;

pub fn report(wanted: &Reporting) -> Result<(), Diagnostic> {
    let found = folders::read(&wanted.folders)?;
    let out = match (&wanted.out, &wanted.folders[..]) {
        (Some(out), _) => out.clone(),
        (None, [only]) => only.clone(),
        (None, _) => {
            return Err(Diagnostic::input("a report of several folders needs one to be written to").help("--out DIR"));
        }
    };
    if found.results.heads().next().is_none() {
        // what was made of them before stays
        refuse_excluded(&found)?;
        return Err(Diagnostic::input("there is no finished cell").help("`lodlab run FILE --out DIR` makes some"));
    }
    check_names(wanted, &found)?;
    let titles = titles(&found);
    let baseline = wanted.baseline.as_deref().or(found.baseline());
    let wish = Wanted { title: &titles, baseline, error: &wanted.error, cost: &wanted.cost };
    let put = |name: &str, bytes: Option<&[u8]>| match bytes {
        Some(bytes) => write_file(&out, name, bytes),
        None => {
            // most often it is not there
            let _ = std::fs::remove_file(out.join(name));
            Ok(())
        }
    };
    let picture = |name: &str| regular::read(&found.file(name)?).ok();
    let answers = report::write(&found.results, &wish, &put, &picture)?;
    copy_pictures(&found, &out)?;
    say_answers(&answers);
    say!("{} cells, {} failed", found.results.records.len(), found.results.failures.len());
    if found.superseded > 0 {
        say!("{} older records of cells that were run again with something changed are left out", found.superseded);
    }
    say_files(&out);
    refuse_excluded(&found)
}

/// What the page points at lies beside it.
fn copy_pictures(found: &Found, out: &Path) -> Result<(), Diagnostic> {
    for record in &found.results.records {
        for name in PICTURES.iter().map(|(kind, _)| picture_name(&record.head.hash, kind)) {
            let source = found.file(&name).filter(|_| !out.join(&name).exists());
            if let Some(png) = source.and_then(|source| regular::read(&source).ok()) {
                write_file(out, &name, &png)?;
            }
        }
    }
    Ok(())
}

/// Tables of several scenes that are printed.
const MOST_ANSWERS: usize = 8;

/// Which method wins. Of several scenes only the first answer about each is printed; all are in the report.
pub fn say_answers(answers: &[Answer]) {
    let scenes = answers.iter().filter(|answer| answer.is_first).count();
    let said = answers.iter().filter(|answer| answer.is_first || scenes == 1).take(MOST_ANSWERS);
    said.for_each(|answer| say!("{}\n", answer.text()));
    if scenes > MOST_ANSWERS {
        say!("(the tables of {} more scenes are in the report)", scenes - MOST_ANSWERS);
    }
}

/// Where the reports are.
pub fn say_files(folder: &Path) {
    for (what, name) in [("report:  ", "report.html"), ("plot:    ", "pareto.svg"), ("data:    ", "records.parquet")] {
        let path = folder.join(name);
        if path.exists() {
            say!("{what} {}", path.display());
        }
    }
}

fn check_names(wanted: &Reporting, found: &Found) -> Result<(), Diagnostic> {
    let columns = data::columns(&found.results);
    let default = Wanted::new("", None);
    for (name, default, role) in
        [(&wanted.error, default.error, data::Role::Error), (&wanted.cost, default.cost, data::Role::Cost)]
    {
        // what is better the more there is of it has no front on such axes; the page shows it
        let is_it = |column: &&data::Column| column.role == role && !column.more_is_better;
        let known = columns.iter().filter(is_it).map(|column| column.name.as_str());
        if name != default && !known.clone().any(|known| known == name) {
            return Err(
                Diagnostic::input(format!("these results have no figure `{name}` to plot")).suggest(name, known)
            );
        }
    }
    let mut chains: Vec<&str> = found.results.records.iter().map(|record| record.head.chain.as_str()).collect();
    chains.dedup();
    match &wanted.baseline {
        Some(baseline) if !chains.contains(&baseline.as_str()) => {
            Err(Diagnostic::input(format!("there is no chain `{baseline}` to compare with")).suggest(baseline, chains))
        }
        _ => Ok(()),
    }
}

fn titles(found: &Found) -> String {
    let mut titles: Vec<&str> = found.results.heads().map(|head| head.experiment.as_str()).collect();
    titles.sort_unstable();
    titles.dedup();
    titles.join(" and ")
}

/// What is wrong with some records is told at the end, and by the exit status.
fn refuse_excluded(found: &Found) -> Result<(), Diagnostic> {
    for why in &found.excluded {
        output::complain(format!("excluded: {why}"));
    }
    match found.excluded.len() {
        0 => Ok(()),
        count => Err(Diagnostic::run(format!("{count} records are left out of the reports"))
            .help("`lodlab run` makes them again; what is no record can be removed")),
    }
}

pub fn compare(wanted: &Comparing) -> Result<(), Diagnostic> {
    let read = |folder: &PathBuf| folders::read(std::slice::from_ref(folder));
    let (before, after) = (read(&wanted.before)?, read(&wanted.after)?);
    let limits =
        Limits { resolution: wanted.resolution, most_slower: wanted.most_slower, most_worse: wanted.most_worse };
    let comparison = compare::compare(&before.results, &after.results, &limits);
    if comparison.pairs.is_empty() && comparison.failed.is_empty() {
        return Err(Diagnostic::input("the two folders have no cell in common")
            .help("cells are the same if experiment, chain, settings, picture size and number of frames are"));
    }
    say!("{}", table(&comparison).text());
    for pair in &comparison.pairs {
        for (name, old, new) in &pair.changed {
            let shown = |value: &Option<f64>| value.map_or("not measured".into(), |value| value.to_string());
            say!("{}: {name} was {} and is {}", pair.label, shown(old), shown(new));
        }
    }
    for (labels, which) in [(&comparison.only_before, &wanted.before), (&comparison.only_after, &wanted.after)] {
        labels.iter().for_each(|label| say!("only in {}: {label}", which.display()));
    }
    let count = |verdict| comparison.pairs.iter().filter(|pair| pair.verdict == verdict).count();
    let changed = comparison.pairs.iter().filter(|pair| !pair.changed.is_empty()).count();
    say!(
        "{} the same, {} faster, {} slower, {} undecided; {changed} with other figures",
        count(Verdict::Same),
        count(Verdict::Faster),
        count(Verdict::Slower),
        count(Verdict::Undecided)
    );
    refuse_beyond(&comparison)?;
    refuse_excluded(&before)?;
    refuse_excluded(&after)
}

fn table(comparison: &Comparison) -> Answer {
    let row = |pair: &Pair| {
        let ms = |ms: Option<f64>| ms.map_or("-".into(), digits);
        let ratio = pair.ratio.map_or("-".into(), |(ratio, low, high)| format!("{ratio:.3} ({low:.3}..{high:.3})"));
        let verdict = format!("{:?}", pair.verdict).to_lowercase();
        let figures = if pair.changed.is_empty() { "same".into() } else { format!("{} changed", pair.changed.len()) };
        vec![pair.label.clone(), ms(pair.before_ms), ms(pair.after_ms), ratio, verdict, figures]
    };
    Answer {
        title: "Time of the method; ratios are after over before, with what they may be".into(),
        header: ["cell", "before ms", "after ms", "ratio", "verdict", "figures"].map(String::from).to_vec(),
        rows: comparison.pairs.iter().map(row).collect(),
        is_first: true,
    }
}

fn refuse_beyond(comparison: &Comparison) -> Result<(), Diagnostic> {
    let beyond = comparison.pairs.iter().flat_map(|pair| pair.beyond.iter().map(move |what| (pair, what)));
    let beyond: Vec<(&Pair, &String)> = beyond.collect();
    for (pair, what) in &beyond {
        output::complain(format!("{}: {what}", pair.label));
    }
    for (label, why) in &comparison.failed {
        output::complain(format!("{label} has no results any more: {why}"));
    }
    match beyond.len() + comparison.failed.len() {
        0 => Ok(()),
        count => Err(Diagnostic::run(format!("{count} limits are passed"))),
    }
}

/// What each column of `records.csv` and `records.parquet` is; figures of all measures, whether they were asked for or not.
pub fn schema() -> Result<(), Diagnostic> {
    let line = |name: &str, unit: &str, kind: &str, role: &str, meaning: &str| {
        say!("{name:<20} {unit:<12} {kind:<8} {role:<7} {meaning}");
    };
    line("column", "unit", "type", "role", "meaning");
    for column in data::columns(&report::Results::default()) {
        let role = format!("{:?}", column.role).to_lowercase();
        line(&column.name, column.unit, column.values.kind(), &role, &column.meaning);
    }
    line(
        "PATH or axis",
        "",
        "any",
        "axis",
        "what was varied or set, a column each; tuples of numbers have .0, .1, ...",
    );
    let mut told: Vec<&str> = Vec::new();
    for (info, figure) in
        measure::REGISTRY.iter().flat_map(|info| info.figures.iter().map(move |figure| (info, figure)))
    {
        if !told.contains(&figure.name) {
            told.push(figure.name);
            let meaning = format!("{} ({})", figure.meaning, info.name);
            line(figure.name, figure.unit, "number", figure.kind.name(), &meaning);
        }
    }
    Ok(())
}
