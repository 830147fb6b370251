//! One side of what is looked at: from a wish to buffers on the device. It makes again only what a new wish changes.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::probe::Copies;
use super::wish::{CellName, F64Shown, Moment, Shown, TruthShown, Wish};
use crate::camera::Camera;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::{Cell, Experiment};
use crate::frame::FrameInput;
use crate::gpu::{Executor, Gpu, Held};
use crate::kernel::{Elem, Packing};
use crate::measure::{Measured, Seen, TruthFrame, screen_error};
use crate::plan::once::is_repeatable;
use crate::plan::product::Drawn;
use crate::plan::{Buffer, BufferId, Capacities, Often, Plan, Spread, step_names};
use crate::reference::{self, Values};
use crate::run::sight::companions;
use crate::run::walk::{Walk, find_stages};
use crate::run::{Options, Overflow, Prepared, Scenes, Truth, truth_plan};

/// Scenes that are kept in memory although nobody looks at them now.
const MOST_SCENES: usize = 4;

/// A step's time is the least of so many, since the window is drawn on the same device; of long frames, of fewer.
const MOST_TIMED: usize = 5;
const TIMED_FOR: Duration = Duration::from_millis(300);

/// On the device, a pixel on which nothing is drawn.
const NOTHING: f32 = -1.0;

/// What a long piece of work is told and tells.
pub struct Work<'a> {
    pub tell: &'a dyn Fn(String, Option<f32>),
    /// Somebody wants it to end.
    pub stop: &'a AtomicBool,
}

impl Work<'_> {
    fn goes_on(&self) -> Result<(), Diagnostic> {
        match self.stop.load(Ordering::Relaxed) {
            true => Err(Diagnostic::run("cancelled")),
            false => Ok(()),
        }
    }
}

pub struct Subject {
    gpu: Arc<Gpu>,
    scenes: Scenes,
    made: Option<Made>,
    truth: Option<(Arc<Prepared>, Truth)>,
    /// How much was shown.
    shown: u64,
}

/// What does for all wishes with the same plan.
struct Made {
    wish: Wish,
    experiment: Arc<Experiment>,
    cells: Vec<CellName>,
    prepared: Arc<Prepared>,
    /// The same for the camera of the wish: a path's, or any.
    viewed: Arc<Prepared>,
    run_plan: Arc<Plan>,
    plan: Arc<Plan>,
    step_names: Vec<String>,
    executor: Executor,
    buffers: Vec<(String, BufferId)>,
    companions: Vec<BufferId>,
    capacities: Capacities,
    walk: Option<Walk>,
    walked: BTreeMap<String, Arc<F64Shown>>,
    /// The frame of the path that the history is of.
    at: Option<usize>,
    /// The last camera that came by itself, and what was travelled and turned until then.
    live: Option<(Camera, f64, f64)>,
    step_ms: BTreeMap<usize, f64>,
}

fn cell_name(cell: &Cell) -> CellName {
    CellName { chain: cell.chain.clone(), settings: cell.settings.clone() }
}

/// The cell that is wanted, or the one that is most like it.
fn choose(cells: &[Cell], wanted: &CellName) -> usize {
    let alike = |cell: &Cell| {
        let shared = cell.settings.iter().filter(|setting| wanted.settings.contains(setting)).count();
        (cell.chain == wanted.chain, shared)
    };
    let best = cells.iter().map(alike).max().unwrap_or_default();
    cells.iter().position(|cell| alike(cell) == best).unwrap_or(0)
}

impl Subject {
    pub fn new(gpu: &Arc<Gpu>) -> Self {
        Self { gpu: gpu.clone(), scenes: Scenes::default(), made: None, truth: None, shown: 0 }
    }

    /// Carries a wish out. After a mistake everything is as before.
    pub fn update(&mut self, wish: &Wish, work: &Work) -> Result<Arc<Shown>, Diagnostic> {
        let mut capacities = Capacities::new();
        let start = Instant::now();
        let is_new = !self.made.as_ref().is_some_and(|made| made.does_for(wish));
        if is_new {
            self.made = Some(self.make(wish, &capacities, work)?);
        }
        let made_ms = is_new.then(|| start.elapsed().as_secs_f64() * 1e3);
        loop {
            work.goes_on()?;
            let Some(made) = &mut self.made else { return Err(Diagnostic::run("nothing was made")) };
            let start = Instant::now();
            match made.run(wish, work) {
                Ok(None) => {
                    let frame_ms = start.elapsed().as_secs_f64() * 1e3;
                    return self.shown(wish, (made_ms, frame_ms), work);
                }
                Ok(Some(Overflow { list, needed, .. })) => {
                    capacities = made.capacities.clone();
                    capacities.insert(list, needed.saturating_add(needed / 4));
                    self.made = Some(self.make(wish, &capacities, work)?);
                }
                Err(error) => {
                    // what the frame left is not known
                    made.at = None;
                    made.walk = None;
                    return Err(error);
                }
            }
        }
    }

    fn make(&mut self, wish: &Wish, capacities: &Capacities, work: &Work) -> Result<Made, Diagnostic> {
        (work.tell)("planning".into(), None);
        let experiment = Arc::new(wish.document.read()?);
        let cells = experiment.cells(&wish.document.settings()?)?;
        let names = cells.iter().map(cell_name).collect();
        let cell = cells[choose(&cells, &wish.cell)].clone();
        let prepared = Arc::new(self.scenes.prepare(cell.clone(), &experiment.folder)?);
        self.scenes.keep_few(MOST_SCENES);
        work.goes_on()?;
        let viewed = match wish.moment {
            Moment::Frame(_) => prepared.clone(),
            Moment::Live(_) => {
                let any = self.scenes.prepare(cell, &experiment.folder)?;
                Arc::new(Prepared { data: Arc::new(any.data.with_any_view()), ..any })
            }
        };
        let run_plan = Arc::new(prepared.plan(&Options::default(), capacities)?);
        let options = Options { dump: wish.buffers.clone(), ..Options::default() };
        let (mut buffers, mut beside) = (Vec::new(), Vec::new());
        let largest = self.gpu.limits.max_storage_buffer_binding_size;
        let plan = viewed.plan_also(&options, capacities, &mut |chain, dumped| {
            beside = companions(chain, dumped, &run_plan, largest);
            beside.clone()
        })?;
        // of what another chain has, this one may have nothing
        buffers.extend(wish.buffers.iter().filter_map(|name| Some((name.clone(), plan.find(name).ok()?))));
        let plan = Arc::new(plan);
        self.gpu.check_plan(&plan)?;
        // what the CPU puts in the place of results must not come into what is shown until then
        let before = self.made.as_ref().map(|made| &made.executor).filter(|_| wish.on_cpu.is_empty());
        let executor = Executor::without_waiting(&self.gpu, &plan, &viewed.data, before)?;
        executor.submit_setup()?;
        Ok(Made {
            wish: wish.clone(),
            experiment,
            cells: names,
            step_names: step_names(&plan.steps),
            prepared,
            viewed,
            run_plan,
            plan,
            executor,
            buffers,
            companions: beside,
            capacities: capacities.clone(),
            walk: None,
            walked: BTreeMap::new(),
            at: None,
            live: None,
            step_ms: BTreeMap::new(),
        })
    }

    fn shown(
        &mut self,
        wish: &Wish,
        (made_ms, frame_ms): (Option<f64>, f64),
        work: &Work,
    ) -> Result<Arc<Shown>, Diagnostic> {
        let Some(made) = &mut self.made else { return Err(Diagnostic::run("nothing was made")) };
        let held = |id: BufferId| made.executor.held(id);
        let named = |(name, id): &(String, BufferId)| Ok((name.clone(), (*id, held(*id)?)));
        let buffers = made.buffers.iter().map(named).collect::<Result<BTreeMap<_, _>, Diagnostic>>()?;
        let companions = made.companions.iter().filter(|id| made.plan.lives(**id));
        let companions = companions.map(|&id| Ok((id, held(id)?))).collect::<Result<BTreeMap<_, _>, Diagnostic>>()?;
        let camera = made.camera(&wish.moment)?;
        let mut notes = Vec::new();
        let wanted_truth = wish.truth && made.prepared.cell.stages.iter().len() > 0;
        let (prepared, plan, frames) = (made.prepared.clone(), made.plan.clone(), made.prepared.data.cameras().len());
        let mut shown = Shown {
            wish: wish.clone(),
            experiment: made.experiment.clone(),
            cells: made.cells.clone(),
            prepared,
            run_plan: made.run_plan.clone(),
            plan,
            step_names: made.step_names.clone(),
            camera,
            frames,
            buffers,
            companions,
            frame_ms,
            made_ms,
            step_ms: made.step_ms.clone(),
            truth: None,
            in_f64: made.walked.clone(),
            notes: Vec::new(),
            copies: Copies::default(),
            number: self.shown,
        };
        self.shown += 1;
        if wanted_truth {
            match self.truth_of(&shown, work) {
                Ok(truth) => shown.truth = Some(truth),
                Err(error) => notes.push(error.to_string()),
            }
        }
        shown.notes = notes;
        // times come last: where there is history, timing changes it
        if wish.times {
            self.time(&mut shown, wish, work)?;
        }
        Ok(Arc::new(shown))
    }

    fn time(&mut self, shown: &mut Shown, wish: &Wish, work: &Work) -> Result<(), Diagnostic> {
        let Some(made) = &mut self.made else { return Ok(()) };
        let Moment::Frame(frame) = wish.moment else { return Ok(()) };
        // with history, another run of the frame would change what is shown
        if made.step_ms.is_empty() && !made.plan.remembers() {
            let times = made.timed(frame, work);
            // timed frames leave taps out, and have written over what shares their memory
            made.executor.frame(frame)?;
            made.step_ms = times?;
        }
        shown.step_ms = made.step_ms.clone();
        Ok(())
    }

    fn truth_of(&mut self, shown: &Shown, work: &Work) -> Result<Arc<TruthShown>, Diagnostic> {
        (work.tell)("ground truth".into(), None);
        let drawn: Drawn<BufferId> = shown.plan.products.latest().ok_or_else(|| {
            Diagnostic::input("nothing is drawn by this chain, so that there is nothing to compare with the truth")
        })?;
        let (prepared, frame) = match shown.wish.moment {
            Moment::Frame(frame) => (shown.prepared.clone(), frame),
            Moment::Live(camera) => (Arc::new(self.still(camera)?), 0),
        };
        let is_known = self.truth.as_ref().is_some_and(|(known, _)| Arc::ptr_eq(known, &prepared));
        if !is_known {
            let plan = Arc::new(truth_plan(&prepared)?);
            self.truth = Some((prepared.clone(), Truth::new(&self.gpu, &plan, &prepared)?));
        }
        let Some((_, truth)) = &mut self.truth else { return Err(Diagnostic::run("there is no ground truth")) };
        let truth = truth.frame(frame)?;
        work.goes_on()?;
        let Some(distance) = shown.companion(drawn.distance) else {
            return Err(Diagnostic::input("the chain's distances are left out, since nobody measures them"));
        };
        (work.tell)("screen-space error".into(), None);
        let drawn_bytes = distance.read_all(&self.gpu)?;
        let drawn_m: Vec<f32> = bytemuck::pod_collect_to_vec(&drawn_bytes);
        let ground = prepared.data.ground.as_ref();
        let error = screen_error::frame(ground, &shown.camera, &drawn_m, &truth.distance_m, None).error_px;
        let error: Vec<f32> = error.into_iter().map(|error| if error.is_nan() { NOTHING } else { error }).collect();
        let figures = figures(&prepared, &shown.plan, frame, (drawn.distance, drawn_bytes), &truth);
        let (width, height) = shown.camera.viewport;
        let about = |name: &str, elem, unit, meaning: &str| Buffer {
            spread: Spread::Pixels,
            ..Buffer::new(name, elem, &[height, width], unit, meaning)
        };
        let upload = |about: Buffer, bytes: &[u8]| Held::upload(&self.gpu, about, bytes);
        let meaning = "pixels between what is drawn and the true surface at the same ground position";
        let missing =
            Buffer { missing: Some(NOTHING), ..about("truth", Elem::F32, "m", "distance along the pixel's ray") };
        let error_px = Buffer { missing: Some(NOTHING), ..about("screen error", Elem::F32, "px", meaning) };
        let colours =
            Buffer { packing: Packing::Bytes, ..about("truth picture", Elem::U32, "rgba8", "the true picture") };
        let distance_m: Vec<f32> = truth.distance_m.iter().map(|&distance_m| distance_m as f32).collect();
        Ok(Arc::new(TruthShown {
            distance: upload(missing, bytemuck::cast_slice(&distance_m))?,
            picture: upload(colours, bytemuck::cast_slice(&truth.colour))?,
            error: upload(error_px, bytemuck::cast_slice(&error))?,
            figures,
        }))
    }

    /// The cell with one camera.
    fn still(&mut self, camera: Camera) -> Result<Prepared, Diagnostic> {
        let Some(made) = &self.made else { return Err(Diagnostic::run("nothing was made")) };
        let folder = made.wish.document.folder();
        let prepared = self.scenes.prepare(made.prepared.cell.clone(), &folder)?;
        Ok(Prepared { data: Arc::new(prepared.data.with_cameras(vec![camera])), ..prepared })
    }
}

/// The error of one frame as the experiment measures it.
fn figures(
    prepared: &Prepared,
    plan: &Plan,
    frame: usize,
    (id, bytes): (BufferId, Vec<u8>),
    truth: &TruthFrame,
) -> Vec<Measured> {
    let own = prepared.measures.iter().find(|chosen| chosen.info.name == screen_error::INFO.name);
    let Some(chosen) = own else { return Vec::new() };
    let buffers = BTreeMap::from([(id, bytes)]);
    chosen.measure.begin().frame(&Seen { plan, data: &prepared.data, frame, buffers: &buffers, truth: Some(truth) })
}

impl Made {
    fn does_for(&self, wish: &Wish) -> bool {
        let own = &self.wish;
        let is_live = |moment: &Moment| matches!(moment, Moment::Live(_));
        own.document == wish.document
            && own.cell == wish.cell
            && own.buffers == wish.buffers
            && own.kernels == wish.kernels
            && is_live(&own.moment) == is_live(&wish.moment)
            && (own.on_cpu == wish.on_cpu || !self.executor.is_altered())
    }

    fn camera(&self, moment: &Moment) -> Result<Camera, Diagnostic> {
        match *moment {
            Moment::Live(camera) => Ok(camera),
            Moment::Frame(frame) => {
                let cameras = self.prepared.data.cameras();
                let last = cameras.len().checked_sub(1).ok_or_else(|| Diagnostic::input("the path has no frame"))?;
                Ok(cameras[frame.min(last)])
            }
        }
    }

    /// The least time of each step, of a few.
    fn timed(&mut self, frame: usize, work: &Work) -> Result<BTreeMap<usize, f64>, Diagnostic> {
        let mut least: BTreeMap<usize, f64> = BTreeMap::new();
        let start = Instant::now();
        for _ in 0..MOST_TIMED {
            let mut times = self.executor.frame_by_steps(frame)?.steps;
            // what runs once and adds to what is there would add to what is shown
            if self.plan.steps.iter().filter(|step| step.often == Often::Once).all(is_repeatable) {
                times.extend(self.executor.setup_by_steps()?.steps);
            }
            for (step, ms) in times.into_iter().filter_map(|time| Some((time.step, time.ms?))) {
                least.entry(step).and_modify(|least| *least = least.min(ms)).or_insert(ms);
            }
            if start.elapsed() > TIMED_FOR || work.goes_on().is_err() {
                break;
            }
        }
        Ok(least)
    }

    /// Runs the frame of a wish, and with history those before it.
    fn run(&mut self, wish: &Wish, work: &Work) -> Result<Option<Overflow>, Diagnostic> {
        let on_cpu = find_stages(&self.prepared.cell, &wish.on_cpu);
        let walks = wish.in_f64 || !on_cpu.is_empty();
        if self.wish.on_cpu != wish.on_cpu || self.walk.is_some() != walks {
            self.wish.on_cpu = wish.on_cpu.clone();
            self.walk = walks.then(|| Walk::new(on_cpu));
            self.at = None;
        }
        self.walked.clear();
        match wish.moment {
            Moment::Live(camera) => {
                self.begin_live(camera)?;
                self.carry_out(&camera, wish.in_f64, work)?;
                Ok(Overflow::after_frame(&self.executor, &self.plan)?)
            }
            Moment::Frame(frame) => self.run_path(frame.min(self.plan.frames.saturating_sub(1)), wish.in_f64, work),
        }
    }

    fn run_path(&mut self, frame: usize, in_f64: bool, work: &Work) -> Result<Option<Overflow>, Diagnostic> {
        let first = match (self.plan.remembers(), self.at) {
            (false, _) => frame,
            (true, Some(at)) if at < frame => at + 1,
            (true, Some(at)) if at == frame && self.walk.is_none() => return Ok(None),
            (true, _) => {
                self.executor.reset_history();
                0
            }
        };
        for at in first..=frame {
            work.goes_on()?;
            if frame > first {
                let share = (at - first) as f32 / (frame - first) as f32;
                (work.tell)(format!("frame {at} of {frame}, since the chain remembers"), Some(share));
            }
            self.executor.begin_single_path_frame(at)?;
            let camera = self.prepared.data.cameras()[at];
            self.carry_out(&camera, in_f64 && at == frame, work)?;
            self.at = Some(at);
            if let Some(overflow) = Overflow::after_frame(&self.executor, &self.plan)? {
                return Ok(Some(overflow));
            }
        }
        Ok(None)
    }

    fn begin_live(&mut self, camera: Camera) -> Result<(), Diagnostic> {
        let data = self.viewed.data.clone();
        let input = match self.live {
            None => FrameInput::first(&data, camera),
            Some((before, travelled_m, turned)) => {
                FrameInput { travelled_m, turned, ..FrameInput::first(&data, before) }.next(camera)
            }
        };
        self.live = Some((camera, input.travelled_m, input.turned));
        Ok(self.executor.begin_live_frame(&input)?)
    }

    /// Runs the frame that was begun, stage by stage if somebody compares.
    fn carry_out(&mut self, camera: &Camera, in_f64: bool, work: &Work) -> Result<(), Diagnostic> {
        let Some(walk) = &mut self.walk else {
            self.executor.submit_frame()?;
            return Ok(());
        };
        let (plan, prepared) = (self.plan.clone(), self.viewed.clone());
        let gpu = self.executor.gpu().clone();
        let mut walked = BTreeMap::new();
        let mut failed = None;
        walk.frame(&prepared, &mut self.executor, camera, &mut |seen| {
            if !in_f64 {
                return ControlFlow::Break(());
            }
            let stages = &prepared.cell.stages;
            let share = (seen.stage_index + 1) as f32 / stages.len() as f32;
            (work.tell)(format!("{} in f64", stages[seen.stage_index].name), Some(share));
            if let Err(cancelled) = work.goes_on() {
                failed = Some(cancelled);
                return ControlFlow::Break(());
            }
            // later stages that make a buffer of the name again take its place, and both can be asked for by their stage
            let buffer = plan.buffer(seen.buffer);
            match f64_shown(&gpu, buffer, seen.on_gpu, seen.in_f64) {
                Ok(shown) => {
                    let shown = Arc::new(shown);
                    walked.insert(format!("{}#{}", buffer.name, seen.stage_index), shown.clone());
                    walked.insert(buffer.name.clone(), shown);
                    ControlFlow::Continue(())
                }
                Err(error) => {
                    failed = Some(error);
                    ControlFlow::Break(())
                }
            }
        })?;
        self.walked = walked;
        failed.map_or(Ok(()), Err)
    }
}

/// A reference's values as a buffer to look at, in f32 as its neighbour on the device.
fn f64_shown(gpu: &Gpu, buffer: &Buffer, on_gpu: &Values, values: &Arc<Values>) -> Result<F64Shown, Diagnostic> {
    let elem = match values.components {
        1 => Elem::F32,
        2 => Elem::Vec2F32,
        _ => Elem::Vec4F32,
    };
    let about = Buffer {
        elem,
        packing: Packing::None,
        parts: &[],
        missing: None,
        meaning: format!("{}, in f64", buffer.meaning),
        ..buffer.clone()
    };
    // of three numbers in an element there is no buffer
    let bytes = elem.bytes_of(Packing::None, &values.value);
    let held = Held::upload(gpu, about, &bytes)?;
    Ok(F64Shown { values: values.clone(), held, difference: reference::compare(&on_gpu.value, values) })
}
