//! Sweep axes to cells: every parameter of an experiment can be an axis, and so is what the command line sets.

use std::collections::HashSet;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::diagnostic::{Diagnostic, Origin, Source};
use super::tree::{Kind, Node};

/// One axis: paths that change together, and the values they take.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Where the paths were written.
    pub key: Origin,
    /// As written, without the quotes.
    pub name: String,
    /// The name in front of the paths (`"threshold = a.X.y, b.Z.w"`).
    pub given_name: Option<String>,
    pub paths: Vec<String>,
    pub steps: Vec<Step>,
}

/// One step of an axis: a value for each of its paths, and the name that the file gives them.
#[derive(Clone, Debug)]
pub struct Step {
    pub name: Option<String>,
    pub values: Vec<Node>,
}

/// One value of one path, as the user would write it.
#[derive(Clone, Debug)]
pub struct Setting {
    pub path: String,
    pub key: Origin,
    pub value: Node,
    /// Further values for the same path (`--set PATH=1,2,3`), each of which makes cells of its own.
    pub others: Vec<Node>,
    /// The axis as it is written, or the path; several paths can share one.
    pub axis: String,
    /// The names of the axis and of the value, where the file has some.
    pub axis_name: Option<String>,
    pub value_name: Option<String>,
}

/// What makes a cell another one than its neighbour: a path with its value, swept in the file or set on the command line.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Varied {
    /// As the file or the command line names it.
    pub path: String,
    /// As RON, without comments and layout.
    pub value: String,
    /// The axis as it is written, or the path: what has one axis changes together.
    pub axis: String,
    /// What the file calls the axis, if it has a name of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis_name: Option<String>,
    /// What the file calls the value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value_name: Option<String>,
}

/// Characters of a value that labels show.
const LONGEST_SHOWN: usize = 40;

impl From<&Setting> for Varied {
    fn from(setting: &Setting) -> Self {
        let Setting { path, value, axis, axis_name, value_name, .. } = setting.clone();
        Self { path, value: value.canonical(), axis, axis_name, value_name }
    }
}

impl Varied {
    /// The axis as labels and tables call it: its own name, or the last part of the path.
    pub fn shown_axis(&self) -> &str {
        self.axis_name.as_deref().unwrap_or_else(|| self.path.rsplit('.').next().unwrap_or_default())
    }

    /// The value's name, or the value; of a long one its beginning, with files without their folders. A name is better.
    pub fn shown_value(&self) -> String {
        let written = self.value_name.as_deref().unwrap_or(&self.value);
        if written.chars().count() <= LONGEST_SHOWN {
            return written.into();
        }
        let file = written.split('"').nth(1).and_then(|path| path.rsplit('/').next());
        let start = written.split('(').next().unwrap_or_default();
        match file {
            Some(file) if !start.is_empty() && start.len() < LONGEST_SHOWN => format!("{start}({file}..)"),
            _ => format!("{}..", written.chars().take(LONGEST_SHOWN).collect::<String>()),
        }
    }

    /// It changes what is looked at.
    pub fn is_of_scene(&self) -> bool {
        self.path == "scene" || self.path.starts_with("scene.")
    }

    /// The numbers that the value is made of, if it is one number or a tuple of numbers.
    pub fn numbers(&self) -> Option<Vec<f64>> {
        if self.value_name.is_some() {
            return None;
        }
        let inner = self.value.strip_prefix('(').and_then(|inner| inner.strip_suffix(')')).unwrap_or(&self.value);
        inner.split(',').map(|number| number.trim().replace('_', "").parse().ok()).collect()
    }
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

/// Reads `sweep: { "path": values, "path, path": [(value, value), ...], "name = path, path": [value, ...] }`; values are a list, a spacing,
/// or a map from names to values.
pub fn read_axes(node: &Node) -> Result<Vec<Axis>, Diagnostic> {
    let Kind::Map(entries) = &node.kind else {
        return Err(Diagnostic::input("`sweep` is a map from paths to values").at(&node.origin, "expected `{ ... }`"));
    };
    entries.iter().map(|(key, values)| read_axis(key, values)).collect()
}

fn read_axis(key: &Node, values: &Node) -> Result<Axis, Diagnostic> {
    let name: String = key.parse()?;
    let (given_name, paths) = match name.split_once('=') {
        Some((given, paths)) => (Some(given.trim().to_string()), paths),
        None => (None, name.as_str()),
    };
    if given_name.as_ref().is_some_and(|given| given.is_empty() || given.contains(['.', '"'])) {
        return Err(Diagnostic::input("this axis has no name before its `=`")
            .at(&key.origin, "expected \"name = path, path\", the name without dots"));
    }
    let paths: Vec<String> = paths.split(',').map(|path| path.trim().to_string()).collect();
    let steps = steps(values, &paths, given_name.is_some())?;
    if steps.len() > MOST_CELLS {
        return Err(Diagnostic::input(format!("this axis has {} values", steps.len()))
            .at(&key.origin, format!("expected at most {MOST_CELLS}")));
    }
    let mut seen = HashSet::new();
    for step in &steps {
        let text = step.values.iter().map(Node::canonical).collect::<Vec<_>>().join(" ");
        if let Some(text) = seen.replace(text) {
            return Err(
                Diagnostic::input(format!("this axis has the value {text} twice")).at(&values.origin, "in here")
            );
        }
    }
    if steps.is_empty() {
        return Err(Diagnostic::input("this axis has no values, so nothing would run").at(&values.origin, "empty"));
    }
    Ok(Axis { key: key.origin.clone(), name, given_name, paths, steps })
}

/// The steps of an axis. Without a name, each of several paths has its own value, in a tuple. A named axis gives all of its paths one value,
/// which can be a tuple of numbers (a size); what has a value for each path there is a list, or a tuple with something else in it.
fn steps(values: &Node, paths: &[String], is_named: bool) -> Result<Vec<Step>, Diagnostic> {
    let of = |name: Option<String>, item: &Node| -> Result<Step, Diagnostic> {
        let values = match &item.kind {
            _ if paths.len() == 1 => vec![item.clone()],
            Kind::List(items) if is_named && items.len() == paths.len() => items.clone(),
            Kind::Tuple { name: None, items } if is_named && items.iter().all(is_number) => {
                vec![item.clone(); paths.len()]
            }
            Kind::Tuple { name: None, items } if items.len() == paths.len() => items.clone(),
            _ if is_named => vec![item.clone(); paths.len()],
            _ => {
                let message = format!("this axis changes {} paths together", paths.len());
                return Err(Diagnostic::input(message)
                    .at(&item.origin, format!("expected a tuple of {} values", paths.len()))
                    .help(
                        "an axis with a name gives all of its paths one value: \"name = path, path\": [value, ...]",
                    ));
            }
        };
        Ok(Step { name, values })
    };
    match &values.kind {
        Kind::List(items) => items.iter().map(|item| of(None, item)).collect(),
        Kind::Map(entries) => entries.iter().map(|(name, item)| of(Some(name.parse()?), item)).collect(),
        _ if paths.len() > 1 && !is_named => {
            Err(Diagnostic::input("an axis over several paths needs a list of tuples")
                .at(&values.origin, format!("expected [({})]", vec!["value"; paths.len()].join(", "))))
        }
        _ => Ok(spaced(values)?.iter().map(|value| of(None, value)).collect::<Result<_, _>>()?),
    }
}

fn is_number(node: &Node) -> bool {
    node.name().is_none() && node.parse::<f64>().is_ok()
}

fn spaced(node: &Node) -> Result<Vec<Node>, Diagnostic> {
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
    Ok(values.into_iter().map(|value| leaf(&Source::new(name.clone(), value.to_string()))).collect())
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

/// Reads a `--set PATH=VALUE` argument, or `--set PATH=VALUE,VALUE`.
pub fn read_setting(argument: &str) -> Result<Setting, Diagnostic> {
    let source = Source::new("--set", argument);
    let Some(equals) = argument.find('=') else {
        return Err(Diagnostic::input("`--set` takes PATH=VALUE")
            .at(&Origin { source, range: 0..argument.len() }, "there is no `=` here"));
    };
    let key = Origin { source: source.clone(), range: 0..equals };
    let (value, others) = Node::read_several_from(&source, equals + 1)?;
    let path = argument[..equals].trim().to_string();
    Ok(Setting { axis: path.clone(), path, value, key, others, axis_name: None, value_name: None })
}

/// Each combination of the values that settings have.
pub fn combinations(settings: &[Setting]) -> Result<Vec<Vec<Setting>>, Diagnostic> {
    let mut all: Vec<Vec<Setting>> = vec![Vec::new()];
    for setting in settings {
        if all.len() * (1 + setting.others.len()) > MOST_CELLS {
            return Err(Diagnostic::input(format!("these settings make more than {MOST_CELLS} combinations"))
                .at(&setting.key, "with this one"));
        }
        let values = || std::iter::once(&setting.value).chain(&setting.others);
        let with = |before: &Vec<Setting>, value: &Node| {
            let own = Setting { value: value.clone(), others: Vec::new(), ..setting.clone() };
            before.iter().cloned().chain([own]).collect()
        };
        all = all.iter().flat_map(|before| values().map(|value| with(before, value)).collect::<Vec<_>>()).collect();
    }
    Ok(all)
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
            count = count.saturating_mul(axis.steps.len());
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
            following /= axis.steps.len();
            let step = &axis.steps[at / following % axis.steps.len()];
            settings.extend(paths.iter().map(|&path| Setting {
                path: axis.paths[path].clone(),
                key: axis.key.clone(),
                value: step.values[path].clone(),
                others: Vec::new(),
                axis: axis.name.clone(),
                axis_name: axis.given_name.clone(),
                value_name: step.name.clone(),
            }));
        }
        settings
    }
}
