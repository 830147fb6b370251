//! The cells of an experiment: counted before one of them is made, and then made one by one.

use std::collections::HashSet;
use std::sync::Arc;

use super::diagnostic::{Diagnostic, Source};
use super::scene::Scene;
use super::sweep::{self, Axis, MOST_CELLS, Product, Setting, Varied};
use super::tree::{Field, Kind, Node};
use super::{
    Cell, DEFAULT_MEASURES, Experiment, chain_node, read_measures, read_stage, required, resolve, scene_limits,
};

/// A chain with the axes that vary it, before one scene.
struct Swept<'a> {
    name: &'a str,
    key: &'a Node,
    stages: &'a Node,
    values: Product<'a>,
    scene: &'a NamedScene,
    /// What the command line sets.
    settings: Vec<Setting>,
}

/// A scene of the experiment, with its name if there are several.
#[derive(Debug)]
pub struct NamedScene {
    name: Option<String>,
    node: Node,
}

/// An experiment has either `scene: (...)` or `scenes: {"name": (...), ...}`.
pub fn read_scenes(root: &Node, source: &Arc<Source>) -> Result<Vec<NamedScene>, Diagnostic> {
    let several = match (root.field("scene"), root.field("scenes")) {
        (Some(one), Some(several)) => {
            return Err(Diagnostic::input("this experiment has `scene` and `scenes`")
                .at(&several.head(), "several scenes")
                .at(&one.head(), "and one"));
        }
        (None, Some(several)) => several,
        _ => {
            let node = required(root, "scene", source)?.clone();
            return Ok(vec![NamedScene { name: None, node }]);
        }
    };
    let Kind::Map(entries) = &several.kind else {
        return Err(Diagnostic::input("`scenes` is a map from names to scenes")
            .at(&several.head(), "expected `{ \"name\": (terrain: ..., camera: ...) }`"));
    };
    let mut scenes: Vec<NamedScene> = Vec::new();
    for (key, node) in entries {
        let name: String = key.parse()?;
        if scenes.iter().any(|known| known.name.as_ref() == Some(&name)) {
            return Err(Diagnostic::input(format!("there are two scenes called `{name}`")).at(&key.origin, "again"));
        }
        scenes.push(NamedScene { name: Some(name), node: node.clone() });
    }
    match scenes.is_empty() {
        true => Err(Diagnostic::input("there is no scene, so nothing would run").at(&several.head(), "empty")),
        false => Ok(scenes),
    }
}

impl Experiment {
    /// All cells, scene by scene and chain by chain in the order of the file. `settings` are the `--set` arguments; they win
    /// over the file, and take the place of an axis over the same path. One with several values is an axis itself.
    pub fn cells(&self, settings: &[Setting]) -> Result<Vec<Cell>, Diagnostic> {
        self.each_cell(settings)?.collect()
    }

    /// The same cells, each made when its turn comes: a large sweep is not in memory at once.
    pub fn each_cell<'a>(
        &'a self,
        settings: &'a [Setting],
    ) -> Result<impl Iterator<Item = Result<Cell, Diagnostic>> + use<'a>, Diagnostic> {
        self.check_paths(self.axes.iter().flat_map(|axis| axis.paths.iter().map(|path| (path, &axis.key))))?;
        self.check_paths(settings.iter().map(|setting| (&setting.path, &setting.key)))?;
        let chains = self.swept(settings)?;
        Ok(chains.into_iter().flat_map(move |chain| {
            let root = self.root_of(&chain);
            (0..chain.values.count()).map(move |at| self.cell(&root, &chain, &chain.values.settings(at)))
        }))
    }

    /// The chains with what varies them; refused if they have more cells than can be meant.
    fn swept(&self, settings: &[Setting]) -> Result<Vec<Swept<'_>>, Diagnostic> {
        let (mut chains, mut count) = (Vec::new(), 0);
        let mut known = HashSet::new();
        for settings in sweep::combinations(settings)? {
            for (at, scene) in self.scenes.iter().enumerate() {
                for (name, key, stages) in self.chains() {
                    // values of what a chain does not have make no cells of it
                    let own =
                        settings.iter().filter(|set| resolve(&self.root, name, stages.items(), &set.path).is_some());
                    let own: Vec<(String, String)> = own.map(|set| (set.path.clone(), set.value.canonical())).collect();
                    if !known.insert((at, name, own)) {
                        continue;
                    }
                    let values = self.free_axes(name, stages.items(), &settings)?;
                    count += values.count();
                    if count > MOST_CELLS {
                        return Err(Diagnostic::input(format!("this experiment has more than {MOST_CELLS} cells"))
                            .at(&key.origin, "with this chain")
                            .help("leave chains or values out, or make several experiments of it"));
                    }
                    chains.push(Swept { name, key, stages, values, scene, settings: settings.clone() });
                }
            }
        }
        Ok(chains)
    }

    /// What the axes that no setting takes the place of vary in one chain. Two axes may not change the same thing: the
    /// labels of the cells would say what only one of them did.
    fn free_axes(&self, chain: &str, stages: &[Node], settings: &[Setting]) -> Result<Product<'_>, Diagnostic> {
        let place = |path: &str| resolve(&self.root, chain, stages, path);
        let set: Vec<_> = settings.iter().filter_map(|setting| place(&setting.path)).collect();
        let mut free: Vec<(&Axis, Vec<Option<Vec<String>>>)> = Vec::new();
        for axis in &self.axes {
            let places: Vec<_> = axis.paths.iter().map(|path| place(path)).collect();
            // a setting inside of what an axis sets goes on top of each of its values
            let is_set = |place: &&Vec<String>| set.iter().any(|set| place.starts_with(set));
            match places.iter().flatten().filter(is_set).count() {
                0 => {}
                count if count == places.iter().flatten().count() => continue,
                _ => {
                    return Err(Diagnostic::input(format!(
                        "`--set` fixes one path of the zipped axis `{}`",
                        axis.name
                    ))
                    .at(&axis.key, "set all of its paths, or none"));
                }
            }
            if places.iter().all(Option::is_none) {
                continue;
            }
            let overlap = |a: &[String], b: &[String]| a.starts_with(b) || b.starts_with(a);
            let is_same = |(_, others): &&(&Axis, Vec<Option<Vec<String>>>)| {
                let mut all = others.iter().flatten();
                all.any(|other| places.iter().flatten().any(|place| overlap(place, other)))
            };
            if let Some((other, _)) = free.iter().find(is_same) {
                return Err(Diagnostic::input(format!("`{}` and `{}` change the same thing", other.name, axis.name))
                    .at(&axis.key, "this axis")
                    .at(&other.key, "and this one"));
            }
            free.push((axis, places));
        }
        let is_there = |places: Vec<Option<_>>| (0..places.len()).filter(|&at| places[at].is_some()).collect();
        Product::new(free.into_iter().map(|(axis, places)| (axis, is_there(places))).collect())
    }

    /// The tree without the sweep and without other chains and scenes, which no cell needs and which can be long.
    fn root_of(&self, chain: &Swept) -> Node {
        let Kind::Struct { name, fields } = &self.root.kind else { return self.root.clone() };
        let own = |field: &Field| match field.name.as_str() {
            "sweep" => None,
            "scenes" => Some(Field { name: "scene".into(), value: chain.scene.node.clone(), ..field.clone() }),
            "chains" => {
                let kind = Kind::Map(vec![(chain.key.clone(), chain.stages.clone())]);
                let value = Node { origin: field.value.origin.clone(), kind };
                Some(Field { value, name: field.name.clone(), origin: field.origin.clone() })
            }
            _ => Some(field.clone()),
        };
        let kind = Kind::Struct { name: name.clone(), fields: fields.iter().filter_map(own).collect() };
        Node { origin: self.root.origin.clone(), kind }
    }

    /// One cell of a chain, from what [`Experiment::root_of`] says of it.
    fn cell(&self, written: &Node, swept: &Swept, values: &[Setting]) -> Result<Cell, Diagnostic> {
        let mut root = written.clone();
        let chain = swept.name;
        let stages = chain_node(written, chain).unwrap_or_default();
        let place = |setting: &Setting| resolve(written, chain, stages, &setting.path);
        for setting in values.iter().chain(&swept.settings) {
            if let Some(path) = place(setting) {
                let path: Vec<&str> = path.iter().map(String::as_str).collect();
                root.set(&path, &setting.key, &setting.value)?;
            }
        }
        let overrides = swept.settings.iter().filter(|setting| place(setting).is_some()).map(Varied::from).collect();
        let scene_node = required(&root, "scene", &self.source)?;
        let scene: Scene = scene_node.parse()?;
        scene_limits::check(&scene, scene_node)?;
        let stages = chain_node(&root, chain).unwrap_or_default();
        let stages = stages.iter().map(read_stage).collect::<Result<_, _>>()?;
        let measures = match root.field("measure") {
            Some(node) => read_measures(node)?,
            None => read_measures(&Node::read(&Source::new("default measures", DEFAULT_MEASURES))?)?,
        };
        let scene_name = swept.scene.name.iter().map(|name| Varied {
            path: "scene".into(),
            value: name.clone(),
            axis: "scene".into(),
            axis_name: None,
            value_name: None,
        });
        let settings = scene_name.chain(values.iter().map(Varied::from)).collect();
        let measures_origin = root.field("measure").map_or(root.head(), |node| node.origin.clone());
        let scene_node = scene_node.clone();
        let reuse = root.field("reuse").map_or(Ok(false), Node::parse)?;
        let chain = chain.to_string();
        Ok(Cell { chain, settings, overrides, scene, scene_node, measures_origin, stages, measures, reuse })
    }
}
