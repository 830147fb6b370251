//! Everything that is made of results: files for other programs, the plot, the page.

use super::data::{self, Column, Role, Values};
use super::equal::{self, Answer};
use super::export;
use super::page::{self, About};
use super::plot::{self, Axes};
use super::records::{Record, Results};
use crate::experiment::diagnostic::Diagnostic;

/// What somebody wants to see of the results.
pub struct Wanted<'a> {
    pub title: &'a str,
    /// The chain that the others are compared with; else it is the first.
    pub baseline: Option<&'a str>,
    /// The figures of the plot.
    pub error: &'a str,
    pub cost: &'a str,
}

impl<'a> Wanted<'a> {
    pub fn new(title: &'a str, baseline: Option<&'a str>) -> Self {
        Self { title, baseline, error: "error_rms", cost: "method_ms" }
    }
}

/// Writes a file under its name, or removes it if there is nothing to be in it.
pub type Put<'a> = dyn Fn(&str, Option<&[u8]>) -> Result<(), Diagnostic> + 'a;

/// Writes all reports; `picture` reads one of the results' pictures.
pub fn write(
    results: &Results,
    wanted: &Wanted,
    put: &Put,
    picture: &dyn Fn(&str) -> Option<Vec<u8>>,
) -> Result<Vec<Answer>, Diagnostic> {
    let answers = equal::answers(results, wanted.baseline);
    let (records, frames) = (data::columns(results), frames(&results.records));
    for (name, columns) in [("records", &records), ("frames", &frames)] {
        put(&format!("{name}.csv"), Some(&export::csv(columns)?))?;
        put(&format!("{name}.parquet"), Some(&export::parquet(columns)?))?;
    }
    put("records.json", Some(export::json(&records).as_bytes()))?;
    let target_px = target_px(&results.records);
    let axes = axes(wanted, &records, target_px);
    let plot = plot::svg(wanted.title, results, &axes)?;
    put("pareto.svg", plot.as_deref().map(str::as_bytes))?;
    let about = About { title: wanted.title, answers: &answers, target_px };
    put("report.html", Some(page::page(&about, results, picture).as_bytes()))?;
    Ok(answers)
}

/// The threshold that errors were counted by, if all records have the same.
fn target_px(records: &[Record]) -> f64 {
    let threshold = |measure: &String| {
        let (name, parameters) = measure.split_once(' ')?;
        let parameters: serde_json::Value = serde_json::from_str(parameters).ok()?;
        name.starts_with("ScreenError/").then(|| parameters["threshold_px"].as_f64())?
    };
    let of_record = |record: &Record| record.head.identity.measures.iter().find_map(threshold);
    let mut all = records.iter().filter_map(of_record);
    let first = all.next().unwrap_or(1.0);
    if all.all(|other| other == first) { first } else { 1.0 }
}

fn axes<'a>(wanted: &Wanted<'a>, columns: &'a [Column], target_px: f64) -> Axes<'a> {
    let find = |name: &str| columns.iter().find(|column| column.name == name);
    let title = |name: &'a str| match name {
        "method_ms" => "time of the method without shading, ms (median)",
        "frame_ms" => "time of a whole frame, ms (median)",
        "error_rms" => "screen-space error, px (RMS)",
        _ => name,
    };
    let is_px = find(wanted.error).is_none_or(|column| column.unit == "px");
    Axes {
        error: wanted.error,
        error_title: title(wanted.error),
        cost: wanted.cost,
        cost_title: title(wanted.cost),
        target: is_px.then_some(target_px),
    }
}

/// A row for each frame of each cell.
fn frames(records: &[Record]) -> Vec<Column> {
    let rows: Vec<(&Record, usize)> =
        records.iter().flat_map(|record| (0..record.head.scene.frames).map(move |frame| (record, frame))).collect();
    let column = |name: &str, unit, meaning: &str, role, values| Column {
        name: name.into(),
        unit,
        meaning: meaning.into(),
        role,
        more_is_better: false,
        values,
    };
    let hashes = rows.iter().map(|(record, _)| Some(record.head.hash.clone())).collect();
    let labels = rows.iter().map(|(record, _)| Some(record.label())).collect();
    let numbers = rows.iter().map(|(_, frame)| Some(*frame as i64)).collect();
    let mut columns = vec![
        column("cell", "", "hash of the cell", Role::Id, Values::Text(hashes)),
        column("label", "", "chain and what was varied", Role::Id, Values::Text(labels)),
        column("frame", "", "number of the frame, from 0", Role::Id, Values::Integer(numbers)),
    ];
    let mut time = |name: &str, of: fn(&Record) -> &[Option<f64>]| {
        let values = rows.iter().map(|(record, frame)| of(record).get(*frame).copied().flatten()).collect();
        columns.push(column(name, "ms", "median of the frame's samples", Role::Cost, Values::Number(values)));
    };
    time("method_ms", |record| &record.timings.method_ms_by_frame);
    time("frame_ms", |record| &record.timings.frame_ms_by_frame);
    let mut names: Vec<&String> = records.iter().flat_map(|record| record.by_frame.keys()).collect();
    names.sort();
    names.dedup();
    for name in names {
        let known = crate::measure::known(name);
        let (unit, meaning) = known.map_or(("", ""), |known| (known.unit, known.meaning));
        let of = |(record, frame): &(&Record, usize)| record.by_frame.get(name)?.get(*frame).copied().flatten();
        let values = Values::Number(rows.iter().map(of).collect());
        columns.push(column(name, unit, meaning, Role::Figure, values));
    }
    columns
}
