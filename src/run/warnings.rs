//! What is probably not meant in a sweep, and nothing refuses: a stage that does not run, an axis that changes nothing.

use std::collections::{BTreeMap, BTreeSet};

use crate::experiment::Cell;
use crate::experiment::sweep::Varied;
use crate::plan::Plan;
use crate::report::records::Identity;

/// Stages that no cell runs although the file names them.
#[derive(Default)]
pub struct Idle {
    /// By chain, place in it and name: why a stage does not run, or nothing if some cell runs it.
    stages: BTreeMap<(String, usize, String), Option<String>>,
}

impl Idle {
    pub fn look(&mut self, cell: &Cell, plan: &Plan) {
        for (at, call) in cell.stages.iter().enumerate() {
            let own = |stage: &str| stage == call.name || stage.split('#').next() == Some(call.name.as_str());
            let runs = plan.steps.iter().any(|step| step.stage_index == at && !step.is_tap());
            let left_out = plan.left_out.iter().find(|left| left.what.split(": ").next().is_some_and(own));
            // a stage without steps has nothing that could be left out
            let why = match (runs, left_out) {
                (false, Some(left)) => Some(format!("{}{}", left.reason, likely(&left.reason, plan))),
                _ => None,
            };
            let known = self.stages.entry((cell.chain.clone(), at, call.name.clone()));
            known.and_modify(|known| *known = known.take().and(why.clone())).or_insert(why);
        }
    }

    /// A line for each.
    pub fn told(self) -> Vec<String> {
        let mut by_stage: BTreeMap<(String, String), BTreeSet<String>> = BTreeMap::new();
        for ((chain, _, stage), why) in self.stages {
            if let Some(why) = why {
                by_stage.entry((stage, why)).or_default().insert(format!("`{chain}`"));
            }
        }
        let line = |((stage, why), chains): ((String, String), BTreeSet<String>)| {
            let chains: Vec<String> = chains.into_iter().collect();
            format!("`{stage}` does not run in {}: {why}", chains.join(", "))
        };
        by_stage.into_iter().map(line).collect()
    }
}

/// A buffer of the plan with almost the name of one that nobody reads.
fn likely(reason: &str, plan: &Plan) -> String {
    let unread: Vec<&str> = reason.split('`').skip(1).step_by(2).collect();
    let names = plan.buffers.iter().map(|buffer| buffer.name.as_str());
    let pairs = names.flat_map(|name| unread.iter().map(move |unread| (strsim::jaro_winkler(name, unread), name)));
    let others = pairs.filter(|(likeness, name)| *likeness > LIKE && !unread.contains(name));
    let best = others.max_by(|(a, _), (b, _)| a.total_cmp(b));
    best.map_or(String::new(), |(_, name)| format!(" (did you mean `{name}`?)"))
}

/// Names at least so much alike can be a slip of each other.
const LIKE: f64 = 0.93;

/// Hashes of cells, by what they do not have in common.
type Group<'a> = BTreeMap<Vec<&'a Varied>, Vec<String>>;

/// A line for each axis whose values all compute the same in a chain.
pub fn axes<'a>(cells: impl Iterator<Item = (&'a Cell, &'a Identity)>) -> Vec<String> {
    // by chain and axis: the hashes of the cells that differ in nothing else
    let mut groups: BTreeMap<(&str, String), Group> = BTreeMap::new();
    for (cell, identity) in cells {
        let axes: BTreeSet<&str> = cell.settings.iter().map(|setting| setting.axis.as_str()).collect();
        for axis in axes {
            let others = cell.settings.iter().filter(|setting| setting.axis != axis).collect();
            let group = groups.entry((&cell.chain, axis.to_string())).or_default();
            group.entry(others).or_default().push(identity.hash());
        }
    }
    let is_idle = |hashes: &Vec<String>| hashes.iter().all(|hash| *hash == hashes[0]);
    let idle = groups
        .into_iter()
        .filter(|(_, groups)| groups.values().all(is_idle) && groups.values().any(|hashes| hashes.len() > 1));
    idle.map(|((chain, axis), _)| format!("the axis `{axis}` changes nothing that runs in `{chain}`")).collect()
}
