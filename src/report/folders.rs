//! The results of one or several folders together: of machines, adapters or versions.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::records::{Head, Record, Results};
use super::store::{self, Store};
use crate::experiment::diagnostic::Diagnostic;

/// What was found in folders.
#[derive(Debug, Default)]
pub struct Found {
    pub results: Results,
    /// What is left out because something is wrong with it, each with the reason.
    pub excluded: Vec<String>,
    /// Records whose cell was run again with something changed.
    pub superseded: usize,
    pub folders: Vec<PathBuf>,
}

/// Reads what is finished in some folders, also while a run writes into them.
pub fn read(folders: &[PathBuf]) -> Result<Found, Diagnostic> {
    let mut found = Found { folders: folders.to_vec(), ..Found::default() };
    // what decides the results, and what the cell is called
    let mut by_hash: BTreeMap<String, Vec<(usize, Record)>> = BTreeMap::new();
    for (at, folder) in folders.iter().enumerate() {
        let store = Store::look(folder)?;
        found.excluded.extend(store.refused.iter().map(|(path, why)| format!("`{}` {why}", path.display())));
        found.results.failures.extend(store.failures());
        for record in store.named() {
            let name = format!(
                "{} {} {} {:?}",
                record.head.hash, record.head.experiment, record.head.chain, record.head.settings
            );
            by_hash.entry(name).or_default().push((at, record));
        }
    }
    let mut records: Vec<(usize, Record)> = Vec::new();
    for same in by_hash.into_values() {
        match agreed(same) {
            Ok(one) => records.push(one),
            Err(why) => found.excluded.push(why),
        }
    }
    let all = records.len();
    let records = newest(records);
    found.superseded = all - records.len();
    found.results.records = told_apart(records, folders);
    found.results.records.sort_by(|a, b| order(&a.head, &b.head));
    // a cell that failed once and then did not is finished, also if something had to be changed for it
    let is_finished = |head: &Head| found.results.records.iter().any(|record| record.head.is_same_point(head));
    found.results.failures.retain(|failure| !is_finished(&failure.head));
    found.results.failures.dedup_by(|a, b| a.head.hash == b.head.hash);
    Ok(found)
}

/// The record that several of one cell have in common; what decides the results is the same, so the results have to be.
fn agreed(same: Vec<(usize, Record)>) -> Result<(usize, Record), String> {
    let (_, first) = &same[0];
    for (_, other) in &same[1..] {
        let differing = first.measures.iter().find(|figure| !other.measures.contains(figure));
        if let Some(figure) = differing {
            return Err(format!(
                "the records of {} (cell {}) do not agree: `{}` is {:?} in one and {:?} in another",
                first.label(),
                first.head.hash,
                figure.name,
                figure.value,
                other.measure(&figure.name)
            ));
        }
        if first.buffers != other.buffers {
            let (label, hash) = (first.label(), &first.head.hash);
            return Err(format!(
                "the records of {label} (cell {hash}) do not agree: their buffers have other contents"
            ));
        }
    }
    // of those that agree, the one that was run last
    let newest = same.into_iter().max_by(|(_, a), (_, b)| a.head.made.date.cmp(&b.head.made.date));
    newest.ok_or_else(|| "there is none".into())
}

/// Of records of one folder that stand at the same place of the same experiment, the one that was run last.
fn newest(records: Vec<(usize, Record)>) -> Vec<(usize, Record)> {
    let mut newest: Vec<(usize, Record)> = Vec::new();
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    for (folder, record) in records {
        let Head { experiment, chain, settings, identity, .. } = &record.head;
        let key = format!("{folder} {experiment} {chain} {settings:?} {}", identity.adapter);
        match places.get(&key) {
            None => {
                places.insert(key, newest.len());
                newest.push((folder, record));
            }
            Some(&at) if newest[at].1.head.made.date < record.head.made.date => newest[at] = (folder, record),
            Some(_) => {}
        }
    }
    newest
}

/// Where two folders have other results for the same cells, the chain says which folder it is from.
fn told_apart(records: Vec<(usize, Record)>, folders: &[PathBuf]) -> Vec<Record> {
    let is_elsewhere = |folder: usize, head: &Head| {
        records.iter().any(|(other, record)| *other != folder && record.head.is_same_point(head))
    };
    let twice: Vec<bool> = match folders.len() {
        1 => vec![false; records.len()],
        _ => records.iter().map(|(folder, record)| is_elsewhere(*folder, &record.head)).collect(),
    };
    let twofold: Vec<String> = records
        .iter()
        .zip(&twice)
        .filter(|(_, twice)| **twice)
        .map(|((_, record), _)| record.head.chain.clone())
        .collect();
    let named = |(folder, mut record): (usize, Record)| {
        if twofold.contains(&record.head.chain) {
            record.head.chain = format!("{} [{}]", record.head.chain, folders[folder].display());
        }
        record
    };
    records.into_iter().map(named).collect()
}

/// Chain by chain, and within a chain by what was varied, numbers as numbers.
fn order(a: &Head, b: &Head) -> std::cmp::Ordering {
    let numbers = |head: &Head| head.settings.iter().map(|setting| setting.numbers()).collect::<Vec<_>>();
    let by_numbers = numbers(a).partial_cmp(&numbers(b)).unwrap_or(std::cmp::Ordering::Equal);
    let by_experiment = a.experiment.cmp(&b.experiment);
    by_experiment.then(a.chain.cmp(&b.chain)).then(by_numbers).then_with(|| a.settings.cmp(&b.settings))
}

impl Found {
    /// A file of the results, from the first folder that has it.
    pub fn file(&self, name: &str) -> Option<PathBuf> {
        self.folders.iter().map(|folder| folder.join(name)).find(|path| path.is_file())
    }

    /// Writes a file into a folder, whole or not at all.
    pub fn write_into(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), Diagnostic> {
        store::write_file(folder, name, bytes)
    }
}
