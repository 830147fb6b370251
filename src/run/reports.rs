//! What a run leaves besides its cells: table data, plot and page.

use super::cell;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::regular;
use crate::report::html::{self, Pictures};
use crate::report::pareto;
use crate::report::records::{self, Misfit, Record, Store};

/// Leaves a list of the cells that did not fit the adapter, if there are any.
pub fn write_misfits(store: &Store, misfits: &[Misfit]) -> Result<(), Diagnostic> {
    let name = "does_not_fit.json";
    if misfits.is_empty() {
        store.remove(name);
        return Ok(());
    }
    let json = serde_json::to_vec_pretty(misfits)
        .map_err(|error| Diagnostic::run(format!("{name} cannot be made: {error}")))?;
    store.write(name, &json)
}

pub fn write(title: &str, store: &Store, records: &[Record]) -> Result<(), Diagnostic> {
    let csv = records::csv(records).map_err(|error| Diagnostic::run(format!("records.csv cannot be made: {error}")))?;
    store.write("records.csv", &csv)?;
    let json = serde_json::to_vec_pretty(records)
        .map_err(|error| Diagnostic::run(format!("records.json cannot be made: {error}")))?;
    store.write("records.json", &json)?;
    let plot = pareto::svg(title, records)?;
    match &plot {
        Some(svg) => store.write("pareto.svg", svg.as_bytes())?,
        None => store.remove("pareto.svg"),
    }
    let picture =
        |record: &Record, kind: &str| regular::read(&store.folder.join(cell::picture_name(&record.hash, kind))).ok();
    let look = |(what, file): &(String, String)| Some((what.clone(), regular::read(&store.folder.join(file)).ok()?));
    let pictures: Vec<Pictures> = records
        .iter()
        .map(|record| Pictures {
            label: record.label(),
            image: picture(record, "image"),
            error: picture(record, "error"),
            looks: record.looks.iter().filter_map(look).collect(),
        })
        .filter(|pictures| pictures.image.is_some() || pictures.error.is_some() || !pictures.looks.is_empty())
        .collect();
    store.write("report.html", html::page(title, records, plot.as_deref(), &pictures).as_bytes())
}
