//! One RON file: what is looked at, which chains of stages draw it, what is varied and what is measured.

mod cells;
pub mod diagnostic;
mod edit;
mod excerpt;
pub mod parameters;
mod pieces;
pub mod regular;
pub mod scene;
mod scene_limits;
pub mod sweep;
pub mod tree;

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use diagnostic::{Diagnostic, Origin, Source};
use scene::Scene;
use sweep::{Axis, Varied};
use tree::{Field, Kind, Node};

/// An experiment file, read as far as it can be read without knowing its stages.
#[derive(Clone, Debug)]
pub struct Experiment {
    pub source: Arc<Source>,
    /// Paths in the file are relative to this folder.
    pub folder: PathBuf,
    pub title: String,
    /// The chain that tables compare the others with.
    pub baseline: Option<String>,
    root: Node,
    scenes: Arc<[cells::NamedScene]>,
    chain_names: Vec<String>,
    axes: Vec<Axis>,
}

/// One point of the sweep for one chain: everything that decides what is computed.
#[derive(Clone, Debug)]
pub struct Cell {
    pub chain: String,
    /// The swept values.
    pub settings: Vec<Varied>,
    /// What the command line sets of it.
    pub overrides: Vec<Varied>,
    pub scene: Scene,
    /// The scene as written, to point at parts of it.
    pub scene_node: Node,
    /// The list of measures, or the experiment if it has none.
    pub measures_origin: Origin,
    pub stages: Vec<StageCall>,
    pub measures: Vec<MeasureCall>,
    /// Frames leave out steps whose inputs are those of the frame before.
    pub reuse: bool,
}

/// A stage as it stands in a chain, not yet looked up in the registry.
#[derive(Clone, Debug)]
pub struct StageCall {
    pub name: String,
    pub node: Node,
}

/// A measure as it stands in the list, not yet looked up in the registry.
#[derive(Clone, Debug)]
pub struct MeasureCall {
    pub name: String,
    pub node: Node,
}

/// What is measured where the experiment says nothing.
const DEFAULT_MEASURES: &str = "[ScreenError, Time]";

/// Stages that a chain has at most: the longest methods have twenty.
const MOST_STAGES: usize = 1000;

const FIELDS: [&str; 9] = ["title", "scene", "scenes", "pieces", "chains", "sweep", "measure", "reuse", "baseline"];

impl Experiment {
    pub fn load(path: &Path) -> Result<Self, Diagnostic> {
        let shown = path.display();
        let text = regular::read_to_string(path)
            .map_err(|error| Diagnostic::input(format!("cannot read the experiment `{shown}`: {error}")))?;
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        Self::read(Source::new(shown.to_string(), text), folder)
    }

    pub fn read(source: Arc<Source>, folder: PathBuf) -> Result<Self, Diagnostic> {
        let mut root = Node::read(&source)?;
        let fields = match &root.kind {
            Kind::Struct { fields, .. } if root.name().is_none_or(|name| name == "Experiment") => fields,
            _ => {
                return Err(Diagnostic::input("an experiment file holds one `Experiment(...)`")
                    .at(&Origin { range: 0..source.text.len().min(1), source }, "not an experiment"));
            }
        };
        for Field { name, origin, .. } in fields {
            if !FIELDS.contains(&name.as_str()) {
                return Err(Diagnostic::input(format!("an experiment has no field `{name}`"))
                    .at(origin, "unknown field")
                    .suggest(name, FIELDS));
            }
        }
        let scenes = cells::read_scenes(&root, &source)?.into();
        pieces::expand(&mut root)?;
        let chain_names = chain_names(required(&root, "chains", &source)?)?;
        let axes = root.field("sweep").map_or(Ok(Vec::new()), sweep::read_axes)?;
        let title = root.field("title").map_or(Ok(String::new()), Node::parse)?;
        let baseline = root.field("baseline").map(|node| baseline(node, &chain_names)).transpose()?;
        Ok(Self { title, folder, scenes, chain_names, baseline, axes, root, source })
    }

    pub fn chain_names(&self) -> impl Iterator<Item = &str> + Clone {
        self.chain_names.iter().map(String::as_str)
    }

    fn check_paths<'a>(&self, paths: impl Iterator<Item = (&'a String, &'a Origin)>) -> Result<(), Diagnostic> {
        for (path, key) in paths {
            if !self.chains().any(|(chain, _, stages)| resolve(&self.root, chain, stages.items(), path).is_some()) {
                return Err(self.no_match(path, key));
            }
        }
        Ok(())
    }

    fn no_match(&self, path: &str, key: &Origin) -> Diagnostic {
        let first = path.split('.').next().unwrap_or_default();
        let known = self.chain_names.iter().map(String::as_str).chain(["*", "scene", "measure"]);
        let message = Diagnostic::input(format!("`{path}` matches nothing in this experiment"))
            .at(key, "expected chain.Stage.field, scene.field or measure.Name.field");
        if known.clone().any(|name| name == first) {
            let stages = self.chains().flat_map(|(_, _, stages)| stages.items()).filter_map(Node::name);
            let mut stages: Vec<&str> = stages.collect();
            stages.sort_unstable();
            stages.dedup();
            message.suggest(path.split('.').nth(1).unwrap_or_default(), stages)
        } else {
            message.suggest(first, known)
        }
    }

    /// The path from the root of the tree for a path as the user writes it, for one chain.
    fn resolve(&self, chain: &str, path: &str) -> Option<Vec<String>> {
        resolve(&self.root, chain, self.stage_nodes(chain), path)
    }

    fn stage_nodes(&self, chain: &str) -> &[Node] {
        chain_node(&self.root, chain).unwrap_or_default()
    }

    /// The chains in the order of the file: names, where these stand, and lists of stages.
    fn chains(&self) -> impl Iterator<Item = (&str, &Node, &Node)> {
        let entries = match self.root.field("chains").map(|node| &node.kind) {
            Some(Kind::Map(entries)) => entries.as_slice(),
            _ => &[],
        };
        let named = self.chain_names.iter().zip(entries);
        named.map(|(name, (key, stages))| (name.as_str(), key, stages))
    }
}

/// The path from a root for a path as the user writes it, for a chain of some stages.
fn resolve(root: &Node, chain: &str, stages: &[Node], path: &str) -> Option<Vec<String>> {
    let parts: Vec<&str> = path.split('.').collect();
    let own = |parts: &[&str]| parts.iter().map(|part| part.to_string()).collect::<Vec<_>>();
    match parts.as_slice() {
        ["scene", _, ..] => Some(plain(root, &parts)),
        ["measure", name, _, ..] => {
            let at = root.field("measure").and_then(|node| position(node, name))?;
            Some([own(&["measure", &at.to_string()]), own(&parts[2..])].concat())
        }
        [named, stage, _, ..] if *named == chain || *named == "*" => {
            let (stage, nth) = match stage.split_once('#') {
                Some((stage, nth)) => (stage, nth.parse::<usize>().ok()?.checked_sub(1)?),
                None => (*stage, 0),
            };
            let (at, _) = stages.iter().enumerate().filter(|(_, node)| node.name() == Some(stage)).nth(nth)?;
            Some([own(&["chains", chain, &at.to_string()]), own(&parts[2..])].concat())
        }
        _ => None,
    }
}

impl Cell {
    /// Chain and swept values: what the user calls this cell.
    pub fn label(&self) -> String {
        label(&self.chain, &self.settings)
    }

    /// Everything that makes it another cell than one of the same chain.
    pub fn varied(&self) -> Vec<Varied> {
        self.settings.iter().chain(&self.overrides).cloned().collect()
    }
}

/// A chain and the values that were varied. Paths of one axis that have the same value are named once.
pub fn label(chain: &str, settings: &[Varied]) -> String {
    let mut parts = vec![chain.to_string()];
    for setting in settings {
        let part = format!("{}={}", setting.shown_axis(), setting.shown_value());
        let is_told = setting.axis_name.is_some() && parts[1..].contains(&part);
        if !is_told {
            parts.push(part);
        }
    }
    parts.join(" ")
}

fn baseline(node: &Node, chains: &[String]) -> Result<String, Diagnostic> {
    let name: String = node.parse()?;
    match chains.contains(&name) {
        true => Ok(name),
        false => Err(Diagnostic::input(format!("there is no chain `{name}` to compare with"))
            .at(&node.origin, "expected the name of a chain")
            .suggest(&name, chains.iter().map(String::as_str))),
    }
}

/// A path without the parts that only repeat a structure's own name (`camera.Flight.frames`), so that two ways to
/// write a path are one.
fn plain(root: &Node, parts: &[&str]) -> Vec<String> {
    let mut node = Some(root);
    let mut plain = Vec::new();
    for part in parts {
        if node.is_some_and(|node| node.name() == Some(part)) {
            continue;
        }
        plain.push(part.to_string());
        node = node.and_then(|node| node.field(part));
    }
    plain
}

fn required<'a>(root: &'a Node, name: &str, source: &Arc<Source>) -> Result<&'a Node, Diagnostic> {
    root.field(name).ok_or_else(|| {
        let start = Origin { source: source.clone(), range: root.origin.range.start..root.origin.range.start + 1 };
        Diagnostic::input(format!("this experiment has no `{name}`")).at(&start, "in this experiment")
    })
}

fn chain_names(node: &Node) -> Result<Vec<String>, Diagnostic> {
    let Kind::Map(entries) = &node.kind else {
        return Err(Diagnostic::input("`chains` is a map from names to lists of stages")
            .at(&node.origin, "expected `{ \"name\": [Stage(...), ...] }`"));
    };
    let mut names: Vec<String> = Vec::new();
    let mut known = HashSet::new();
    for (key, stages) in entries {
        let name: String = key.parse()?;
        if key.origin.text() != format!("\"{name}\"") {
            return Err(Diagnostic::input("the name of a chain is written plainly")
                .at(&key.origin, "expected \"name\" without escapes"));
        }
        if !known.insert(name.clone()) {
            return Err(Diagnostic::input(format!("there are two chains called `{name}`")).at(&key.origin, "again"));
        }
        if name.is_empty() || name == "*" || name == "scene" || name == "measure" || name.contains(['.', ',', '/']) {
            return Err(Diagnostic::input(format!("`{name}` cannot be the name of a chain"))
                .at(&key.origin, "reserved, or with a character that paths use"));
        }
        if stages.items().len() > MOST_STAGES {
            return Err(Diagnostic::input(format!("the chain `{name}` has {} stages", stages.items().len()))
                .at(&key.origin, format!("expected at most {MOST_STAGES}")));
        }
        if !matches!(&stages.kind, Kind::List(items) if !items.is_empty()) {
            return Err(Diagnostic::input(format!("the chain `{name}` is not a list of stages"))
                .at(&stages.origin, "expected `[Stage(...), ...]`"));
        }
        names.push(name);
    }
    if names.is_empty() {
        return Err(Diagnostic::input("there is no chain, so nothing would run").at(&node.origin, "empty"));
    }
    Ok(names)
}

fn chain_node<'a>(root: &'a Node, chain: &str) -> Option<&'a [Node]> {
    let Kind::Map(entries) = &root.field("chains")?.kind else { return None };
    let (_, stages) = entries.iter().find(|(key, _)| key.origin.text().trim_matches('"') == chain)?;
    Some(stages.items())
}

fn read_stage(node: &Node) -> Result<StageCall, Diagnostic> {
    match node.name() {
        Some(name) => Ok(StageCall { name: name.to_string(), node: node.clone() }),
        None => Err(Diagnostic::input("this is not a stage").at(&node.origin, "expected `Stage(...)`")),
    }
}

fn position(list: &Node, name: &str) -> Option<usize> {
    list.items().iter().position(|item| item.name() == Some(name))
}

fn read_measures(node: &Node) -> Result<Vec<MeasureCall>, Diagnostic> {
    let Kind::List(items) = &node.kind else {
        return Err(
            Diagnostic::input("`measure` is a list of measures").at(&node.origin, "expected `[ScreenError, ...]`")
        );
    };
    let call = |item: &Node| match item.name() {
        Some(name) => Ok(MeasureCall { name: name.to_string(), node: item.clone() }),
        None => Err(Diagnostic::input("this is not a measure").at(&item.origin, "expected `Measure(...)`")),
    };
    items.iter().map(call).collect()
}
