//! Looks for scenes in which a promise is broken: random terrain, eyes, chains and parameters, in small frames, until a count or a time ends it.
//!
//! It knows no method. Chains are the examples of the stages, and what is checked is what products promise: a surface that is drawn with
//! a proven bound keeps it, and its mesh is closed; the ground truth is good to what it says of itself; a frame has the same bits twice, and one that
//! remembers the frame before has those of a frame that does not. What is found is made simpler for as long as it stays broken.

mod trial;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::UVec2;
use rand::rngs::ChaCha12Rng;
use rand::{RngExt, SeedableRng};

use crate::check::cases;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::scene::Surface;
use crate::experiment::sweep;
use crate::gpu::{Executor, Gpu};
use crate::ground::EXACT_PX;
use crate::measure::{Chosen, Measured, Seen, TruthFrame};
use crate::plan::product::Drawn;
use crate::plan::{BufferId, Plan};
use crate::run::{self, Options, Overflow, Prepared, Truth};
use trial::Trial;

/// What to look through.
#[derive(Clone, Debug, Default)]
pub struct Hunt {
    pub seed: u64,
    /// Ends after so many frames, or so much time.
    pub frames: usize,
    pub time: Option<Duration>,
    /// Ends after so many broken promises.
    pub finds: Option<usize>,
    /// Tries that making one scene simpler may take.
    pub tries: usize,
    /// Only chains that have this stage.
    pub stage: Option<String>,
    /// Elevation files to take pieces of.
    pub dems: Vec<PathBuf>,
}

/// A broken promise.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    pub promise: &'static str,
    /// How far it is from being kept.
    pub value: f64,
    /// The simplest experiment that was found to break it, and the values of parameters to be set in it.
    pub experiment: String,
    pub settings: Vec<(String, String)>,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    pub frames: usize,
    /// Of these, frames of a surface that is promised to keep a proven bound.
    pub promised: usize,
    /// Scenes in which f32 has too few digits for the truth, which was cast in f64.
    pub in_f64: usize,
    /// Trials that were no experiment, promised more than can be held, or were more than the adapter can do.
    pub refused: usize,
}

/// The share of chains without a proven bound that are drawn.
const UNPROMISED: f64 = 0.2;

/// Looks, and hands out what it finds, already simpler.
pub fn hunt(
    gpu: &Arc<Gpu>,
    hunt: &Hunt,
    found: &mut dyn FnMut(Found),
    tell: &dyn Fn(&Summary),
) -> Result<Summary, Diagnostic> {
    let chains = chains(hunt.stage.as_deref())?;
    let folder = tempfile::tempdir().map_err(|error| Diagnostic::run(format!("no place for files: {error}")))?;
    let dems = hunt.dems.iter().map(|file| with_size(file)).collect::<Result<Vec<_>, _>>()?;
    let mut dice = ChaCha12Rng::seed_from_u64(hunt.seed);
    let begin = Instant::now();
    let mut summary = Summary::default();
    let mut finds = 0;
    while summary.frames < hunt.frames
        && hunt.time.is_none_or(|time| begin.elapsed() < time)
        && hunt.finds.is_none_or(|most| finds < most)
    {
        let trial = Trial::roll(&mut dice, &chains, &dems);
        let Some(planned) = Planned::new(gpu, &trial, folder.path())? else {
            summary.refused += 1;
            continue;
        };
        // most chains of a family promise nothing, and there is less to be held to
        if !planned.promised && !dice.random_bool(UNPROMISED) {
            continue;
        }
        match judge(gpu, &planned)? {
            None => summary.refused += 1,
            Some(broken) => {
                summary.in_f64 += usize::from(run::truth_in_f64(&planned.prepared.data).is_some());
                summary.frames += trial.views.len();
                summary.promised += if planned.promised { trial.views.len() } else { 0 };
                let mut known = BTreeSet::new();
                for broken in broken {
                    // one of a kind and a trial is enough
                    if known.insert(broken.promise) {
                        finds += 1;
                        found(simplest(gpu, &trial, broken, hunt.tries, folder.path())?);
                    }
                }
            }
        }
        tell(&summary);
    }
    Ok(summary)
}

/// A file, named from anywhere, with its columns and rows.
fn with_size(file: &Path) -> Result<(PathBuf, UVec2), Diagnostic> {
    let file = std::path::absolute(file).unwrap_or(file.to_path_buf());
    let text = format!(
        "Experiment(scene: (terrain: Dem(file: {file:?}, cell_m: 1), camera: Still(eye: (0, 0, 0)), viewport: (8, 8)), \
         chains: {{\"rays\": [HeightPyramid, RayCast]}}, measure: [Time])"
    );
    let prepared = Prepared::first(text, PathBuf::new(), &[])?;
    Ok((file, prepared.data.ground.lattice().last() + 1))
}

/// The stages of an example, and the surface that it is only for.
type Known = (Vec<String>, Option<Surface>);

/// The stages' examples, as lists of stages.
fn chains(stage: Option<&str>) -> Result<Vec<Known>, Diagnostic> {
    let of = cases::examples().into_iter().filter(|example| example.files.is_empty());
    let chains = of.map(|example| (cases::stages_of(example.chain), example.only_on));
    let has =
        |chain: &[String]| stage.is_none_or(|stage| chain.iter().any(|call| call.split('(').next() == Some(stage)));
    let chains: Vec<Known> = chains.filter(|(chain, _)| chain.len() > 1 && has(chain)).collect();
    if chains.is_empty() {
        return Err(Diagnostic::input(format!("no example has the stage `{}`", stage.unwrap_or_default())));
    }
    Ok(chains)
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Broken {
    promise: &'static str,
    view: usize,
    value: f64,
}

/// The simplest trial that breaks the same promise.
fn simplest(
    gpu: &Arc<Gpu>,
    trial: &Trial,
    mut broken: Broken,
    most_tries: usize,
    folder: &Path,
) -> Result<Found, Diagnostic> {
    let promise = broken.promise;
    let mut trial = trial.clone();
    let mut tries = 0;
    'simpler: while tries < most_tries {
        for simpler in trial.simpler(broken.view) {
            tries += 1;
            let Some(planned) = Planned::new(gpu, &simpler, folder)? else { continue };
            let Some(still) = judge(gpu, &planned)? else { continue };
            if let Some(same) = still.into_iter().find(|other| other.promise == promise) {
                (trial, broken) = (simpler, same);
                continue 'simpler;
            }
        }
        break;
    }
    let experiment = trial.experiment(broken.view);
    Ok(Found { promise: broken.promise, value: broken.value, experiment, settings: trial.settings })
}

/// The trial's scene and chain, looking from all of its views; `None` for what is no experiment.
fn prepare(trial: &Trial, folder: &Path) -> Option<Prepared> {
    let setting = |(path, value): &(String, String)| sweep::read_setting(&format!("{path}={value}")).ok();
    let settings: Vec<_> = trial.settings.iter().map(setting).collect::<Option<_>>()?;
    let prepare = |view: usize| Prepared::first(trial.experiment(view), folder.to_path_buf(), &settings).ok();
    let first = prepare(0)?;
    let mut cameras = first.data.cameras().to_vec();
    for view in 1..trial.views.len() {
        cameras.extend_from_slice(prepare(view)?.data.cameras());
    }
    Some(Prepared { data: Arc::new(first.data.with_cameras(cameras)), ..first })
}

/// A trial that can be drawn.
struct Planned {
    prepared: Prepared,
    plan: Arc<Plan>,
    truth_plan: Arc<Plan>,
    /// What it draws keeps a proven bound.
    promised: bool,
}

impl Planned {
    /// `None` for what is no experiment, promises too much or is more than the adapter can do.
    fn new(gpu: &Gpu, trial: &Trial, folder: &Path) -> Result<Option<Self>, Diagnostic> {
        let Some(prepared) = prepare(trial, folder) else { return Ok(None) };
        let Ok(plan) = run::plan(&prepared, &Options::default()) else { return Ok(None) };
        let truth_plan = run::truth_plan(&prepared)?;
        if gpu.check_plan(&plan).is_err() || gpu.check_plan(&truth_plan).is_err() {
            return Ok(None);
        }
        let promise = plan.products.latest::<Drawn<BufferId>>().and_then(|drawn| drawn.promise);
        let promised = promise.is_some_and(|promise| promise.proven);
        Ok(Some(Self { prepared, plan: Arc::new(plan), truth_plan: Arc::new(truth_plan), promised }))
    }
}

/// Draws a trial, and what it breaks of what is promised of it; `None` if a list of it turns out too short.
fn judge(gpu: &Arc<Gpu>, planned: &Planned) -> Result<Option<Vec<Broken>>, Diagnostic> {
    let Planned { prepared, plan, truth_plan, promised } = planned;
    let mut truth = Truth::new(gpu, truth_plan, prepared)?;
    let mut executor = Executor::new(gpu, plan, &prepared.data)?;
    executor.setup()?;
    let mut broken = Vec::new();
    for view in 0..plan.frames {
        executor.frame(view)?;
        if Overflow::after_frame(&executor, plan)?.is_some() {
            return Ok(None);
        }
        let buffers = read(&executor, plan)?;
        let truth = truth.frame(view)?;
        let figures = figures(prepared, plan, view, &buffers, &truth);
        broken.extend(broken_by(&figures, *promised).map(|(promise, value)| Broken { promise, view, value }));
        if !same_again(gpu, prepared, plan, &mut executor, view, &buffers)? {
            broken.push(Broken { promise: "same bits", view, value: 1.0 });
        }
    }
    Ok(Some(broken))
}

/// What the trial's measures say of one view.
fn figures(
    prepared: &Prepared,
    plan: &Plan,
    view: usize,
    buffers: &BTreeMap<BufferId, Vec<u8>>,
    truth: &TruthFrame,
) -> Vec<Measured> {
    let seen = Seen { plan, data: &prepared.data, frame: view, buffers, truth: Some(truth) };
    let measured = |chosen: &Chosen| chosen.measure.begin().frame(&seen);
    prepared.measures.iter().flat_map(measured).collect()
}

/// The promises that figures say are broken, and by how much. Of a surface without a proven bound, only the truth is held to something.
fn broken_by(figures: &[Measured], promised: bool) -> impl Iterator<Item = (&'static str, f64)> {
    let limits = [
        ("truth", "truth_error_max", EXACT_PX),
        ("bound", "bound_violations", 0.0),
        ("cracks", "cracks", 0.0),
        ("pinholes", "pinholes", 0.0),
    ];
    limits.into_iter().take(if promised { 4 } else { 1 }).filter_map(|(promise, name, most)| {
        let value = figures.iter().find(|figure| figure.name == name)?.value?;
        (value > most).then_some((promise, value))
    })
}

fn read(executor: &Executor, plan: &Plan) -> Result<BTreeMap<BufferId, Vec<u8>>, Diagnostic> {
    plan.outputs.iter().map(|&id| Ok((id, executor.read(id)?))).collect()
}

/// Whether a frame has the bits that it had: drawn again, or, if it remembers the one before, drawn by one that has seen nothing.
fn same_again(
    gpu: &Arc<Gpu>,
    prepared: &Prepared,
    plan: &Arc<Plan>,
    executor: &mut Executor,
    view: usize,
    before: &BTreeMap<BufferId, Vec<u8>>,
) -> Result<bool, Diagnostic> {
    let Some(drawn) = plan.products.latest::<Drawn<BufferId>>() else { return Ok(true) };
    let again = if plan.remembers() {
        let mut fresh = Executor::new(gpu, plan, &prepared.data)?;
        fresh.setup()?;
        fresh.frame(view)?;
        fresh.read(drawn.distance)?
    } else {
        executor.frame(view)?;
        executor.read(drawn.distance)?
    };
    Ok(before.get(&drawn.distance).is_none_or(|bytes| *bytes == again))
}
