//! One cell: frames on the GPU, buffers read back between them, measures.

use crate::experiment::Measure;
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::execute::SubmissionTime;
use crate::gpu::{Executor, Gpu};
use crate::measure::image::Picture;
use crate::measure::screen_error::FrameError;
use crate::measure::{Measured, error_buffer, image, mesh, screen_error, time};
use crate::plan::{Often, Plan, Storage, Vertices, Work};
use crate::report::pictures;
use crate::report::records::{KernelTime, Store, Timings};

use super::truth::TruthFrame;
use super::{Event, Options, Prepared, Truth, dump};

pub struct Context<'a> {
    pub gpu: &'a Gpu,
    pub prepared: &'a Prepared,
    pub plan: &'a Plan,
    pub store: &'a Store,
    pub hash: &'a str,
    pub options: &'a Options,
    pub tell: &'a dyn Fn(Event),
}

pub struct Results {
    pub measures: Vec<Measured>,
    pub timings: Timings,
    pub buffers: Vec<(String, String)>,
    pub warnings: Vec<String>,
}

pub fn picture_name(hash: &str, kind: &str) -> String {
    format!("pictures/{hash}_{kind}.png")
}

/// How the run of a cell ended.
pub enum Ended {
    Done(Box<Results>),
    /// A list was too short in some frame, and nothing of this run counts.
    Overflowed {
        list: String,
        capacity: u32,
        needed: u32,
    },
}

/// The first list that the frame which was just drawn needed longer.
fn overflow(executor: &Executor, plan: &Plan) -> Result<Option<Ended>, Diagnostic> {
    for guard in &plan.guards {
        let needed: Vec<u32> = bytemuck::pod_collect_to_vec(&executor.read(guard.needed)?);
        let needed = needed.get(guard.at).copied().unwrap_or(0);
        if needed > guard.capacity {
            return Ok(Some(Ended::Overflowed { list: guard.list.clone(), capacity: guard.capacity, needed }));
        }
    }
    Ok(None)
}

pub fn run(context: &Context, mut truth: Option<&mut Truth>) -> Result<Ended, Diagnostic> {
    let Context { gpu, prepared, plan, .. } = context;
    let executor = Executor::new(gpu, plan, &prepared.data)?;
    let once = executor.setup()?;
    let mut tally = Tally::new(context);
    for frame in 0..plan.frames {
        executor.frame(frame)?;
        if let Some(overflowed) = overflow(&executor, plan)? {
            return Ok(overflowed);
        }
        tally.frame(&executor, frame, truth.as_deref_mut())?;
        (context.tell)(Event::Frame { done: frame + 1, of: plan.frames });
    }
    // timed apart: reading back and measuring between frames leaves caches and clocks as no renderer has them
    let (warmup, repeats) = sampling(prepared);
    for frame in 0..warmup {
        executor.frame(frame as usize % plan.frames)?;
    }
    let (frames, by_steps) = match timed(context, &executor, repeats)? {
        Timed::Frames(frames, by_steps) => (frames, by_steps),
        Timed::Overflowed(overflowed) => return Ok(overflowed),
    };
    let mut warnings = Vec::new();
    let timings = if gpu.summary.timestamps {
        timings(plan, &executor, &once, &frames, &frames)
    } else {
        warnings.push("timestamps are missing or contradict the clock: times are wall times".to_string());
        timings(plan, &executor, &executor.setup_by_steps()?, &frames, &by_steps)
    };
    let (measures, buffers) = tally.finish();
    Ok(Ended::Done(Box::new(Results { measures, timings, buffers, warnings })))
}

/// The path as often as asked for, in whole frames and, where nothing better tells, in steps. Each frame is looked at both ways at
/// once, so that the clock treats them alike; unless a frame starts from what the last one left, which must not be itself.
fn timed(context: &Context, executor: &Executor, repeats: u32) -> Result<Timed, Diagnostic> {
    let (mut frames, mut by_steps) = (Vec::new(), Vec::new());
    let needs_steps = !context.gpu.summary.timestamps;
    let ways = if needs_steps { &[false, true][..] } else { &[false] };
    let order: Vec<(usize, bool)> = match context.plan.remembers() {
        true => ways.iter().flat_map(|&way| (0..context.plan.frames).map(move |frame| (frame, way))).collect(),
        false => (0..context.plan.frames).flat_map(|frame| ways.iter().map(move |&way| (frame, way))).collect(),
    };
    for _ in 0..repeats {
        for &(frame, in_steps) in &order {
            match in_steps {
                true => by_steps.push(executor.frame_by_steps(frame)?),
                false => frames.push(executor.frame(frame)?),
            }
            // after another frame than before, a list can be longer
            if let Some(overflowed) = overflow(executor, context.plan)? {
                return Ok(Timed::Overflowed(overflowed));
            }
        }
    }
    Ok(Timed::Frames(frames, by_steps))
}

/// Whole frames and frames in steps, or a list that was too short for one of them.
enum Timed {
    Frames(Vec<SubmissionTime>, Vec<SubmissionTime>),
    Overflowed(Ended),
}

/// Frames before the first that counts, and how often the path is timed.
fn sampling(prepared: &Prepared) -> (u32, u32) {
    let time = prepared.cell.measures.iter().find_map(|measure| match measure {
        Measure::Time { warmup, repeats } => Some((*warmup, (*repeats).max(1))),
        _ => None,
    });
    time.unwrap_or((0, 1))
}

/// What is summed up over the frames.
struct Tally<'c, 'a> {
    context: &'c Context<'a>,
    errors: screen_error::Summary,
    mesh: mesh::Summary,
    own: error_buffer::Summary,
    psnr_db: Vec<f64>,
    equal_pictures: bool,
    ssim: Vec<f64>,
    hashers: Vec<blake3::Hasher>,
}

impl<'c, 'a> Tally<'c, 'a> {
    fn new(context: &'c Context<'a>) -> Self {
        Self {
            context,
            errors: Default::default(),
            mesh: Default::default(),
            own: Default::default(),
            psnr_db: Vec::new(),
            equal_pictures: false,
            ssim: Vec::new(),
            hashers: vec![blake3::Hasher::new(); context.plan.outputs.len()],
        }
    }

    /// Reads the outputs of a frame that is over, and measures them.
    fn frame(&mut self, executor: &Executor, frame: usize, truth: Option<&mut Truth>) -> Result<(), Diagnostic> {
        let plan = self.context.plan;
        let truth = truth.map(|truth| truth.frame(frame)).transpose()?;
        let (mut list, mut drawn_m) = (None, None);
        let drawn_vertices = self.drawn_vertices(executor)?;
        for (at, &id) in plan.outputs.iter().enumerate() {
            let buffer = plan.buffer(id);
            let mut bytes = executor.read(id)?;
            if let ("triangle", Some(drawn_vertices)) = (buffer.name.as_str(), drawn_vertices) {
                // past the list's end there is anything
                bytes.truncate(drawn_vertices as usize / 3 * 16);
            }
            self.hashers[at].update(&bytes);
            let first = frame == 0 || buffer.often == Often::EveryFrame && buffer.storage != Storage::Input;
            if first && self.context.options.dump.contains(&buffer.name) {
                let name = format!("dumps/{}/{}_{frame:04}.npy", self.context.hash, buffer.name);
                self.context.store.write(&name, &dump::npy(buffer, &bytes)?)?;
            }
            match buffer.name.as_str() {
                "triangle" => list = Some(bytemuck::pod_collect_to_vec(&bytes)),
                "distance" => drawn_m = Some(bytemuck::pod_collect_to_vec(&bytes)),
                _ => {}
            }
            match (buffer.name.as_str(), &truth) {
                ("distance", Some(truth)) => self.distance(frame, &bytemuck::pod_collect_to_vec(&bytes), truth)?,
                ("colour", Some(truth)) => self.colour(frame, &bytemuck::pod_collect_to_vec(&bytes), truth)?,
                ("grid_error", _) => self.own.add_grid(&bytemuck::pod_collect_to_vec(&bytes)),
                ("error", _) => self.own.add_pixels(&bytemuck::pod_collect_to_vec(&bytes)),
                ("vertex", _) => self.vertices(frame, &bytemuck::pod_collect_to_vec(&bytes), buffer.dims[1] as usize),
                _ => {}
            }
        }
        if let (Some(list), Some(drawn_vertices)) = (list, drawn_vertices) {
            let data = &self.context.prepared.data;
            let list = mesh::Listed::new(&list, drawn_vertices);
            let seen = drawn_m.as_deref().zip(truth.as_ref().map(|truth| &truth.distance_m[..]));
            self.mesh.add_list(&list, &data.terrain, &data.cameras[frame], seen);
        }
        Ok(())
    }

    /// Corners of the list of triangles that was drawn in this frame, if a mesh is one.
    fn drawn_vertices(&self, executor: &Executor) -> Result<Option<u32>, Diagnostic> {
        let plan = self.context.plan;
        let drawn = plan.steps.iter().find_map(|step| match step.work {
            Work::Draw { vertices: Vertices::List(count), .. } => Some(count),
            _ => None,
        });
        let Some(count) = drawn else { return Ok(None) };
        let count: Vec<u32> = bytemuck::pod_collect_to_vec(&executor.read(count)?);
        Ok(count.first().copied())
    }

    fn is_pictured(&self, frame: usize) -> bool {
        frame == self.context.plan.frames / 2
    }

    fn distance(&mut self, frame: usize, drawn_m: &[f32], truth: &TruthFrame) -> Result<(), Diagnostic> {
        let data = &self.context.prepared.data;
        let surface = data.scene.surface;
        let bound_px = self.context.plan.promise.map(|promise| promise.bound_px);
        let error: FrameError =
            screen_error::frame(&data.terrain, surface, &data.cameras[frame], drawn_m, &truth.distance_m, bound_px);
        self.errors.add(&error, self.context.prepared.cell.threshold_px());
        if self.is_pictured(frame) {
            let mixed_up: Vec<bool> =
                drawn_m.iter().zip(&truth.distance_m).map(|(a, b)| (*a < 0.0) != (*b < 0.0)).collect();
            let threshold_px = self.context.prepared.cell.threshold_px();
            let png = pictures::error_png(data.scene.viewport.0, &error.error_px, &mixed_up, threshold_px);
            self.context.store.write(&picture_name(self.context.hash, "error"), &png)?;
        }
        Ok(())
    }

    fn colour(&mut self, frame: usize, pixels: &[u32], truth: &TruthFrame) -> Result<(), Diagnostic> {
        let width = self.context.prepared.data.scene.viewport.0;
        let drawn = Picture { width: width as usize, pixels };
        let exact = Picture { pixels: &truth.colour, ..drawn };
        match image::psnr_db(drawn, exact) {
            Some(psnr_db) => self.psnr_db.push(psnr_db),
            None => self.equal_pictures = true,
        }
        self.ssim.push(image::ssim(drawn, exact));
        if self.is_pictured(frame) {
            self.context
                .store
                .write(&picture_name(self.context.hash, "image"), &pictures::colour_png(width, pixels))?;
        }
        Ok(())
    }

    fn vertices(&mut self, frame: usize, vertices: &[[f32; 4]], columns: usize) {
        let triangles = mesh::grid_triangles(vertices, columns);
        self.mesh.add(&triangles, &self.context.prepared.data.cameras[frame]);
    }

    fn finish(self) -> (Vec<Measured>, Vec<(String, String)>) {
        let cell = &self.context.prepared.cell;
        let mut measures = Vec::new();
        if cell.wants("ScreenError") {
            measures.extend(self.errors.measures());
        } else if cell.wants("Coverage") {
            let all = self.errors.measures();
            let coverage = ["drawn", "true_surface", "silhouette_misses"];
            measures.extend(all.into_iter().filter(|measure| coverage.contains(&measure.name.as_str())));
        }
        if cell.wants("Image") {
            // the worst frame; equal pictures have no ratio and are better than any
            let psnr = self.psnr_db.iter().copied().reduce(f64::min);
            measures.push(Measured::new("psnr", psnr, "dB"));
            measures.push(Measured::new("ssim", self.ssim.iter().copied().reduce(f64::min), ""));
            measures.push(Measured::new(
                "equal_pictures",
                f64::from(self.equal_pictures && self.psnr_db.is_empty()),
                "",
            ));
        }
        if cell.wants("Mesh") {
            measures.extend(self.mesh.measures());
        }
        if cell.wants("ErrorBuffer") {
            measures.extend(self.own.measures());
        }
        let name = |at: usize| self.context.plan.buffer(self.context.plan.outputs[at]).name.clone();
        let hash = |hasher: &blake3::Hasher| hasher.finalize().to_hex().as_str()[..32].to_string();
        let buffers = self.hashers.iter().enumerate().map(|(at, hasher)| (name(at), hash(hasher))).collect();
        (measures, buffers)
    }
}

/// `frames` are whole submissions; `by_steps` say what each step took in them, or by itself.
fn timings(
    plan: &Plan,
    executor: &Executor,
    once: &SubmissionTime,
    frames: &[SubmissionTime],
    by_steps: &[SubmissionTime],
) -> Timings {
    // one invalid stamp makes the whole step "not measured": a median of the rest would flatter it
    let all = |samples: Vec<Option<f64>>| samples.into_iter().collect::<Option<Vec<f64>>>().and_then(time::spread);
    let of_step = |at: usize, submissions: &[SubmissionTime]| {
        let found = submissions.iter().flat_map(|submission| &submission.steps).filter(|time| time.step == at);
        all(found.map(|time| time.ms).collect())
    };
    let kernels: Vec<KernelTime> = plan
        .steps
        .iter()
        .enumerate()
        .map(|(at, step)| {
            let is_once = step.often == Often::Once;
            let submissions = if is_once { std::slice::from_ref(once) } else { by_steps };
            KernelTime {
                stage: step.stage.clone(),
                step: step.label.clone(),
                once: is_once,
                ms: of_step(at, submissions),
            }
        })
        .collect();
    let outside = |(frame, steps): (&SubmissionTime, &SubmissionTime)| {
        let inside_ms: Option<f64> = steps.steps.iter().map(|time| time.ms).sum();
        inside_ms.map(|inside_ms| 1.0 - inside_ms / frame.wall_ms)
    };
    let outside = all(frames.iter().zip(by_steps).map(outside).collect()).map(|spread| spread.median.max(0.0));
    Timings {
        kernels_by: if executor.believes_stamps() { "timestamps" } else { "clock" }.into(),
        frame_gpu_ms: all(frames.iter().map(|submission| submission.gpu_ms).collect()),
        frame_wall_ms: time::spread(frames.iter().map(|submission| submission.wall_ms).collect()),
        outside_kernels: outside,
        once_ms: once.wall_ms,
        prepare_ms: executor.prepare_ms,
        kernels,
    }
}
