//! The table of cells.

use comfy_table::{CellAlignment, Table, presets};

use super::Record;
use crate::measure::time::Spread;
use crate::measure::{self, Column, Show};

/// What the measures of these records show, in the order of the registry: the columns that any record has a figure for.
pub fn columns(records: &[Record]) -> Vec<&'static Column> {
    let all = measure::REGISTRY.iter().flat_map(|info| info.columns);
    let has_figure = |column: &&Column| records.iter().any(|record| record.figure(column.figure).is_some());
    all.filter(has_figure).collect()
}

pub fn header(columns: &[&Column]) -> Vec<&'static str> {
    std::iter::once("cell").chain(columns.iter().map(|column| column.heading)).collect()
}

/// One row a record; a dash is "not measured".
pub fn rows(columns: &[&Column], records: &[Record]) -> Vec<Vec<String>> {
    let row = |record: &Record| {
        let shown = columns.iter().map(|column| shown(column, record));
        std::iter::once(label(record)).chain(shown).collect()
    };
    records.iter().map(row).collect()
}

/// What the user calls the cell; one whose picture is wrong is marked.
fn label(record: &Record) -> String {
    if record.faults().is_empty() { record.label() } else { format!("! {}", record.label()) }
}

fn shown(column: &Column, record: &Record) -> String {
    let value = record.figure(column.figure);
    let number = |value: Option<f64>| value.map_or("-".into(), digits);
    match (column.show, column.figure) {
        (Show::Number, "method_ms") => record.method().map_or("-".into(), with_spread),
        (Show::Number, "frame_ms") => record.frame().map_or("-".into(), with_spread),
        (Show::Number, _) => number(value),
        (Show::Percent, _) => number(value.map(|share| share * 100.0)),
        (Show::Count, _) => value.map_or("-".into(), |count| count.to_string()),
        (Show::NumberUnless(equal), _) if record.figure(equal) == Some(1.0) => "equal".into(),
        (Show::NumberUnless(_), _) => number(value),
    }
}

/// A median, and half of what is between the quartiles.
fn with_spread(spread: &Spread) -> String {
    let half = (spread.upper_quartile - spread.lower_quartile) / 2.0;
    if spread.samples < 3 { digits(spread.median) } else { format!("{} +- {}", digits(spread.median), digits(half)) }
}

pub fn table(records: &[Record]) -> String {
    let mut table = Table::new();
    let columns = columns(records);
    table.load_preset(presets::ASCII_MARKDOWN).set_header(header(&columns));
    table.add_rows(rows(&columns, records));
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.to_string()
}

/// Three significant digits.
pub fn digits(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        100.0.. => format!("{value:.0}"),
        10.0.. => format!("{value:.1}"),
        1.0.. => format!("{value:.2}"),
        0.001.. => format!("{value:.4}"),
        _ => format!("{value:.1e}"),
    }
}
