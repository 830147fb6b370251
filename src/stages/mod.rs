//! The stages and their registry.
//!
//! A stage is a folder `src/stages/ROOM/STAGE/` and a word in the list below. `mod.rs` there has the parameters, what the
//! registry knows ([`Info`]), and the plan; `reference.rs` has the same in f64. Its kernels are `kernels/ROOM/STAGE.wgsl`, or
//! `STAGE_PART.wgsl` if it has several. The list makes modules and registry; checks, tests, benches and `lodlab stages` loop over it.

pub mod shared;

use std::fmt::Debug;
use std::path::Path;

use schemars::{JsonSchema, Schema};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::experiment::StageCall;
use crate::experiment::diagnostic::{Diagnostic, Origin};
use crate::experiment::parameters;
use crate::experiment::scene::Surface;
use crate::experiment::tree::Node;
use crate::kernel::Kernel;
use crate::plan::{Announced, Capacities, Chain};
use crate::reference::Reference;
use crate::scene::SceneData;

/// Makes the modules and the registry of one list.
macro_rules! stages {
    ($($room:ident: [$($stage:ident),* $(,)?]),* $(,)?) => {
        $(pub mod $room { $(pub mod $stage;)* })*

        /// All stages, room by room.
        pub const REGISTRY: &[Entry] = &[
            $($(Entry { room: stringify!($room), module: stringify!($stage), info: &$room::$stage::INFO },)*)*
        ];
    };
}

stages! {
    pyramids: [height_pyramid, plane_pyramid],
    grids: [view_grid, aspect_importance, warp, project, grid_error],
    sketch: [sketch_map, sketch_importance, geometry_image, density_ratio, error_demand],
    quadtree: [roughness, vertex_splitting, triangle_splitting],
    rays: [ray_cast, lead_rays, ray_fill],
    picture: [rasterize, shade],
    lists: [scan, compact],
    maps: [slope, surface_type],
    own: [kernel],
}

/// A stage and the room it is in.
pub struct Entry {
    pub room: &'static str,
    pub module: &'static str,
    pub info: &'static Info,
}

impl Entry {
    /// The kernel files of the stage, as paths under `kernels/`.
    pub fn kernels(&self) -> Vec<String> {
        let is_own = |path: &String| {
            let name = path.strip_prefix(self.room).and_then(|path| path.strip_prefix('/'));
            let part = name.and_then(|name| name.strip_suffix(".wgsl")).and_then(|name| name.strip_prefix(self.module));
            part.is_some_and(|part| part.is_empty() || part.starts_with('_'))
        };
        Kernel::built_in_paths().into_iter().filter(is_own).collect()
    }
}

/// One step of a chain, with its parameters.
pub trait Stage: Reference + Debug + Send + Sync {
    /// States buffers, steps and products.
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic>;

    /// The buffers it makes, where their names are among its parameters.
    fn makes(&self) -> Option<Vec<String>> {
        None
    }
}

/// Reads a stage from its place in an experiment; the folder is the experiment's.
pub type Read = fn(&Node, &Path) -> Result<Box<dyn Stage>, Diagnostic>;

/// What the registry knows of a stage.
pub struct Info {
    pub name: &'static str,
    pub summary: &'static str,
    /// The formula it computes, and where that comes from.
    pub formula: &'static str,
    pub source: &'static str,
    /// Buffers that it asks for by name.
    pub reads: &'static [&'static str],
    /// Buffers that it makes or changes and that mean something to others.
    pub writes: &'static [&'static str],
    /// Products that it needs and offers, as messages call them.
    pub needs: &'static [&'static str],
    pub offers: &'static [&'static str],
    /// Buffers of `writes` that no reference has, and why.
    pub unchecked: &'static [(&'static str, &'static str)],
    /// What is known of its parameters; see [`parameters::describe`].
    pub parameters: fn() -> Schema,
    pub read: Read,
    /// Chains that end in this stage: what checks, tests and benches run.
    pub examples: &'static [Example],
}

impl Info {
    /// Most of a registry entry is empty for most stages.
    pub const EMPTY: Info = Info {
        name: "",
        summary: "",
        formula: "",
        source: "",
        reads: &[],
        writes: &[],
        needs: &[],
        offers: &[],
        unchecked: &[],
        parameters: parameters::schema::<()>,
        read: |node, _| Err(Diagnostic::run("this stage cannot be read").at(&node.origin, "here")),
        examples: &[],
    };
}

/// A chain that ends in the stage it is an example of.
pub struct Example {
    /// As in an experiment file.
    pub chain: &'static str,
    /// The surface it is for, if it refuses the other one.
    pub only_on: Option<Surface>,
    /// What benches change, so that the sizes are those that people use: `Stage.field` and its value.
    pub in_benches: &'static [(&'static str, &'static str)],
    /// Files that the chain names: their paths and texts.
    pub files: &'static [(&'static str, &'static str)],
}

impl Example {
    pub const fn new(chain: &'static str) -> Self {
        Self { chain, only_on: None, in_benches: &[], files: &[] }
    }

    pub const fn only_on(self, surface: Surface) -> Self {
        Self { only_on: Some(surface), ..self }
    }

    pub const fn in_benches(self, settings: &'static [(&'static str, &'static str)]) -> Self {
        Self { in_benches: settings, ..self }
    }

    pub const fn with_files(self, files: &'static [(&'static str, &'static str)]) -> Self {
        Self { files, ..self }
    }
}

/// The registry's entry of a stage.
pub fn find(name: &str) -> Option<&'static Entry> {
    REGISTRY.iter().find(|entry| entry.info.name == name)
}

/// The stages that make a buffer of this name, or offer what messages call this, without having been given one.
pub fn makers(what: &str) -> Vec<&'static str> {
    let makes = |entry: &&Entry| {
        let Info { reads, writes, needs, offers, .. } = entry.info;
        writes.contains(&what) && !reads.contains(&what) || offers.contains(&what) && !needs.contains(&what)
    };
    REGISTRY.iter().filter(makes).map(|entry| entry.info.name).collect()
}

/// Looks a stage up in the registry and reads its parameters.
pub fn read(call: &StageCall, folder: &Path) -> Result<Box<dyn Stage>, Diagnostic> {
    match find(&call.name) {
        Some(entry) => (entry.info.read)(&call.node, folder),
        None => Err(Diagnostic::input(format!("there is no stage `{}`", call.name))
            .at(&call.node.origin, "unknown stage")
            .suggest(&call.name, REGISTRY.iter().map(|entry| entry.info.name))),
    }
}

/// Reads a stage whose parameters are one structure.
fn read_as<S>(node: &Node, _folder: &Path) -> Result<Box<dyn Stage>, Diagnostic>
where
    S: Stage + DeserializeOwned + Serialize + JsonSchema + 'static,
{
    Ok(Box::new(parameters::read::<S>(node)?))
}

/// The buffers that a stage makes.
pub fn makes(call: &StageCall, stage: &dyn Stage) -> Vec<String> {
    let known = find(&call.name).map_or(&[][..], |entry| entry.info.writes);
    stage.makes().unwrap_or_else(|| known.iter().map(|name| name.to_string()).collect())
}

/// A chain whose stages have stated their steps, in order. `capacities` are of lists that overflowed before.
pub fn state<'a>(
    name: &str,
    data: &'a SceneData,
    origin: &Origin,
    stages: &[(&StageCall, &dyn Stage)],
    capacities: &Capacities,
) -> Result<Chain<'a>, Diagnostic> {
    state_and_look(name, data, origin, stages, capacities, &mut |_, _| ())
}

/// The same, with a look at the chain after each stage, to keep what it has made.
pub fn state_and_look<'a>(
    name: &str,
    data: &'a SceneData,
    origin: &Origin,
    stages: &[(&StageCall, &dyn Stage)],
    capacities: &Capacities,
    look: &mut dyn FnMut(&mut Chain<'a>, usize),
) -> Result<Chain<'a>, Diagnostic> {
    let mut chain = Chain::new(name, data, origin).with_capacities(capacities.clone());
    for (index, (call, stage)) in stages.iter().enumerate() {
        let makes = |(call, stage): &(&StageCall, &dyn Stage)| (call.name.clone(), makes(call, *stage));
        let later = stages[index + 1..].iter().map(makes).collect();
        chain.announce(Announced { later, makers: Some(makers) });
        chain.begin_stage(&call.name, index, &call.node.head());
        stage.plan(&mut chain)?;
        look(&mut chain, index);
    }
    chain.close()?;
    Ok(chain)
}
