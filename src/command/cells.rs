//! Cells by themselves: their list, and which of them somebody wants.

use std::collections::BTreeSet;
use std::io::Read;
use std::path::Path;

use serde::{Deserialize, Serialize};

use lodlab::experiment::diagnostic::{Diagnostic, Origin, Source};
use lodlab::experiment::sweep::Varied;
use lodlab::experiment::{Cell, Experiment, label, regular};
use lodlab::report::Store;

use super::{set, settings};
use crate::arguments::{CellList, Shard};

/// A cell as a line of JSON: what `lodlab cells` prints and `lodlab run --cells` reads.
#[derive(Debug, Serialize, Deserialize)]
pub struct Line {
    /// Its number in the file, from 0.
    index: usize,
    chain: String,
    label: String,
    settings: Vec<Varied>,
}

impl Line {
    fn new(index: usize, cell: &Cell) -> Self {
        let (chain, settings) = (cell.chain.clone(), cell.varied());
        Self { index, label: label(&chain, &settings), chain, settings }
    }
}

pub fn list(wanted: &CellList) -> Result<(), Diagnostic> {
    let experiment = Experiment::load(&wanted.file)?;
    let finished = wanted.left.as_deref().map_or(Ok(BTreeSet::new()), finished)?;
    let settings = settings(&set(&wanted.set, wanted.frames))?;
    for (index, cell) in experiment.each_cell(&settings)?.enumerate() {
        let line = Line::new(index, &cell?);
        if finished.contains(&(line.chain.clone(), line.settings.clone())) {
            continue;
        }
        let text = serde_json::to_string(&line).map_err(|error| Diagnostic::run(error.to_string()))?;
        say!("{text}");
    }
    Ok(())
}

/// Chains and settings that have a record in a folder; none if there is no such folder yet.
fn finished(folder: &Path) -> Result<BTreeSet<(String, Vec<Varied>)>, Diagnostic> {
    if !folder.join("cells").exists() {
        return Ok(BTreeSet::new());
    }
    let store = Store::look(folder)?;
    Ok(store.named().map(|record| (record.head.chain, record.head.settings)).collect())
}

/// Which cells of an experiment are run.
#[derive(Default)]
pub struct Chosen {
    shard: Option<Shard>,
    named: Option<BTreeSet<(String, Vec<Varied>)>>,
}

impl Chosen {
    /// `cells` is a file of lines as [`list`] prints them, or `-` for standard input.
    pub fn new(shard: Option<Shard>, cells: Option<&Path>) -> Result<Self, Diagnostic> {
        let named = cells.map(|path| read(path).and_then(|(name, text)| lines(&name, &text))).transpose()?;
        Ok(Self { shard, named })
    }

    /// Refuses named cells of which the experiments have none.
    pub fn check_found(&self, found: usize) -> Result<(), Diagnostic> {
        match &self.named {
            Some(named) if found == 0 && !named.is_empty() => {
                Err(Diagnostic::input(format!("the experiment has none of the {} cells that are named", named.len()))
                    .help("`lodlab cells` lists cells by their settings: give it the same --set and --frames"))
            }
            _ => Ok(()),
        }
    }

    pub fn has(&self, at: usize, cell: &Cell) -> bool {
        let in_shard = self.shard.is_none_or(|shard| at % shard.of == shard.number - 1);
        in_shard && self.named.as_ref().is_none_or(|named| named.contains(&(cell.chain.clone(), cell.varied())))
    }
}

fn read(path: &Path) -> Result<(String, String), Diagnostic> {
    if path == Path::new("-") {
        let mut text = String::new();
        let read = std::io::stdin().read_to_string(&mut text);
        read.map_err(|error| Diagnostic::input(format!("standard input cannot be read: {error}")))?;
        return Ok(("standard input".into(), text));
    }
    let text = regular::read_to_string(path);
    let refuse = |error| Diagnostic::input(format!("cannot read the cells in `{}`: {error}", path.display()));
    Ok((path.display().to_string(), text.map_err(refuse)?))
}

fn lines(name: &str, text: &str) -> Result<BTreeSet<(String, Vec<Varied>)>, Diagnostic> {
    let source = Source::new(name, text);
    let mut start = 0;
    let mut cells = BTreeSet::new();
    for line in text.split_inclusive('\n') {
        let range = start..start + line.trim_end().len();
        start += line.len();
        if line.trim().is_empty() {
            continue;
        }
        let read: Line = serde_json::from_str(line).map_err(|error| {
            Diagnostic::input(format!("this is no cell: {error}"))
                .at(&Origin { source: source.clone(), range }, "expected a line as `lodlab cells FILE` prints it")
        })?;
        cells.insert((read.chain, read.settings));
    }
    Ok(cells)
}
