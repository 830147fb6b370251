//! One cell: frames on the GPU, buffers read back between them, measures.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use super::job::Job;
use super::overflow::Overflow;
use super::timings::{Timed, timed, timings};
use super::walk::{self, Walk};
use super::{Event, Options, Truth, dump, sight};
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::{Executor, Gpu};
use crate::measure::{Figures, Measured, Picture, Sampling, Seen, Tally};
use crate::plan::{BufferId, Often, Plan, Storage};
use crate::report::records::Timings;
use crate::report::{Store, pictures};

pub struct Context<'a> {
    pub gpu: &'a Arc<Gpu>,
    pub job: &'a Job,
    pub plan: &'a Arc<Plan>,
    pub store: &'a Store,
    pub hash: &'a str,
    pub options: &'a Options,
    pub tell: &'a dyn Fn(Event),
}

pub struct Results {
    pub measures: Vec<Measured>,
    /// Figures of each frame, by their names.
    pub by_frame: BTreeMap<String, Vec<Option<f64>>>,
    /// What measures have to show of the frame in the middle.
    pub pictures: Vec<Picture>,
    /// What each picture of a buffer shows, and its file.
    pub looks: Vec<(String, String)>,
    pub timings: Timings,
    pub buffers: Vec<(String, String)>,
    pub warnings: Vec<String>,
}

/// How the run of a cell ended.
pub enum Ended {
    Done(Box<Results>),
    /// A list was too short in some frame, and nothing of this run counts.
    Overflowed(Overflow),
    /// Somebody has asked for the end.
    Stopped,
}

pub fn run(context: &Context, mut truth: Option<&mut Truth>) -> Result<Ended, Diagnostic> {
    let Context { gpu, plan, job: Job { prepared, .. }, .. } = context;
    let mut executor = Executor::new(gpu, plan, &prepared.data)?;
    let once = executor.setup()?;
    let mut looks = Looks::new(context);
    let on_cpu = walk::find_stages(&prepared.cell, &context.options.on_cpu);
    let mut walk = (!on_cpu.is_empty()).then(|| Walk::new(on_cpu.clone()));
    for frame in 0..plan.frames {
        match &mut walk {
            None => executor.frame(frame).map(|_| ())?,
            Some(walk) => {
                executor.begin_path_frame(frame)?;
                let camera = &prepared.data.cameras()[frame];
                walk.frame(prepared, &mut executor, camera, &mut |_| ControlFlow::Break(()))?;
            }
        }
        if let Some(overflow) = Overflow::after_frame(&executor, plan)? {
            return Ok(Ended::Overflowed(overflow));
        }
        looks.frame(&executor, frame, truth.as_deref_mut())?;
        if context.options.stop.is_wanted() {
            return Ok(Ended::Stopped);
        }
        (context.tell)(Event::Frame { done: frame + 1, of: plan.frames });
    }
    // timed apart: reading back and measuring between frames leaves caches and clocks as no renderer has them
    let asked_for = prepared.measures.iter().find_map(|chosen| chosen.measure.sampling());
    let sampling = asked_for.unwrap_or(Sampling { warmup: 0, repeats: 1, until: None });
    let samples = match timed(gpu, plan, &mut executor, sampling, &context.options.stop)? {
        Timed::Frames(samples) => samples,
        Timed::Overflowed(overflow) => return Ok(Ended::Overflowed(overflow)),
        Timed::Stopped => return Ok(Ended::Stopped),
    };
    let mut warnings = gpu.warn_of_loops(plan);
    if !on_cpu.is_empty() {
        let names: Vec<&str> = on_cpu.iter().map(|&at| prepared.cell.stages[at].name.as_str()).collect();
        warnings.push(format!("{} in f64 on the CPU: errors are of that, times of the kernels", names.join(", ")));
    }
    let once = if gpu.summary.timestamps {
        once
    } else {
        warnings.push("this adapter's timestamps are not to be believed: times are those of the clock".to_string());
        executor.setup_by_steps()?
    };
    let timings = timings(plan, &executor, &once, &samples);
    let buffers = looks.hashes();
    let (looked_at, by_frame) = (std::mem::take(&mut looks.pictured), std::mem::take(&mut looks.by_frame));
    let Figures { measured: measures, pictures, warnings: said } = looks.finish();
    warnings.extend(said);
    Ok(Ended::Done(Box::new(Results { measures, by_frame, pictures, looks: looked_at, timings, buffers, warnings })))
}

/// What is made of the buffers of each frame: hashes, dumps and the sums of the measures.
struct Looks<'c, 'a> {
    context: &'c Context<'a>,
    tallies: Vec<Box<dyn Tally>>,
    by_frame: BTreeMap<String, Vec<Option<f64>>>,
    hashers: Vec<blake3::Hasher>,
    /// What each picture of a buffer shows, and its file.
    pictured: Vec<(String, String)>,
}

impl<'c, 'a> Looks<'c, 'a> {
    fn new(context: &'c Context<'a>) -> Self {
        let job = context.job;
        Self {
            context,
            tallies: job.prepared.measures.iter().map(|chosen| chosen.measure.begin()).collect(),
            by_frame: BTreeMap::new(),
            hashers: vec![blake3::Hasher::new(); context.plan.outputs.len()],
            pictured: Vec::new(),
        }
    }

    /// Reads the outputs of a frame that is over, and measures them.
    fn frame(&mut self, executor: &Executor, frame: usize, truth: Option<&mut Truth>) -> Result<(), Diagnostic> {
        let Context { plan, job: Job { prepared, .. }, .. } = self.context;
        let truth = truth.map(|truth| truth.frame(frame)).transpose()?;
        let mut buffers: BTreeMap<BufferId, Vec<u8>> = BTreeMap::new();
        for (at, &id) in plan.outputs.iter().enumerate() {
            let bytes = read_listed(executor, plan, id)?;
            self.hashers[at].update(&bytes);
            self.dump(id, frame, &bytes)?;
            buffers.insert(id, bytes);
        }
        let seen = Seen { plan, data: &prepared.data, frame, buffers: &buffers, truth: truth.as_ref() };
        for figure in self.tallies.iter_mut().flat_map(|tally| tally.frame(&seen)).collect::<Vec<_>>() {
            let frames = self.by_frame.entry(figure.name).or_default();
            // of several measures with one figure the first
            if frames.len() <= frame {
                frames.resize(frame, None);
                frames.push(figure.value.filter(|value| value.is_finite()));
            }
        }
        if self.context.options.every_frame || seen.is_pictured() {
            self.picture(executor, frame)?;
        }
        Ok(())
    }

    /// Pictures of the buffers that were asked for.
    fn picture(&mut self, executor: &Executor, frame: usize) -> Result<(), Diagnostic> {
        let Context { gpu, plan, job: Job { prepared, .. }, options, store, hash, .. } = self.context;
        // a cell whose chain has no such buffer has no picture of it
        let asked_for = options.pictures.iter().filter_map(|name| Some((name, plan.find(name).ok()?)));
        for (name, id) in asked_for {
            let (width, rgb) = sight::picture(gpu, executor, &prepared.data, frame, id)?;
            let file = format!("pictures/{hash}_{}_{frame:04}.png", name.replace(['/', ' ', '@', '#'], "_"));
            store.write(&file, &pictures::png(width, &rgb)?)?;
            self.pictured.push((format!("{name}, frame {frame}"), file));
        }
        Ok(())
    }

    /// Writes a buffer that was asked for; one that stays as it is only once.
    fn dump(&self, id: BufferId, frame: usize, bytes: &[u8]) -> Result<(), Diagnostic> {
        let buffer = self.context.plan.buffer(id);
        let is_new = frame == 0 || buffer.often == Often::EveryFrame && buffer.storage != Storage::Input;
        if !is_new || !self.context.options.dump.contains(&buffer.name) {
            return Ok(());
        }
        let folder = format!("dumps/{}", self.context.hash);
        let name = format!("{folder}/{}", buffer.name.replace(['/', ' '], "_"));
        let store = self.context.store;
        if frame == 0 {
            let data = &self.context.job.prepared.data;
            store.write(&format!("{folder}/camera.json"), format!("{:#}", dump::cameras(data)).as_bytes())?;
            store.write(&format!("{name}.json"), format!("{:#}", dump::about(buffer)).as_bytes())?;
        }
        store.write(&format!("{name}_{frame:04}.npy"), &dump::npy(buffer, bytes)?)
    }

    fn hashes(&self) -> Vec<(String, String)> {
        let plan = self.context.plan;
        let hash = |hasher: &blake3::Hasher| hasher.finalize().to_hex().as_str()[..32].to_string();
        let named = |(id, hasher): (&BufferId, _)| (plan.buffer(*id).name.clone(), hash(hasher));
        plan.outputs.iter().zip(&self.hashers).map(named).collect()
    }

    /// The figures of all measures; of several with one name the first.
    fn finish(self) -> Figures {
        let mut all = Figures::default();
        for tally in self.tallies {
            let Figures { measured, pictures, warnings } = tally.finish();
            let is_new = |all: &Figures, name: &str| all.measured.iter().all(|known| known.name != name);
            for figure in measured {
                if is_new(&all, &figure.name) {
                    all.measured.push(figure);
                }
            }
            all.pictures.extend(pictures);
            all.warnings.extend(warnings);
        }
        all
    }
}

/// The bytes of a buffer; of a list, those of its elements, since past its end there is anything.
fn read_listed(executor: &Executor, plan: &Plan, id: BufferId) -> Result<Vec<u8>, Diagnostic> {
    let mut bytes = executor.read(id)?;
    if let Some(length) = plan.products.length_of(id).filter(|length| plan.lives(length.count)) {
        let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&executor.read(length.count)?);
        let elements = counts.get(length.at).copied().unwrap_or(0) / length.per_element;
        bytes.truncate(elements as usize * plan.buffer(id).elem.bytes() as usize);
    }
    Ok(bytes)
}
