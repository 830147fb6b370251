//! A run: experiments to cells, cells to records, records to reports. Finished cells are not run again.

mod cell;
mod dump;
mod truth;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::scene::Scene;
use crate::experiment::sweep::Setting;
use crate::experiment::{Cell, Experiment, StageCall};
use crate::gpu::Gpu;
use crate::kernel::Elem;
use crate::plan::{Capacities, Chain, Demand, Plan, SceneData};
use crate::report::html::Pictures;
use crate::report::records::{self, Identity, Record, Store};
use crate::report::{html, pareto};
use crate::stages::{self, Stage};
use crate::terrain::HeightField;

pub use truth::Truth;

/// Changes whenever a record would mean something else than before.
const RECORD_VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "/2");

#[derive(Clone, Debug, Default)]
pub struct Options {
    /// `--set` arguments.
    pub settings: Vec<Setting>,
    pub adapter: Option<String>,
    /// Buffers to write as `.npy`, every frame.
    pub dump: Vec<String>,
    /// Run finished cells again.
    pub force: bool,
    /// Leave nothing out.
    pub keep_everything: bool,
}

/// What happens while a run goes on, for whoever shows it.
#[derive(Clone, Debug)]
pub enum Event {
    /// Cells in all, and how many of them are finished from before.
    Started {
        cells: usize,
        finished: usize,
    },
    CellStarted {
        label: String,
        reason: String,
    },
    Frame {
        done: usize,
        of: usize,
    },
    CellDone {
        label: String,
        frame_ms: Option<f64>,
    },
    Warning(String),
}

/// A cell with its stages read and its terrain in memory.
pub struct Prepared {
    pub cell: Cell,
    pub stages: Vec<Box<dyn Stage>>,
    pub data: Arc<SceneData>,
}

/// Reads all cells of an experiment as far as it goes without a device: every mistake in the file shows here.
pub fn prepare(experiment: &Experiment, settings: &[Setting]) -> Result<Vec<Prepared>, Diagnostic> {
    let mut terrains: BTreeMap<String, Arc<HeightField>> = BTreeMap::new();
    let mut scenes: BTreeMap<String, Arc<SceneData>> = BTreeMap::new();
    let mut prepared = Vec::new();
    for cell in experiment.cells(settings)? {
        let read = |call| stages::read(call, &experiment.folder);
        let stages = cell.stages.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        let key = scene_key(&cell.scene);
        let data = match scenes.get(&key) {
            Some(data) => data.clone(),
            None => {
                let data = Arc::new(load_scene(&cell, &experiment.folder, &mut terrains)?);
                scenes.insert(key, data.clone());
                data
            }
        };
        prepared.push(Prepared { cell, stages, data });
    }
    Ok(prepared)
}

fn scene_key(scene: &Scene) -> String {
    // JSON would write every number that is none as the same null
    format!("{scene:?}")
}

fn load_scene(
    cell: &Cell,
    folder: &Path,
    terrains: &mut BTreeMap<String, Arc<HeightField>>,
) -> Result<SceneData, Diagnostic> {
    let key = format!("{:?}", cell.scene.terrain);
    let terrain = match terrains.get(&key) {
        Some(terrain) => terrain.clone(),
        None => {
            let loaded = HeightField::load(&cell.scene.terrain, folder).map_err(|error| {
                let place = cell.scene_node.field("terrain").unwrap_or(&cell.scene_node);
                let field = error.field().and_then(|field| place.field(field));
                let diagnostic = Diagnostic::input(error.to_string()).at(&field.unwrap_or(place).head(), "here");
                Diagnostic { help: error.help().map(str::to_string), ..diagnostic }
            })?;
            let loaded = Arc::new(loaded);
            terrains.insert(key, loaded.clone());
            loaded
        }
    };
    let data = SceneData::new(cell.scene.clone(), terrain);
    let path = cell.scene_node.field("camera").unwrap_or(&cell.scene_node).head();
    if !data.cameras.iter().all(|camera| camera.eye_m.is_finite() && camera.world_from_view.is_finite()) {
        return Err(Diagnostic::input("the camera path has a place that is not a number").at(&path, "this path"));
    }
    Ok(data)
}

/// The buffers that the cell's measures need; each has to be what the measure takes it for.
fn measured(cell: &Cell, chain: &Chain) -> Result<Vec<String>, Diagnostic> {
    let (width, tall) = cell.scene.viewport;
    let mut outputs = Vec::new();
    for (name, elem, measures) in
        [("distance", Elem::F32, &["ScreenError", "Coverage"][..]), ("colour", Elem::U32, &["Image"])]
    {
        if measures.iter().any(|measure| cell.wants(measure)) {
            chain.read_as(name, elem, &[tall, width])?;
            outputs.push(name.to_string());
        }
    }
    if cell.wants("Mesh") && chain.has("triangle") {
        let dims = chain.buffer(chain.read("triangle")?).dims.clone();
        chain.read_own("triangle", Elem::Vec4U32, &dims)?;
        chain.read_own("triangle_count", Elem::U32, &[4])?;
        // its pinholes are seen in what was drawn of it
        let distance = chain.has("distance") && !outputs.contains(&"distance".to_string());
        outputs.extend(distance.then(|| "distance".to_string()));
        outputs.extend(["triangle_count", "triangle"].map(str::to_string));
    } else if cell.wants("Mesh") && chain.has("vertex") {
        chain.read_grid("vertex", Elem::Vec4F32)?;
        outputs.push("vertex".into());
    }
    if cell.wants("ErrorBuffer") {
        let known = ["grid_error", "error"].into_iter().filter(|name| chain.has(name));
        outputs.extend(known.map(str::to_string));
    }
    Ok(outputs)
}

/// Plans a cell for what it measures and what is to be dumped.
pub fn plan(prepared: &Prepared, options: &Options) -> Result<Plan, Diagnostic> {
    plan_with(prepared, options, &Capacities::new())
}

/// The same after lists have turned out to be too short.
fn plan_with(prepared: &Prepared, options: &Options, capacities: &Capacities) -> Result<Plan, Diagnostic> {
    let Prepared { cell, stages, data } = prepared;
    let mut chain = Chain::new(&cell.chain, data, &cell.scene_node.origin).with_capacities(capacities.clone());
    for (index, (stage, call)) in stages.iter().zip(&cell.stages).enumerate() {
        let later = stages.iter().map(AsRef::as_ref).zip(&cell.stages).skip(index + 1);
        let makes = |(stage, call): (&dyn Stage, &StageCall)| {
            let known = stages::writes(&call.name).iter().map(|name| name.to_string());
            (call.name.clone(), known.chain(stage.makes()).collect())
        };
        chain.announce(later.map(makes).collect());
        chain.begin_stage(&call.name, index, &call.node.head());
        stage.plan(&mut chain)?;
    }
    chain.begin_stage("measure", stages.len(), &cell.measures_origin);
    let mut outputs = measured(cell, &chain).map_err(|error| error.or_at(&cell.measures_origin, "measured here"))?;
    // with only the clock looked at, what the chain is for is what its last step makes
    if outputs.is_empty() {
        outputs.extend(chain.last_made());
    }
    for name in options.dump.iter().filter(|name| chain.has(name)) {
        if !outputs.contains(name) {
            outputs.push(name.clone());
        }
    }
    let demand = Demand { outputs, keep_everything: options.keep_everything };
    Plan::finish(chain, &demand).map_err(|error| error.or_at(&cell.measures_origin, "measured here"))
}

fn identity(prepared: &Prepared, plan: &Plan, terrain: &str, gpu: &Gpu, options: &Options) -> Identity {
    let cell = &prepared.cell;
    let stages: Vec<String> = cell.stages.iter().map(|call| call.node.canonical()).collect();
    let measures = format!("{:?}", cell.measures);
    // both change what runs, and with it the times
    let all = if options.keep_everything { " all" } else { "" };
    let dump = if options.dump.is_empty() { String::new() } else { format!(" dump {:?}", options.dump) };
    let mut kernels: Vec<(String, String)> =
        plan.steps.iter().map(|step| (step.kernel.name.clone(), step.kernel.hash())).collect();
    kernels.sort();
    kernels.dedup();
    Identity {
        parameters: format!("{} [{}] {} {measures}{all}{dump}", cell.chain, stages.join(", "), scene_key(&cell.scene)),
        kernels,
        terrain: terrain.into(),
        adapter: format!("{} {}", gpu.summary.name, gpu.summary.driver),
        version: RECORD_VERSION.into(),
    }
}

/// What a run left behind.
#[derive(Debug)]
pub struct Outcome {
    pub records: Vec<Record>,
    pub folder: PathBuf,
    pub ran: usize,
}

/// Runs an experiment into a folder. What was computed stays, also if a later cell fails.
pub fn run(
    experiment: &Experiment,
    gpu: &Gpu,
    folder: &Path,
    options: &Options,
    tell: &dyn Fn(Event),
) -> Result<Outcome, Diagnostic> {
    let prepared = prepare(experiment, &options.settings)?;
    let mut plans = Vec::new();
    for cell in &prepared {
        plans.push(plan(cell, options)?);
    }
    if let Some(name) = options.dump.iter().find(|name| plans.iter().all(|plan| plan.find(name).is_err())) {
        return Err(plans[0].find(name).err().unwrap_or_else(|| Diagnostic::input("nothing to dump")));
    }
    for plan in &plans {
        gpu.check_plan(plan)?;
    }
    let store = Store::open(folder)?;
    let mut hashes: BTreeMap<*const HeightField, String> = BTreeMap::new();
    let identities: Vec<Identity> = prepared
        .iter()
        .zip(&plans)
        .map(|(cell, plan)| {
            let terrain = hashes.entry(Arc::as_ptr(&cell.data.terrain)).or_insert_with(|| cell.data.terrain.hash());
            identity(cell, plan, terrain, gpu, options)
        })
        .collect();
    let must_run: Vec<bool> = identities
        .iter()
        .map(|identity| options.force || !options.dump.is_empty() || store.finished(&identity.hash()).is_none())
        .collect();
    let finished = must_run.iter().filter(|must| !**must).count();
    tell(Event::Started { cells: prepared.len(), finished });
    let sweep = Sweep {
        experiment,
        gpu,
        store: &store,
        options,
        tell,
        prepared: &prepared,
        plans: &plans,
        identities: &identities,
    };
    let result = sweep.run(&must_run);
    // reports are made of what there is, also after a failure
    let records = sweep.records();
    write_reports(experiment, &store, &records)?;
    result?;
    Ok(Outcome { records, folder: folder.to_path_buf(), ran: must_run.len() - finished })
}

struct Sweep<'a> {
    experiment: &'a Experiment,
    gpu: &'a Gpu,
    store: &'a Store,
    options: &'a Options,
    tell: &'a dyn Fn(Event),
    prepared: &'a [Prepared],
    plans: &'a [Plan],
    identities: &'a [Identity],
}

impl Sweep<'_> {
    /// Cells that look at the same frames run one after the other and share their ground truth.
    fn run(&self, must_run: &[bool]) -> Result<(), Diagnostic> {
        let mut done = vec![false; self.prepared.len()];
        for first in 0..self.prepared.len() {
            if done[first] || !must_run[first] {
                continue;
            }
            let data = &self.prepared[first].data;
            let shading = truth::shading(&self.prepared[first].cell);
            let shares = |at: &usize| {
                let other = &self.prepared[*at];
                must_run[*at] && Arc::ptr_eq(&other.data, data) && truth::shading(&other.cell) == shading
            };
            let same: Vec<usize> = (first..self.prepared.len()).filter(shares).collect();
            let truth_plan = truth::plan(data, &self.prepared[first])?;
            let wanted = same.iter().any(|&at| truth::wanted(&self.prepared[at].cell));
            let mut truth = if wanted { Some(Truth::new(self.gpu, &truth_plan, data)?) } else { None };
            for at in same {
                self.run_cell(at, truth.as_mut())?;
                done[at] = true;
            }
        }
        Ok(())
    }

    fn run_cell(&self, at: usize, mut truth: Option<&mut Truth>) -> Result<(), Diagnostic> {
        let (prepared, identity) = (&self.prepared[at], &self.identities[at]);
        let hash = identity.hash();
        let reason = match self.store.finished(&hash) {
            Some(_) if !self.options.dump.is_empty() => "dump asked for".into(),
            Some(_) => "forced".into(),
            None => self.store.reason(&prepared.cell.chain, &prepared.cell.settings, identity),
        };
        let label = cell_label(&prepared.cell);
        (self.tell)(Event::CellStarted { label: label.clone(), reason });
        let mut plan = self.plans[at].clone();
        let mut capacities = Capacities::new();
        let results = loop {
            let context = cell::Context {
                gpu: self.gpu,
                prepared,
                plan: &plan,
                store: self.store,
                hash: &hash,
                options: self.options,
                tell: self.tell,
            };
            match cell::run(&context, truth.as_deref_mut())? {
                cell::Ended::Done(results) => break *results,
                cell::Ended::Overflowed { list, capacity, needed } => {
                    let larger = needed.saturating_add(needed / 4);
                    (self.tell)(Event::Warning(format!(
                        "the list `{list}` holds {capacity} elements and needed {needed}: again with {larger}"
                    )));
                    capacities.insert(list, larger);
                    plan = plan_with(prepared, self.options, &capacities)?;
                    self.gpu.check_plan(&plan)?;
                }
            }
        };
        let plan = &plan;
        for warning in &results.warnings {
            (self.tell)(Event::Warning(warning.clone()));
        }
        let record = Record {
            hash,
            experiment: self.experiment.title.clone(),
            chain: prepared.cell.chain.clone(),
            settings: prepared.cell.settings.clone(),
            measures: results.measures,
            timings: results.timings,
            bytes: plan.bytes(),
            buffers: results.buffers,
            warnings: results.warnings,
            plan: crate::plan::explain(plan),
            left_out: plan.left_out.clone(),
            adapter: self.gpu.summary.clone(),
            identity: identity.clone(),
        };
        self.store.save(&record)?;
        (self.tell)(Event::CellDone { label, frame_ms: record.frame_ms() });
        Ok(())
    }

    /// The records of all finished cells, in the order of the file and under its names: an earlier run may have
    /// called the same cell something else.
    fn records(&self) -> Vec<Record> {
        let read = |(identity, prepared): (&Identity, &Prepared)| {
            let path = self.store.folder.join(format!("cells/{}.json", identity.hash()));
            let record: Record = serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()?;
            let settings = prepared.cell.settings.clone();
            Some(Record { experiment: self.experiment.title.clone(), settings, ..record })
        };
        self.identities.iter().zip(self.prepared).filter_map(read).collect()
    }
}

fn cell_label(cell: &Cell) -> String {
    let settings =
        cell.settings.iter().map(|(path, value)| format!("{}={value}", path.rsplit('.').next().unwrap_or_default()));
    [vec![cell.chain.clone()], settings.collect()].concat().join(" ")
}

fn write_reports(experiment: &Experiment, store: &Store, records: &[Record]) -> Result<(), Diagnostic> {
    let csv = records::csv(records).map_err(|error| Diagnostic::run(format!("records.csv cannot be made: {error}")))?;
    store.write("records.csv", &csv)?;
    let json = serde_json::to_vec_pretty(records)
        .map_err(|error| Diagnostic::run(format!("records.json cannot be made: {error}")))?;
    store.write("records.json", &json)?;
    let plot = pareto::svg(&experiment.title, records);
    match &plot {
        Some(svg) => store.write("pareto.svg", svg.as_bytes())?,
        None => store.remove("pareto.svg"),
    }
    let picture =
        |record: &Record, kind: &str| std::fs::read(store.folder.join(cell::picture_name(&record.hash, kind))).ok();
    let pictures: Vec<Pictures> = records
        .iter()
        .map(|record| Pictures {
            label: record.label(),
            image: picture(record, "image"),
            error: picture(record, "error"),
        })
        .filter(|pictures| pictures.image.is_some() || pictures.error.is_some())
        .collect();
    store.write("report.html", html::page(&experiment.title, records, plot.as_deref(), &pictures).as_bytes())
}
