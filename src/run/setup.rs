//! From the text of an experiment to something that runs: cells with their stages, measures and terrain, and their plans.
//! Runs, ground truth, checks, tests and benches all set up here.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Options;
use super::sight::companions;
use super::truth;
use crate::experiment::diagnostic::{Diagnostic, Source};
use crate::experiment::scene::Scene;
use crate::experiment::sweep::Setting;
use crate::experiment::tree::Node;
use crate::experiment::{Cell, Experiment, StageCall};
use crate::gpu::{Executor, Gpu, GpuError};
use crate::ground::octaves::Octaves;
use crate::ground::{Detailed, Ground, Samples};
use crate::measure::{self, Chosen};
use crate::plan::{ANY_ADAPTER_BINDS, BufferId, Capacities, Chain, Demand, Plan};
use crate::scene::{Input, SceneData};
use crate::stages::{self, Stage};
use crate::terrain::{ColourMap, HeightField, TerrainError, TypeMap};

/// A cell with its stages and measures read and its terrain in memory.
pub struct Prepared {
    pub cell: Cell,
    pub stages: Vec<Box<dyn Stage>>,
    pub measures: Vec<Chosen>,
    pub data: Arc<SceneData>,
}

/// Reads all cells of an experiment as far as it goes without a device: every mistake in the file shows here.
pub fn prepare(experiment: &Experiment, settings: &[Setting]) -> Result<Vec<Prepared>, Diagnostic> {
    prepare_each(experiment, settings)?.collect()
}

/// The same cells, each read when its turn comes: a large sweep is not in memory at once.
pub fn prepare_each<'a>(
    experiment: &'a Experiment,
    settings: &'a [Setting],
) -> Result<impl Iterator<Item = Result<Prepared, Diagnostic>> + use<'a>, Diagnostic> {
    prepare_some(experiment, settings, |_, _| true)
}

/// Those of them that are wanted, by their number and what they are.
pub fn prepare_some<'a>(
    experiment: &'a Experiment,
    settings: &'a [Setting],
    is_wanted: impl Fn(usize, &Cell) -> bool + 'a,
) -> Result<impl Iterator<Item = Result<Prepared, Diagnostic>> + 'a, Diagnostic> {
    let mut scenes = Scenes::default();
    let cells = experiment.each_cell(settings)?.enumerate();
    let wanted = cells.filter(move |(at, cell)| cell.as_ref().map_or(true, |cell| is_wanted(*at, cell)));
    Ok(wanted.map(move |(_, cell)| {
        let prepared = scenes.prepare(cell?, &experiment.folder)?;
        scenes.check_frames(&prepared.cell)?;
        Ok(prepared)
    }))
}

/// Frames that the camera paths of an experiment have at most, all together: their cameras take a gigabyte.
const MOST_FRAMES: usize = 5_000_000;

/// Terrains and scenes that are in memory: cells that look at the same share it.
#[derive(Default)]
pub struct Scenes {
    terrains: BTreeMap<String, Arc<HeightField>>,
    grounds: BTreeMap<String, Arc<dyn Ground>>,
    colours: BTreeMap<String, Arc<ColourMap>>,
    types: BTreeMap<String, Arc<TypeMap>>,
    scenes: BTreeMap<String, Arc<SceneData>>,
    /// Frames of all scenes in memory.
    frames: usize,
}

impl Scenes {
    /// Reads a cell as far as it goes without a device. Files that it names are relative to `folder`.
    pub fn prepare(&mut self, cell: Cell, folder: &Path) -> Result<Prepared, Diagnostic> {
        let read = |call| stages::read(call, folder);
        let stages = cell.stages.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        let measures = cell.measures.iter().map(measure::read).collect::<Result<Vec<_>, _>>()?;
        let key = scene_key(&cell.scene);
        let data = match self.scenes.get(&key) {
            Some(data) => data.clone(),
            None => {
                let data = Arc::new(self.load(&cell, folder)?);
                self.frames += data.cameras().len();
                self.scenes.insert(key, data.clone());
                data
            }
        };
        Ok(Prepared { cell, stages, measures, data })
    }

    /// Forgets what nobody else has, if there is much of it.
    pub fn keep_few(&mut self, most: usize) {
        keep_few(&mut self.scenes, most);
        self.frames = self.scenes.values().map(|data| data.cameras().len()).sum();
        keep_few(&mut self.grounds, most);
        keep_few(&mut self.colours, most);
        keep_few(&mut self.types, most);
        keep_few(&mut self.terrains, most);
    }

    /// Refuses more frames than can be in memory, once a cell has brought too many.
    fn check_frames(&self, cell: &Cell) -> Result<(), Diagnostic> {
        if self.frames <= MOST_FRAMES {
            return Ok(());
        }
        let camera = cell.scene_node.field("camera").unwrap_or(&cell.scene_node).head();
        let message = format!("the camera paths of this experiment have more than {MOST_FRAMES} frames, all together");
        Err(Diagnostic::input(message)
            .at(&camera, "with this path once more, in another scene")
            .help("take fewer frames, sweep less of the scene, or make several experiments of it"))
    }

    fn load(&mut self, cell: &Cell, folder: &Path) -> Result<SceneData, Diagnostic> {
        let key = format!("{:?}", cell.scene.terrain);
        let part = |name: &str| cell.scene_node.field(name).unwrap_or(&cell.scene_node);
        let bad = |name: &'static str| move |error: TerrainError| in_scene(&error, part(name));
        let load = || HeightField::load(&cell.scene.terrain, folder).map_err(bad("terrain"));
        let terrain = known(&mut self.terrains, key.clone(), || load().map(Arc::new))?;
        let surface = cell.scene.surface;
        let samples = || -> Arc<dyn Ground> { Arc::new(Samples::new(terrain.clone(), surface)) };
        let mut ground = known(&mut self.grounds, format!("{surface:?} {key}"), || Ok(samples()))?;
        if let Some(octaves) = Octaves::new(&cell.scene.detail) {
            let steepest = octaves.steepest() / ground.lattice().cell_m.min_element();
            if steepest > STEEPEST_OCTAVES {
                let message = format!("these octaves can rise by up to {steepest:.1e} m in a metre");
                return Err(Diagnostic::input(message)
                    .at(&part("detail").head(), format!("no ground has more than {STEEPEST_OCTAVES} m in a metre"))
                    .help("less `amplitude_m`, less `persistence`, or fewer octaves"));
            }
            let detailed = || -> Arc<dyn Ground> { Arc::new(Detailed::new(ground.clone(), octaves)) };
            let key = format!("{:?} {surface:?} {key}", cell.scene.detail);
            ground = known(&mut self.grounds, key, || Ok(detailed()))?;
        }
        let mut inputs = vec![Input::heights(terrain.clone())];
        if let Some(colour) = &cell.scene.colour {
            let load = || ColourMap::load(colour, &terrain, folder).map_err(bad("colour"));
            let map = known(&mut self.colours, format!("{colour:?} {key}"), || load().map(Arc::new))?;
            inputs.push(Input::colours(map));
        }
        if let Some(types) = &cell.scene.surface_type {
            let load = || TypeMap::load(types, &terrain, folder).map_err(bad("surface_type"));
            let map = known(&mut self.types, format!("{types:?} {key}"), || load().map(Arc::new))?;
            inputs.push(Input::types(map));
        }
        let data = SceneData::new(cell.scene.clone(), ground, inputs);
        if !data.cameras().iter().all(|camera| camera.eye_m.is_finite() && camera.world_from_view.is_finite()) {
            return Err(Diagnostic::input("the camera path has a place that is not a number")
                .at(&part("camera").head(), "this path"));
        }
        Ok(data)
    }
}

/// Octaves that are steeper are no ground, and a ray along them would never end.
const STEEPEST_OCTAVES: f64 = 1000.0;

/// What is known by a key, made if it is not known.
fn known<T: Clone>(
    all: &mut BTreeMap<String, T>,
    key: String,
    make: impl FnOnce() -> Result<T, Diagnostic>,
) -> Result<T, Diagnostic> {
    Ok(match all.entry(key) {
        Entry::Occupied(entry) => entry.get().clone(),
        Entry::Vacant(entry) => entry.insert(make()?).clone(),
    })
}

/// Forgets what nobody else has, if there are more than so many.
fn keep_few<T: ?Sized>(all: &mut BTreeMap<String, Arc<T>>, most: usize) {
    if all.len() > most {
        all.retain(|_, shared| Arc::strong_count(shared) > 1);
    }
}

/// Scenes with the same key are the same.
fn scene_key(scene: &Scene) -> String {
    // JSON would write every number that is none as the same null
    format!("{scene:?}")
}

/// A mistake in a part of the scene, where it was written.
fn in_scene(error: &TerrainError, node: &Node) -> Diagnostic {
    let field = error.field().and_then(|field| node.field(field));
    let diagnostic = Diagnostic::input(error.to_string()).at(&field.unwrap_or(node).head(), "here");
    Diagnostic { help: error.help().map(str::to_string), ..diagnostic }
}

impl Prepared {
    /// The first cell of an experiment.
    pub fn first(text: String, folder: PathBuf, settings: &[Setting]) -> Result<Self, Diagnostic> {
        let experiment = Experiment::read(Source::new("setup", text), folder)?;
        let first = prepare_each(&experiment, settings)?.next();
        first.unwrap_or_else(|| Err(Diagnostic::input("this experiment has no cell")))
    }

    /// The chain with all of its stages stated.
    pub fn chain(&self, capacities: &Capacities) -> Result<Chain<'_>, Diagnostic> {
        self.chain_and_look(capacities, &mut |_, _| ())
    }

    /// The same, with a look at the chain after each stage.
    fn chain_and_look<'a>(
        &'a self,
        capacities: &Capacities,
        look: &mut dyn FnMut(&mut Chain<'a>, usize),
    ) -> Result<Chain<'a>, Diagnostic> {
        let stages: Vec<(&StageCall, &dyn Stage)> =
            self.cell.stages.iter().zip(self.stages.iter().map(AsRef::as_ref)).collect();
        stages::state_and_look(&self.cell.chain, &self.data, &self.cell.scene_node.origin, &stages, capacities, look)
    }

    /// The plan for what is measured and what is to be dumped. `capacities` are of lists that turned out to be too short.
    pub fn plan(&self, options: &Options, capacities: &Capacities) -> Result<Plan, Diagnostic> {
        if options.pictures.is_empty() {
            return self.plan_also(options, capacities, &mut |_, _| Vec::new());
        }
        let bare = Options { pictures: Vec::new(), ..options.clone() };
        let run_plan = self.plan(&bare, capacities)?;
        self.plan_also(options, capacities, &mut |chain, seen| companions(chain, seen, &run_plan, ANY_ADAPTER_BINDS))
    }

    /// The same, and for buffers that somebody else wants of the chain; he is told which the dumped ones are.
    pub fn plan_also(
        &self,
        options: &Options,
        capacities: &Capacities,
        also: &mut dyn FnMut(&Chain, &[BufferId]) -> Vec<BufferId>,
    ) -> Result<Plan, Diagnostic> {
        let mut chain = self.chain(capacities)?;
        let mut outputs: Vec<BufferId> = Vec::new();
        for (call, chosen) in self.cell.measures.iter().zip(&self.measures) {
            chain.begin_measure(&call.name, &call.node.head());
            if chosen.measure.wants_truth() {
                truth::check(&self.data).map_err(|error| error.or_at(&call.node.head(), "compares with the truth"))?;
            }
            outputs
                .extend(chosen.measure.needs(&chain).map_err(|error| error.or_at(&call.node.head(), "measured here"))?);
        }
        // with only the clock looked at, what the chain is for is what its last step makes
        if outputs.is_empty() {
            outputs.extend(chain.last_made());
        }
        let mut dumped = Vec::new();
        for name in options.dump.iter().chain(&options.pictures) {
            let found = match name.split_once('@') {
                None => chain.find(name),
                Some((buffer, step)) => chain.tap_named(name, buffer, step),
            };
            dumped.extend(found);
        }
        outputs.extend(&dumped);
        outputs.extend(also(&chain, &dumped));
        let reuse = self.cell.reuse;
        Ok(Plan::finish(chain, &Demand { outputs, keep_everything: options.keep_everything, reuse }))
    }

    pub fn wants_truth(&self) -> bool {
        self.measures.iter().any(|chosen| chosen.measure.wants_truth())
    }
}

/// Plans a cell for what it measures and what is to be dumped.
pub fn plan(prepared: &Prepared, options: &Options) -> Result<Plan, Diagnostic> {
    prepared.plan(options, &Capacities::new())
}

/// What a plan made by [`Setup::chain`] leaves readable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// What the chain's last step makes.
    Last,
    /// Every buffer, each in memory of its own.
    Everything,
}

/// An experiment of one chain over a scene.
fn text_of(scene: &str, chain: &str) -> String {
    format!("Experiment(scene: ({scene}), chains: {{\"chain\": {chain}}}, measure: [Time])")
}

/// One chain, planned: what tests and benches run.
pub struct Setup {
    pub prepared: Prepared,
    pub plan: Arc<Plan>,
}

impl Setup {
    /// A chain over a scene, both as in an experiment file: `scene` is what stands between `scene: (` and `)`, `chain` a list of
    /// stages. Files that they name are relative to `folder`.
    pub fn chain(scene: &str, chain: &str, folder: &Path, keep: Keep) -> Result<Self, Diagnostic> {
        Self::first(text_of(scene, chain), folder.to_path_buf(), &[], keep)
    }

    /// The first cell of an experiment.
    pub fn first(text: String, folder: PathBuf, settings: &[Setting], keep: Keep) -> Result<Self, Diagnostic> {
        let prepared = Prepared::first(text, folder, settings)?;
        let plan = match keep {
            Keep::Last => plan(&prepared, &Options::default())?,
            Keep::Everything => {
                let chain = prepared.chain(&Capacities::new())?;
                let outputs = chain.made();
                Plan::finish(chain, &Demand { outputs, keep_everything: true, reuse: false })
            }
        };
        Ok(Self { prepared, plan: Arc::new(plan) })
    }

    /// On a device, with what runs once done.
    pub fn executor(&self, gpu: &Arc<Gpu>) -> Result<Executor, GpuError> {
        let mut executor = Executor::new(gpu, &self.plan, &self.prepared.data)?;
        executor.setup()?;
        Ok(executor)
    }
}

/// One chain, planned with a copy of every buffer after each stage that writes it.
pub struct Tapped {
    pub setup: Setup,
    pub taps: Vec<Tap>,
}

/// What a buffer is after a stage.
pub struct Tap {
    pub stage_index: usize,
    /// The buffer's name.
    pub buffer: String,
    pub copy: BufferId,
}

impl Tapped {
    /// See [`Setup::chain`].
    pub fn chain(scene: &str, chain: &str, folder: &Path) -> Result<Self, Diagnostic> {
        let prepared = Prepared::first(text_of(scene, chain), folder.to_path_buf(), &[])?;
        let mut taps = Vec::new();
        let chain = prepared.chain_and_look(&Capacities::new(), &mut |chain, stage_index| {
            for id in chain.written() {
                let Some(after) = chain.steps().len().checked_sub(1) else { return };
                let buffer = chain.buffer(id).name.clone();
                let copy = chain.tap(id, after, &format!("{buffer}@{stage_index}"));
                taps.push(Tap { stage_index, buffer, copy });
            }
        })?;
        let outputs = taps.iter().map(|tap| tap.copy).collect();
        let plan = Arc::new(Plan::finish(chain, &Demand { outputs, keep_everything: false, reuse: false }));
        Ok(Self { setup: Setup { prepared, plan }, taps })
    }
}
