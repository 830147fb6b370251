//! Two runs of the same cells: before and after a change, or on two adapters. Per cell: the same, faster, slower or undecided, by the spread
//! of its own samples, and every figure that is another one.

use std::collections::{BTreeMap, BTreeSet};

use super::records::{Failure, Head, Record, Results};
use super::table::digits;
use crate::measure::time::{self, Spread};

/// What counts as a change.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Ratios nearer to 1 than that are the same.
    pub resolution: f64,
    /// A cell that takes longer than so many times as long, beyond doubt, is too slow.
    pub most_slower: Option<f64>,
    /// A figure that is an error may grow by so much of its unit.
    pub most_worse: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    Same,
    Faster,
    Slower,
    Undecided,
}

/// A cell in both runs.
#[derive(Debug)]
pub struct Pair {
    pub label: String,
    pub before_ms: Option<f64>,
    pub after_ms: Option<f64>,
    /// After over before, with the ends of what it may be.
    pub ratio: Option<(f64, f64, f64)>,
    pub verdict: Verdict,
    /// Figures that differ: name, before, after.
    pub changed: Vec<(String, Option<f64>, Option<f64>)>,
    /// What passes a limit.
    pub beyond: Vec<String>,
}

#[derive(Debug, Default)]
pub struct Comparison {
    pub pairs: Vec<Pair>,
    /// Cells that had results before and have none after, with the reason.
    pub failed: Vec<(String, String)>,
    /// Labels of cells that only one of the runs has.
    pub only_before: Vec<String>,
    pub only_after: Vec<String>,
}

/// What makes two cells the same, whatever computed them and where.
fn cell_key(head: &Head) -> String {
    let Head { experiment, chain, settings, scene, .. } = head;
    format!("{experiment} {chain} {settings:?} {:?} {}", scene.viewport, scene.frames)
}

/// Pairs each cell with the one of the other run that has its name, on the same adapter if there are several.
pub fn compare(before: &Results, after: &Results, limits: &Limits) -> Comparison {
    let mut comparison = Comparison::default();
    let mut others: BTreeMap<String, Vec<&Record>> = BTreeMap::new();
    for record in &after.records {
        others.entry(cell_key(&record.head)).or_default().push(record);
    }
    let failed: BTreeMap<String, &Failure> =
        after.failures.iter().map(|failure| (cell_key(&failure.head), failure)).collect();
    let mut paired = BTreeSet::new();
    for own in &before.records {
        let key = cell_key(&own.head);
        let others = others.get(&key).map_or(&[][..], Vec::as_slice);
        let is_on_same = |other: &&&Record| other.head.identity.adapter == own.head.identity.adapter;
        let other = others.iter().find(is_on_same).or(others.first().filter(|_| others.len() == 1));
        match (other, failed.get(&key)) {
            (Some(other), _) => {
                paired.insert(other.head.hash.clone());
                comparison.pairs.push(pair(own, other, limits));
            }
            (None, Some(failure)) => comparison.failed.push((own.label(), failure.why.clone())),
            (None, None) => comparison.only_before.push(own.label()),
        }
    }
    let is_new = |record: &&Record| !paired.contains(&record.head.hash);
    comparison.only_after = after.records.iter().filter(is_new).map(Record::label).collect();
    comparison
}

fn pair(before: &Record, after: &Record, limits: &Limits) -> Pair {
    let ratio = ratio(&before.timings.method_ms_by_frame, &after.timings.method_ms_by_frame)
        .or_else(|| ratio_of_spreads(before.method()?, after.method()?));
    let verdict = ratio.map_or(Verdict::Undecided, |ratio| verdict(ratio, limits.resolution));
    let mut beyond = Vec::new();
    if let (Some((ratio, low, _)), Some(most)) = (ratio, limits.most_slower)
        && low > most
    {
        beyond.push(format!("takes {ratio:.2} times as long, the limit is {most}"));
    }
    if ratio.is_none() && limits.most_slower.is_some() {
        beyond.push("has too few samples to say how much longer it takes: time it more often".into());
    }
    let changed = changed(before, after);
    for (name, old, new) in &changed {
        let is_error = crate::measure::known(name).is_some_and(|known| known.kind == crate::measure::Kind::Error);
        match (limits.most_worse.filter(|_| is_error), old, new) {
            (Some(most), Some(old), Some(new)) if new - old > most => {
                beyond.push(format!("{name} grows by {}, the limit is {most}", digits(new - old)));
            }
            (Some(_), Some(_), None) => beyond.push(format!("{name} is not measured any more")),
            _ => {}
        }
    }
    if before.faults().is_empty() && !after.faults().is_empty() && limits.most_worse.is_some() {
        beyond.push(after.faults().join(", "));
    }
    let (before_ms, after_ms) = (before.method_ms(), after.method_ms());
    Pair { label: before.label(), before_ms, after_ms, ratio, verdict, changed, beyond }
}

/// The median of the ratios of the frames, and what it may be: the median with its 95 % interval from the quartiles (McGill, Tukey, Larsen
/// 1978). Frames are compared one by one, since they differ more from each other than from themselves. `None` of fewer than three.
fn ratio(before: &[Option<f64>], after: &[Option<f64>]) -> Option<(f64, f64, f64)> {
    let both = before.iter().zip(after).filter_map(|(before, after)| Some(((*after)? / (*before)?).ln()));
    let spread = time::spread(both.collect()).filter(|spread| spread.samples >= 3 && before.len() == after.len())?;
    let half = 1.57 * (spread.upper_quartile - spread.lower_quartile) / (spread.samples as f64).sqrt();
    Some((spread.median.exp(), (spread.median - half).exp(), (spread.median + half).exp()))
}

/// The same of medians over all samples, where there are too few frames to compare one by one.
fn ratio_of_spreads(before: &Spread, after: &Spread) -> Option<(f64, f64, f64)> {
    let ends = |spread: &Spread| {
        let half = 1.57 * (spread.upper_quartile - spread.lower_quartile) / (spread.samples as f64).sqrt();
        (spread.samples >= 3 && spread.median > half).then_some((spread.median - half, spread.median + half))
    };
    let ((before_low, before_high), (after_low, after_high)) = (ends(before)?, ends(after)?);
    Some((after.median / before.median, after_low / before_high, after_high / before_low))
}

fn verdict((_, low, high): (f64, f64, f64), resolution: f64) -> Verdict {
    let (least, most) = (1.0 / (1.0 + resolution), 1.0 + resolution);
    match () {
        () if high < least => Verdict::Faster,
        () if low > most => Verdict::Slower,
        () if low >= least && high <= most => Verdict::Same,
        () => Verdict::Undecided,
    }
}

fn changed(before: &Record, after: &Record) -> Vec<(String, Option<f64>, Option<f64>)> {
    let mut names: Vec<&str> = before.measures.iter().map(|figure| figure.name.as_str()).collect();
    names
        .extend(after.measures.iter().map(|figure| figure.name.as_str()).filter(|name| before.measure(name).is_none()));
    names.dedup();
    let both = names.into_iter().map(|name| (name.to_string(), before.measure(name), after.measure(name)));
    both.filter(|(_, before, after)| before != after).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(ratios: &[f64]) -> Verdict {
        let before: Vec<Option<f64>> = (1..=ratios.len()).map(|frame| Some(frame as f64 * 7.0)).collect();
        let after: Vec<Option<f64>> = before.iter().zip(ratios).map(|(ms, ratio)| Some(ms.unwrap() * ratio)).collect();
        ratio(&before, &after).map_or(Verdict::Undecided, |ratio| verdict(ratio, 0.05))
    }

    #[test]
    fn the_spread_of_the_frames_decides() {
        assert_eq!(of(&[1.01, 0.99, 1.0, 1.02, 0.98]), Verdict::Same);
        assert_eq!(of(&[1.21, 1.19, 1.2, 1.22, 1.18]), Verdict::Slower);
        assert_eq!(of(&[0.81, 0.79, 0.8, 0.82, 0.78]), Verdict::Faster);
        // the same median, but it can as well be nothing
        assert_eq!(of(&[1.2, 0.6, 1.8, 1.3, 0.8]), Verdict::Undecided);
        // of two frames nothing is known
        assert_eq!(of(&[2.0, 2.0]), Verdict::Undecided);
    }
}
