//! The results of one or several folders together: of machines, adapters or versions.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::records::{FORMAT, Failure, Head, Record, Results};
use super::store::{OTHER_VERSION, Store};
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
    let mut by_cell: BTreeMap<String, Vec<(usize, Record)>> = BTreeMap::new();
    let mut failures: Vec<(usize, Failure)> = Vec::new();
    for (at, folder) in folders.iter().enumerate() {
        let store = Store::look(folder)?;
        found.excluded.extend(store.refused.iter().map(|(path, why)| format!("`{}` {why}", path.display())));
        failures.extend(store.failures().into_iter().map(|failure| (at, failure)));
        for record in store.named() {
            if record.head.identity.format != FORMAT {
                found.excluded.push(format!("cell {} of `{}` {OTHER_VERSION}", record.head.hash, folder.display()));
                continue;
            }
            // what decides the results, and what the cell is called
            by_cell.entry(format!("{} {:?}", record.head.hash, record.head.point())).or_default().push((at, record));
        }
    }
    let mut records: Vec<(usize, Record)> = Vec::new();
    for same in by_cell.into_values() {
        match agreed(same) {
            Ok(one) => records.push(one),
            Err(why) => found.excluded.push(why),
        }
    }
    let all = records.len();
    let records = newest(records, |record| &record.head);
    found.superseded = all - records.len();
    // a cell of a folder that failed once and then did not is finished, also if something had to be changed for it
    let place = |at: usize, head: &Head| format!("{at} {:?}", head.point());
    let finished: BTreeSet<String> = records.iter().map(|(at, record)| place(*at, &record.head)).collect();
    failures.retain(|(at, failure)| !finished.contains(&place(*at, &failure.head)));
    let mut known = BTreeSet::new();
    let failures = newest(failures, |failure| &failure.head).into_iter().map(|(_, failure)| failure);
    found.results.failures = failures.filter(|failure| known.insert(failure.head.hash.clone())).collect();
    found.results.records = told_apart(records, folders);
    found.results.records.sort_by(|a, b| order(&a.head, &b.head));
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

/// Of what stands at the same place of the same experiment in one folder, the one that was run last.
fn newest<T>(all: Vec<(usize, T)>, head: impl Fn(&T) -> &Head) -> Vec<(usize, T)> {
    let mut newest: Vec<(usize, T)> = Vec::new();
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    for (folder, one) in all {
        let key = format!("{folder} {:?}", head(&one).point());
        match places.get(&key) {
            None => {
                places.insert(key, newest.len());
                newest.push((folder, one));
            }
            Some(&at) if head(&newest[at].1).made.date < head(&one).made.date => newest[at] = (folder, one),
            Some(_) => {}
        }
    }
    newest
}

/// Chains that are not the same under one name: where two folders have results of the same cells, the chain says which folder it is from, and
/// where two experiments have chains of one name, which experiment.
fn told_apart(records: Vec<(usize, Record)>, folders: &[PathBuf]) -> Vec<Record> {
    let mut folders_of: BTreeMap<String, BTreeSet<usize>> = BTreeMap::new();
    let mut experiments_of: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (folder, record) in &records {
        folders_of.entry(format!("{:?}", record.head.point())).or_default().insert(*folder);
        experiments_of.entry(&record.head.chain).or_default().insert(&record.head.experiment);
    }
    let is_twice = |record: &Record| folders_of[&format!("{:?}", record.head.point())].len() > 1;
    let in_folders: BTreeSet<String> =
        records.iter().filter(|(_, record)| is_twice(record)).map(|(_, record)| record.head.chain.clone()).collect();
    let several = experiments_of.into_iter().filter(|(_, experiments)| experiments.len() > 1);
    let in_experiments: BTreeSet<String> = several.map(|(chain, _)| chain.to_string()).collect();
    let named = |(folder, mut record): (usize, Record)| {
        let chain = record.head.chain.clone();
        if in_experiments.contains(&chain) {
            record.head.chain = format!("{} ({})", record.head.chain, record.head.experiment);
        }
        if in_folders.contains(&chain) {
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
    /// The chain that the experiments compare the others with, if they agree on one.
    pub fn baseline(&self) -> Option<&str> {
        let named: BTreeSet<&str> = self.results.heads().filter_map(|head| head.baseline.as_deref()).collect();
        named.first().copied().filter(|_| named.len() == 1)
    }

    /// A file of the results, from the first folder that has it.
    pub fn file(&self, name: &str) -> Option<PathBuf> {
        self.folders.iter().map(|folder| folder.join(name)).find(|path| path.is_file())
    }
}
