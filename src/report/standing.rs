//! Which cells can be compared, which of them nothing beats, and which belong on one curve.
//!
//! Cells are compared that look at the same scene on the same adapter. What broke a bound or has holes is faulty: it is shown, but it beats
//! nobody and is on no curve.

use std::collections::{BTreeMap, BTreeSet};

use super::records::{Head, Record, Results};
use crate::experiment::sweep::Varied;

/// Cells that can be compared with each other.
#[derive(Debug)]
pub struct Group {
    /// What tells it from the others, empty if there is only one.
    pub label: String,
    /// Places in the records of the results.
    pub records: Vec<usize>,
}

#[derive(Debug)]
pub struct Standing {
    pub groups: Vec<Group>,
    labels: BTreeMap<(String, String), String>,
}

type Key = (String, String);

fn key(head: &Head) -> Key {
    (head.scene.key.clone(), head.identity.adapter.clone())
}

impl Standing {
    pub fn of(results: &Results) -> Self {
        let mut keys: Vec<Key> = Vec::new();
        for head in results.heads() {
            let key = key(head);
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
        let labels = labels(results, &keys);
        let group = |of: &Key| {
            let own = |at: &usize| key(&results.records[*at].head) == *of;
            Group { label: labels[of].clone(), records: (0..results.records.len()).filter(own).collect() }
        };
        Self { groups: keys.iter().map(group).filter(|group| !group.records.is_empty()).collect(), labels }
    }

    /// What a cell looks at, as its group is called.
    pub fn scene_label(&self, head: &Head) -> &str {
        self.labels.get(&key(head)).map_or("", String::as_str)
    }
}

/// What each group is called: by the settings of the scene that are not the same in all groups, or else by what else differs.
fn labels(results: &Results, keys: &[Key]) -> BTreeMap<Key, String> {
    let name = |setting: &Varied| match setting.path == "scene" {
        true => setting.shown_value(),
        false => format!("{}={}", setting.shown_axis(), setting.shown_value()),
    };
    let mut named: BTreeMap<Key, Vec<String>> = keys.iter().map(|key| (key.clone(), Vec::new())).collect();
    for head in results.heads() {
        let own = named.entry(key(head)).or_default();
        for name in head.settings.iter().filter(|setting| setting.is_of_scene()).map(name) {
            if !own.contains(&name) {
                own.push(name);
            }
        }
    }
    let everywhere = |name: &String| named.values().all(|names| names.contains(name));
    let adapters: BTreeSet<&str> = keys.iter().map(|(_, adapter)| adapter.as_str()).collect();
    let scenes: BTreeSet<&str> = keys.iter().map(|(scene, _)| scene.as_str()).collect();
    let label = |key: &Key| {
        let mut parts: Vec<String> = named[key].iter().filter(|name| !everywhere(name)).cloned().collect();
        let head = results.heads().find(|head| self::key(head) == *key);
        if let Some(head) = head.filter(|_| parts.is_empty() && scenes.len() > 1) {
            let (columns, rows) = head.scene.viewport;
            parts.push(format!("{} {columns}x{rows}", head.experiment));
        }
        if let Some(head) = head.filter(|_| adapters.len() > 1) {
            parts.push(format!("on {}", head.adapter.name));
        }
        parts.join(", ")
    };
    keys.iter().map(|key| (key.clone(), label(key))).collect()
}

/// A cell as a point: less is better in both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Place in the records.
    pub record: usize,
    pub cost: f64,
    pub error: f64,
    pub is_faulty: bool,
}

/// The points of cells that have both figures.
pub fn points(results: &Results, group: &Group, error: &str, cost: &str) -> Vec<Point> {
    let point = |&record: &usize| {
        let found = &results.records[record];
        let (error, cost) = (found.figure(error)?, found.figure(cost)?);
        let is_faulty = !found.faults().is_empty();
        // what is no number, or below nothing, has no place among errors and times
        (error >= 0.0 && cost >= 0.0).then_some(Point { record, cost, error, is_faulty })
    };
    group.records.iter().filter_map(point).collect()
}

/// As fast and as exact, and better in one of the two.
pub fn beats(a: &Point, b: &Point) -> bool {
    a.cost <= b.cost && a.error <= b.error && (a.cost < b.cost || a.error < b.error)
}

/// Points that no other is both as fast and as exact as, by cost.
pub fn front(points: &[Point]) -> Vec<Point> {
    let mut sound: Vec<Point> = points.iter().filter(|point| !point.is_faulty).copied().collect();
    sound.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.error.total_cmp(&b.error)));
    let mut front: Vec<Point> = Vec::new();
    for point in sound {
        if front.last().is_none_or(|last| !beats(last, &point)) {
            front.push(point);
        }
    }
    front
}

/// The axis along which a curve goes, and what is the same in all of its points.
type CurveKey<'a> = (String, Vec<&'a Varied>);
/// A point with its value on the axis of its curve.
type Placed = (Vec<f64>, Point);

/// Curves through the points of one chain: each joins sound points that differ in one axis of numbers alone, in the order of that axis. A
/// chain without such an axis has no curve, and a curve ends where a faulty cell stands: of what is beyond it nothing is known in between.
pub fn curves(records: &[Record], points: &[Point]) -> Vec<Vec<Point>> {
    let mut curves: BTreeMap<CurveKey, Vec<Placed>> = BTreeMap::new();
    for point in points {
        let settings = &records[point.record].head.settings;
        let axes: BTreeSet<&str> =
            settings.iter().filter(|setting| !setting.is_of_scene()).map(|setting| setting.axis.as_str()).collect();
        for axis in axes {
            let (own, others): (Vec<&Varied>, Vec<&Varied>) = settings.iter().partition(|setting| setting.axis == axis);
            let value: Option<Vec<Vec<f64>>> = own.iter().map(|setting| setting.numbers()).collect();
            if let Some(value) = value {
                // of the scene, everything that matters is the same in a group
                let others = others.into_iter().filter(|setting| !setting.is_of_scene()).collect();
                curves.entry((axis.into(), others)).or_default().push((value.concat(), *point));
            }
        }
    }
    let order = |a: &Placed, b: &Placed| a.0.partial_cmp(&b.0).unwrap_or(std::cmp::Ordering::Equal);
    let sorted = curves.into_values().flat_map(|mut curve| {
        curve.sort_by(order);
        let points: Vec<Point> = curve.into_iter().map(|(_, point)| point).collect();
        let sound = points.split(|point| point.is_faulty).filter(|part| part.len() > 1);
        sound.map(<[Point]>::to_vec).collect::<Vec<_>>()
    });
    sorted.collect()
}

/// The chains of a group, in the order of the records.
pub fn chain_names<'a>(results: &'a Results, group: &Group) -> Vec<&'a str> {
    let mut names: Vec<&str> = Vec::new();
    for &at in &group.records {
        let name = results.records[at].head.chain.as_str();
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(record: usize, cost: f64, error: f64) -> Point {
        Point { record, cost, error, is_faulty: false }
    }

    #[test]
    fn the_front_has_what_nothing_beats() {
        let points =
            [point(0, 1.0, 8.0), point(1, 2.0, 4.0), point(2, 3.0, 4.0), point(3, 4.0, 1.0), point(4, 5.0, 2.0)];
        let on_front = |points: &[Point]| front(points).iter().map(|point| point.record).collect::<Vec<_>>();
        assert_eq!(on_front(&points), [0, 1, 3]);
        // of two equal points both are on it
        assert_eq!(on_front(&[point(0, 1.0, 1.0), point(1, 1.0, 1.0)]), [0, 1]);
        let mut faulty = points;
        faulty[3].is_faulty = true;
        assert_eq!(on_front(&faulty), [0, 1, 4]);
    }
}
