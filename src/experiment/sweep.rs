//! Sweep axes to cells: every parameter of an experiment can be an axis.

use std::collections::HashSet;
use std::sync::Arc;

use serde::Deserialize;

use super::diagnostic::{Diagnostic, Origin, Source};
use super::tree::{Kind, Node};

/// One axis: paths that change together, and the values they take.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Where the paths were written.
    pub key: Origin,
    /// As written, without the quotes.
    pub name: String,
    pub paths: Vec<String>,
    /// One row a step, one value a path.
    pub rows: Vec<Vec<Node>>,
}

/// One value of one path, as the user would write it.
#[derive(Clone, Debug)]
pub struct Setting {
    pub path: String,
    pub key: Origin,
    pub value: Node,
}

/// Cells that an experiment has at most. The more it asks for, the more likely it is a slip: so many take days.
pub const MOST_CELLS: usize = 50_000;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
enum Spaced {
    /// `steps` values, evenly spaced, both ends included.
    Linear { from: f64, to: f64, steps: u32 },
    /// `steps` values, evenly spaced in the logarithm, both ends included.
    Log { from: f64, to: f64, steps: u32 },
    /// From `from` by `step` up to and including `to`.
    Range { from: f64, to: f64, step: f64 },
}

/// Reads `sweep: { "path": values, "path, path": [(value, value), ...] }`.
pub fn read_axes(node: &Node) -> Result<Vec<Axis>, Diagnostic> {
    let Kind::Map(entries) = &node.kind else {
        return Err(Diagnostic::input("`sweep` is a map from paths to values").at(&node.origin, "expected `{ ... }`"));
    };
    entries.iter().map(|(key, values)| read_axis(key, values)).collect()
}

fn read_axis(key: &Node, values: &Node) -> Result<Axis, Diagnostic> {
    let name: String = key.parse()?;
    let paths: Vec<String> = name.split(',').map(|path| path.trim().to_string()).collect();
    if values.items().len() > MOST_CELLS {
        return Err(Diagnostic::input(format!("this axis has {} values", values.items().len()))
            .at(&key.origin, format!("expected at most {MOST_CELLS}")));
    }
    let rows = match &values.kind {
        Kind::List(items) if paths.len() == 1 => items.iter().map(|item| vec![item.clone()]).collect(),
        Kind::List(items) => items.iter().map(|item| zipped_row(item, paths.len())).collect::<Result<_, _>>()?,
        _ if paths.len() > 1 => {
            return Err(Diagnostic::input("an axis over several paths needs a list of tuples")
                .at(&values.origin, format!("expected [({})]", vec!["value"; paths.len()].join(", "))));
        }
        _ => spaced(values)?,
    };
    let rows: Vec<Vec<Node>> = rows;
    let mut seen = HashSet::new();
    for row in &rows {
        let text = row.iter().map(Node::canonical).collect::<Vec<_>>().join(" ");
        if let Some(text) = seen.replace(text) {
            return Err(
                Diagnostic::input(format!("this axis has the value {text} twice")).at(&values.origin, "in here")
            );
        }
    }
    if rows.is_empty() {
        return Err(Diagnostic::input("this axis has no values, so nothing would run").at(&values.origin, "empty"));
    }
    Ok(Axis { key: key.origin.clone(), name, paths, rows })
}

fn zipped_row(item: &Node, width: usize) -> Result<Vec<Node>, Diagnostic> {
    match &item.kind {
        Kind::Tuple { name: None, items } if items.len() == width => Ok(items.clone()),
        _ => Err(Diagnostic::input(format!("this axis changes {width} paths together"))
            .at(&item.origin, format!("expected a tuple of {width} values"))),
    }
}

fn spaced(node: &Node) -> Result<Vec<Vec<Node>>, Diagnostic> {
    let bad = |why: &str| Diagnostic::input(why).at(&node.origin, "this axis");
    let values: Vec<f64> = match node.parse::<Spaced>()? {
        Spaced::Linear { steps, .. } | Spaced::Log { steps, .. } if steps as usize > MOST_CELLS => {
            return Err(bad("this axis has too many steps"));
        }
        Spaced::Linear { from, to, steps } => linear(from, to, steps).into_iter().map(round_off).collect(),
        Spaced::Log { from, to, .. } if !(from > 0.0 && to > 0.0) => {
            return Err(bad("logarithmic steps need both ends above zero"));
        }
        Spaced::Log { from, to, steps } => {
            let mut values: Vec<f64> =
                linear(from.ln(), to.ln(), steps).into_iter().map(|log| round_off(log.exp())).collect();
            // the ends are what was asked for, not what came back from the logarithm
            let last = values.len().saturating_sub(1);
            values.iter_mut().take(1).for_each(|first| *first = from);
            values.iter_mut().skip(last.max(1)).for_each(|value| *value = to);
            values
        }
        Spaced::Range { from, to, step } => {
            let count = ((to - from) / step + 1e-9).floor();
            if !(0.0..MOST_CELLS as f64).contains(&count) {
                return Err(bad("this range never arrives, or has too many steps"));
            }
            (0..=count as u32).map(|i| round_off(from + f64::from(i) * step)).collect()
        }
    };
    let (line, _) = node.origin.line_column();
    let name = format!("{}, value of the axis on line {line}", node.origin.source.name);
    Ok(values.into_iter().map(|value| vec![leaf(&Source::new(name.clone(), value.to_string()))]).collect())
}

fn linear(from: f64, to: f64, steps: u32) -> Vec<f64> {
    match steps {
        0 => Vec::new(),
        1 => vec![from],
        _ => (0..steps).map(|i| from + (to - from) * f64::from(i) / f64::from(steps - 1)).collect(),
    }
}

/// Twelve digits: 0.1 + 0.2 should read 0.3 in a report, and 4.000000000000001 should still be a grid size.
fn round_off(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

fn leaf(source: &Arc<Source>) -> Node {
    Node { origin: Origin { source: source.clone(), range: 0..source.text.len() }, kind: Kind::Leaf }
}

/// Reads a `--set PATH=VALUE` argument.
pub fn read_setting(argument: &str) -> Result<Setting, Diagnostic> {
    let source = Source::new("--set", argument);
    let Some(equals) = argument.find('=') else {
        return Err(Diagnostic::input("`--set` takes PATH=VALUE")
            .at(&Origin { source, range: 0..argument.len() }, "there is no `=` here"));
    };
    let key = Origin { source: source.clone(), range: 0..equals };
    Ok(Setting { path: argument[..equals].trim().to_string(), value: Node::read_from(&source, equals + 1)?, key })
}

/// All combinations of the values of some axes; those of the last axis change first.
pub struct Product<'a> {
    /// Each axis with those of its paths that count.
    axes: Vec<(&'a Axis, Vec<usize>)>,
    count: usize,
}

impl<'a> Product<'a> {
    /// Refuses more combinations than an experiment may have, before one is made.
    pub fn new(axes: Vec<(&'a Axis, Vec<usize>)>) -> Result<Self, Diagnostic> {
        let mut count: usize = 1;
        for (axis, _) in &axes {
            count = count.saturating_mul(axis.rows.len());
            if count > MOST_CELLS {
                return Err(Diagnostic::input(format!("this sweep has more than {MOST_CELLS} cells"))
                    .at(&axis.key, "with this axis")
                    .help("leave an axis out, or zip axes that belong together"));
            }
        }
        Ok(Self { axes, count })
    }

    pub fn count(&self) -> usize {
        self.count
    }

    /// The settings of one of the combinations, from 0.
    pub fn settings(&self, at: usize) -> Vec<Setting> {
        let mut following = self.count;
        let mut settings = Vec::new();
        for (axis, paths) in &self.axes {
            following /= axis.rows.len();
            let row = &axis.rows[at / following % axis.rows.len()];
            settings.extend(paths.iter().map(|&path| Setting {
                path: axis.paths[path].clone(),
                key: axis.key.clone(),
                value: row[path].clone(),
            }));
        }
        settings
    }
}
