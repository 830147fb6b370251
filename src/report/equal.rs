//! Tables that answer which method wins: the time of each chain at equal error, its error at equal time, and what beats what.
//!
//! A chain's time at an error is the least of two kinds: of its cells that are at least so exact, and of places between two neighbours on one
//! of its curves (see [`super::standing::curves`]) where the error is just that, interpolated in the logarithms of both. Beyond its cells
//! nothing is known of a chain, and nothing is said.

use std::collections::BTreeMap;

use comfy_table::{CellAlignment, Table, presets};

use super::records::{Record, Results};
use super::standing::{self, Group, Point, Standing};
use super::table::digits;
use crate::measure::time;

/// Errors in pixels at which chains are compared.
const TARGETS_PX: [f64; 3] = [0.5, 1.0, 2.0];
/// The errors that are compared, where they were measured.
const ERRORS: [(&str, &str); 6] = [
    ("error_rms", "rms"),
    ("error_p99", "p99"),
    ("error_max", "max"),
    ("drawn_error_rms", "drawn rms"),
    ("drawn_error_p99", "drawn p99"),
    ("drawn_error_max", "drawn max"),
];
/// A logarithm of nothing is taken of this.
const NOTHING: f64 = 1e-6;

/// A table with a title.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    pub title: String,
    pub header: Vec<String>,
    pub rows: Vec<Vec<String>>,
    /// It answers the question that is asked first.
    pub is_first: bool,
}

/// Where a chain stands at a target.
#[derive(Clone, Debug, PartialEq)]
pub struct Reached {
    /// In the figure that is asked for: the time at an error, or the error at a time.
    pub value: f64,
    /// The same of each frame, if that is known.
    pub by_frame: Vec<Option<f64>>,
    /// What is held to the target there, which is less than the target where a cell is better than asked for.
    pub held: f64,
}

/// One chain of a group.
struct Chain<'a> {
    name: &'a str,
    records: &'a [Record],
    points: Vec<Point>,
    curves: Vec<Vec<Point>>,
}

/// Which figure is held to the target, and which is asked for.
#[derive(Clone, Copy, PartialEq)]
enum Asked {
    CostAtError,
    ErrorAtCost,
}

impl Asked {
    fn held(self, point: &Point) -> f64 {
        if self == Asked::CostAtError { point.error } else { point.cost }
    }

    fn wanted(self, point: &Point) -> f64 {
        if self == Asked::CostAtError { point.cost } else { point.error }
    }
}

impl Chain<'_> {
    fn reached(&self, asked: Asked, target: f64) -> Option<Reached> {
        let cells = self.points.iter().filter(|point| !point.is_faulty && asked.held(point) <= target);
        let cells = cells.map(|point| Reached {
            value: asked.wanted(point),
            by_frame: self.by_frame(asked, point),
            held: asked.held(point),
        });
        let pairs = self.curves.iter().flat_map(|curve| curve.windows(2));
        let between = pairs.filter_map(|pair| self.between(asked, &pair[0], &pair[1], target));
        cells.chain(between).min_by(|a, b| a.value.total_cmp(&b.value))
    }

    /// The place between two neighbours where the target is just met.
    fn between(&self, asked: Asked, a: &Point, b: &Point, target: f64) -> Option<Reached> {
        let (over, under) = if asked.held(a) > asked.held(b) { (a, b) } else { (b, a) };
        if !(asked.held(over) > target && asked.held(under) < target) {
            return None;
        }
        let ln = |value: f64| value.max(NOTHING).ln();
        let share = (ln(target) - ln(asked.held(over))) / (ln(asked.held(under)) - ln(asked.held(over)));
        let mix = |from: f64, to: f64| (ln(from) + share * (ln(to) - ln(from))).exp();
        let frames = self.by_frame(asked, over).into_iter().zip(self.by_frame(asked, under));
        let value = mix(asked.wanted(over), asked.wanted(under));
        let by_frame = frames.map(|(over, under)| Some(mix(over?, under?))).collect();
        Some(Reached { value, by_frame, held: target })
    }

    fn by_frame(&self, asked: Asked, point: &Point) -> Vec<Option<f64>> {
        match asked {
            Asked::CostAtError => {
                let record = self.records.get(point.record);
                record.map_or(Vec::new(), |record| record.timings.method_ms_by_frame.clone())
            }
            Asked::ErrorAtCost => Vec::new(),
        }
    }
}

fn chains<'a>(results: &'a Results, group: &Group, error: &str) -> Vec<Chain<'a>> {
    let points = standing::points(results, group, error, "method_ms");
    let chain = |name: &'a str| {
        let own = points.iter().filter(|point| results.records[point.record].head.chain == name);
        let points: Vec<Point> = own.copied().collect();
        let curves = standing::curves(&results.records, &points);
        Chain { name, records: &results.records, points, curves }
    };
    standing::chain_names(results, group).into_iter().map(chain).collect()
}

/// All answers for these results; none where there is nothing to compare. `baseline` is the chain that the others are compared with, else it is
/// the first.
pub fn answers(results: &Results, baseline: Option<&str>) -> Vec<Answer> {
    let standing = Standing::of(results);
    let has = |error: &str| results.records.iter().any(|record| record.measure(error).is_some());
    let mut errors: Vec<(&str, &str)> = ERRORS.into_iter().filter(|(error, _)| has(error)).collect();
    // what papers measure is asked for where nothing better was measured
    errors.truncate(3);
    let comparable = standing.groups.iter().filter(|group| group.records.len() > 1);
    comparable.flat_map(|group| of_group(results, group, &errors, baseline)).collect()
}

fn of_group(results: &Results, group: &Group, errors: &[(&str, &str)], baseline: Option<&str>) -> Vec<Answer> {
    let Some((first, _)) = errors.first() else { return Vec::new() };
    let of_scene = if group.label.is_empty() { String::new() } else { format!(" ({})", group.label) };
    let all = chains(results, group, first);
    if all.iter().all(|chain| chain.points.is_empty()) {
        return Vec::new();
    }
    let names: Vec<&str> = all.iter().map(|chain| chain.name).collect();
    let base = names.iter().position(|name| Some(*name) == baseline).unwrap_or(0);
    let mut by_error = Vec::new();
    for (error, shown) in errors {
        let all = chains(results, group, error);
        by_error.extend(
            TARGETS_PX.iter().map(|&target_px| {
                row(&format!("{shown} <= {target_px} px"), &all, Asked::CostAtError, target_px, base)
            }),
        );
    }
    let by_time = budgets_ms(&all)
        .into_iter()
        .map(|budget_ms| row(&format!("in {budget_ms} ms"), &all, Asked::ErrorAtCost, budget_ms, base));
    let header = |what: &str| std::iter::once(what).chain(names.iter().copied()).map(String::from).collect();
    let (fastest, least) = match names.len() {
        1 => (String::new(), ""),
        _ => (format!("; * fastest; x ratio to `{}` (quartiles over the frames)", names[base]), "; * least"),
    };
    let at_error = format!(
        "Time of the method in ms at equal error{of_scene}{fastest}; (at e): the error of its fastest such cell"
    );
    let at_time = format!("Error ({}) in px at equal time{of_scene}{least}", errors[0].1);
    let mut answers = vec![
        Answer { title: at_error, header: header("error"), rows: by_error, is_first: true },
        Answer { title: at_time, header: header("time"), rows: by_time.collect(), is_first: false },
    ];
    if names.len() > 1 {
        answers.push(beaten(results, group, first, &of_scene));
    }
    answers
}

/// What the chains reach, side by side.
fn row(name: &str, chains: &[Chain], asked: Asked, target: f64, base: usize) -> Vec<String> {
    let reached: Vec<Option<Reached>> = chains.iter().map(|chain| chain.reached(asked, target)).collect();
    let best = reached.iter().flatten().map(|reached| reached.value).fold(f64::INFINITY, f64::min);
    let is_at_error = asked == Asked::CostAtError;
    let cell = |(at, own): (usize, &Option<Reached>)| {
        let Some(own) = own else {
            let by_faulty = chains[at].points.iter().any(|point| point.is_faulty && asked.held(point) <= target);
            return if by_faulty { "only faulty" } else { "not reached" }.to_string();
        };
        let mut text = digits(own.value);
        if own.value <= best && reached.len() > 1 {
            text += " *";
        }
        // its fastest cell of those that reach it is much better than asked for
        if own.held < target / 2.0 && is_at_error {
            text += &format!(" (at {})", digits(own.held));
        }
        match &reached[base] {
            Some(base_reached) if at != base && is_at_error => text + &ratio(own, base_reached),
            _ => text,
        }
    };
    std::iter::once(name.to_string()).chain(reached.iter().enumerate().map(cell)).collect()
}

/// The ratio of two times, with the quartiles of the ratios of single frames.
fn ratio(own: &Reached, base: &Reached) -> String {
    let ratio = own.value / base.value;
    let frames = own.by_frame.iter().zip(&base.by_frame).filter_map(|(own, base)| Some((*own)? / (*base)?));
    let same_frames = own.by_frame.len() == base.by_frame.len() && own.by_frame.len() > 1;
    match time::spread(frames.collect()).filter(|_| same_frames) {
        Some(spread) => format!(", x{ratio:.2} ({:.2}..{:.2})", spread.lower_quartile, spread.upper_quartile),
        None => format!(", x{ratio:.2}"),
    }
}

/// Up to three round times between those of the fastest and of the slowest cell.
fn budgets_ms(chains: &[Chain]) -> Vec<f64> {
    let costs = chains.iter().flat_map(|chain| &chain.points).map(|point| point.cost);
    let (low, high) = costs.fold((f64::INFINITY, 0.0f64), |(low, high), cost| (low.min(cost), high.max(cost)));
    let round = (-6..=9).flat_map(|decade| [1.0, 2.0, 5.0].map(|digit: f64| digit * 10f64.powi(decade)));
    let inside: Vec<f64> = round.filter(|budget| *budget > low && *budget < high).collect();
    // the first, the last and the one in the middle
    match inside.len() {
        0..=3 => inside,
        count => vec![inside[0], inside[count / 2], inside[count - 1]],
    }
}

/// How many cells of each chain are on the front, and which chain beats most of the others.
fn beaten(results: &Results, group: &Group, error: &str, of_scene: &str) -> Answer {
    let points = standing::points(results, group, error, "method_ms");
    let front = standing::front(&points);
    let chain = |point: &Point| results.records[point.record].head.chain.as_str();
    let rows = standing::chain_names(results, group).into_iter().map(|name| {
        let own: Vec<&Point> = points.iter().filter(|point| chain(point) == name).collect();
        let on_front = front.iter().filter(|point| chain(point) == name).count();
        let faulty = own.iter().filter(|point| point.is_faulty).count();
        let mut by: BTreeMap<&str, usize> = BTreeMap::new();
        for point in &own {
            let mut winners: Vec<&str> =
                front.iter().filter(|other| standing::beats(other, point)).map(chain).collect();
            winners.sort_unstable();
            winners.dedup();
            winners.into_iter().for_each(|winner| *by.entry(winner).or_default() += 1);
        }
        let mut by: Vec<(&str, usize)> = by.into_iter().collect();
        by.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let by: Vec<String> = by.iter().map(|(winner, count)| format!("{winner} ({count})")).collect();
        vec![name.into(), own.len().to_string(), on_front.to_string(), by.join(", "), faulty.to_string()]
    });
    Answer {
        title: format!("What beats what, in {error} and method_ms{of_scene}"),
        header: ["chain", "cells", "on the front", "beaten by (cells)", "faulty"].map(String::from).to_vec(),
        rows: rows.collect(),
        is_first: false,
    }
}

impl Answer {
    /// As it stands on a terminal.
    pub fn text(&self) -> String {
        let mut table = Table::new();
        table.load_preset(presets::ASCII_MARKDOWN).set_header(&self.header);
        table.add_rows(&self.rows);
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        format!("{}\n{table}", self.title)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(points: &[(f64, f64)]) -> Chain<'static> {
        let point = |(record, &(cost, error)): (usize, &(f64, f64))| Point { record, cost, error, is_faulty: false };
        let points: Vec<Point> = points.iter().enumerate().map(point).collect();
        Chain { name: "a", records: &[], curves: vec![points.clone()], points }
    }

    fn value(chain: &Chain, asked: Asked, target: f64) -> Option<f64> {
        chain.reached(asked, target).map(|reached| reached.value)
    }

    #[test]
    fn between_two_cells_the_logarithms_are_on_a_line() {
        let curve = chain(&[(10.0, 4.0), (40.0, 0.25)]);
        assert!((value(&curve, Asked::CostAtError, 1.0).unwrap() - 20.0).abs() < 1e-9);
        assert!((value(&curve, Asked::ErrorAtCost, 20.0).unwrap() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn beyond_its_cells_nothing_is_said_of_a_chain() {
        let curve = chain(&[(10.0, 4.0), (40.0, 0.25)]);
        assert_eq!(value(&curve, Asked::CostAtError, 0.1), None);
        // more exact than asked for is fine, at its own time
        assert_eq!(value(&curve, Asked::CostAtError, 8.0), Some(10.0));
        assert_eq!(value(&curve, Asked::ErrorAtCost, 5.0), None);
    }
}
