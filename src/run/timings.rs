//! Times of a cell: warm-up, the path as often as asked for, and what each step took.

use std::time::{Duration, Instant};

use super::Stop;
use super::overflow::Overflow;
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::submit::SubmissionTime;
use crate::gpu::{Executor, Gpu};
use crate::measure::Sampling;
use crate::measure::time;
use crate::plan::{Often, Plan};
use crate::report::records::{KernelTime, Timings};

/// A frame of the path, and what it took.
type Sample = (usize, SubmissionTime);

/// Frames in each way in which they are timed.
#[derive(Default)]
pub struct Samples {
    frames: Vec<Sample>,
    /// Without what comes after the drawn surface; empty if nothing does.
    method: Vec<Sample>,
    /// Step by step; empty if the stamps of whole frames say what each step took.
    by_steps: Vec<Sample>,
    repeats: u32,
    ended_by: String,
}

impl Samples {
    /// Those that say what the method takes.
    fn method(&self) -> &[Sample] {
        if self.method.is_empty() { &self.frames } else { &self.method }
    }
}

/// The times of all frames, or a list that was too short for one of them.
pub enum Timed {
    Frames(Samples),
    Overflowed(Overflow),
    /// Somebody has asked for the end.
    Stopped,
}

/// A GPU that has waited for the processor runs at a lower clock until it has had work for so long (an H100 took up to four times as long for
/// a frame).
const AWAKE: Duration = Duration::from_millis(500);

#[derive(Clone, Copy)]
enum Way {
    Whole,
    Method,
    Steps,
}

/// The path as often as asked for, in whole frames, in frames that end with the drawn surface and, where nothing better tells, in steps. The
/// ways alternate frame by frame, so that all see the same machine state. With history that would run each frame several times in a row, so
/// the passes over the path are made one after the other, and each begins with a frame that does not count: it comes after none that it
/// could go on from.
pub fn timed(
    gpu: &Gpu,
    plan: &Plan,
    executor: &mut Executor,
    sampling: Sampling,
    stop: &Stop,
) -> Result<Timed, Diagnostic> {
    for frame in 0..sampling.warmup {
        executor.timed_frame(frame as usize % plan.frames)?;
    }
    let start = Instant::now();
    for frame in (0..plan.frames).cycle().take_while(|_| !gpu.summary.is_software() && start.elapsed() < AWAKE) {
        executor.timed_frame(frame)?;
    }
    let mut samples = Samples::default();
    let asked_for =
        [(Way::Whole, true), (Way::Method, !plan.after_surface.is_empty()), (Way::Steps, !gpu.summary.timestamps)];
    let ways = || asked_for.iter().filter(|(_, is_wanted)| *is_wanted).map(|(way, _)| *way);
    let goes_on = plan.remembers() || !plan.reused.is_empty();
    let order: Vec<(usize, Way)> = match goes_on {
        true => ways().flat_map(|way| (0..plan.frames).map(move |frame| (frame, way))).collect(),
        false => (0..plan.frames).flat_map(|frame| ways().map(move |way| (frame, way))).collect(),
    };
    let start = Instant::now();
    loop {
        for &(frame, way) in &order {
            if stop.is_wanted() {
                return Ok(Timed::Stopped);
            }
            if goes_on && frame == 0 && plan.frames > 1 {
                executor.reset_history();
                executor.timed_frame(frame)?;
                continue;
            }
            match way {
                Way::Whole => samples.frames.push((frame, executor.timed_frame(frame)?)),
                Way::Method => samples.method.push((frame, executor.timed_method(frame)?)),
                Way::Steps => samples.by_steps.push((frame, executor.frame_by_steps(frame)?)),
            }
            // after another frame than before, a list can be longer
            if let Some(overflow) = Overflow::after_frame(executor, plan)? {
                return Ok(Timed::Overflowed(overflow));
            }
        }
        samples.repeats += 1;
        let seconds = start.elapsed().as_secs_f64();
        if let Some(why) = end(plan, &samples, sampling, seconds) {
            samples.ended_by = why;
            return Ok(Timed::Frames(samples));
        }
    }
}

/// Why the path has been timed often enough, if it has.
fn end(plan: &Plan, samples: &Samples, sampling: Sampling, seconds: f64) -> Option<String> {
    if samples.repeats < sampling.repeats {
        return None;
    }
    let Some(until) = sampling.until else { return Some("the repeats that were asked for".into()) };
    let passes = samples.method().chunks(samples.method().len() / samples.repeats as usize);
    let pass_ms = passes.map(|pass| pass.iter().map(|(_, time)| time.gpu_ms.unwrap_or(time.wall_ms)).sum());
    let noise = time::noise(pass_ms.collect());
    let known = noise.map_or("not known".into(), |noise| format!("{:.2} %", 100.0 * noise));
    match noise {
        Some(noise) if noise <= until.noise => Some(format!("noise of {known} after {seconds:.1} s")),
        _ if seconds >= until.seconds => {
            Some(format!("the time limit of {} s, with a noise of {known} over {} frames", until.seconds, plan.frames))
        }
        _ => None,
    }
}

/// The median of each frame's samples, in the order of the frames.
fn by_frame(frames: usize, samples: &[Sample]) -> Vec<Option<f64>> {
    let mut by_frame: Vec<Vec<f64>> = vec![Vec::new(); frames];
    for (frame, time) in samples {
        by_frame[*frame].push(time.gpu_ms.unwrap_or(time.wall_ms));
    }
    by_frame.into_iter().map(|samples| time::spread(samples).map(|spread| spread.median)).collect()
}

/// What the samples say.
pub fn timings(plan: &Plan, executor: &Executor, once: &SubmissionTime, samples: &Samples) -> Timings {
    let times = |samples: &[Sample]| samples.iter().map(|(_, time)| time.clone()).collect::<Vec<_>>();
    let (frames, method) = (&times(&samples.frames)[..], &times(samples.method())[..]);
    let by_steps = if samples.by_steps.is_empty() { frames } else { &times(&samples.by_steps)[..] };
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
                after_surface: plan.after_surface.contains(&at),
                ms: of_step(at, submissions),
            }
        })
        .collect();
    let outside = |(frame, steps): (&SubmissionTime, &SubmissionTime)| {
        let inside_ms: Option<f64> = steps.steps.iter().map(|time| time.ms).sum();
        inside_ms.map(|inside_ms| 1.0 - inside_ms / frame.wall_ms)
    };
    let outside = all(frames.iter().zip(by_steps).map(outside).collect()).map(|spread| spread.median.max(0.0));
    let after_surface = |submission: &SubmissionTime| {
        submission.steps.iter().filter(|time| plan.after_surface.contains(&time.step)).map(|time| time.ms).sum()
    };
    let gpu_ms = |submissions: &[SubmissionTime]| all(submissions.iter().map(|time| time.gpu_ms).collect());
    let wall_ms = |submissions: &[SubmissionTime]| time::spread(submissions.iter().map(|time| time.wall_ms).collect());
    Timings {
        kernels_by: if executor.believes_stamps() { "timestamps" } else { "clock" }.into(),
        method_gpu_ms: gpu_ms(method),
        method_wall_ms: wall_ms(method),
        after_surface_ms: all(by_steps.iter().map(after_surface).collect()),
        frame_gpu_ms: gpu_ms(frames),
        frame_wall_ms: wall_ms(frames),
        method_ms_by_frame: by_frame(plan.frames, samples.method()),
        frame_ms_by_frame: by_frame(plan.frames, &samples.frames),
        repeats: samples.repeats,
        ended_by: samples.ended_by.clone(),
        outside_kernels: outside,
        once_ms: once.wall_ms,
        prepare_ms: executor.prepare_ms,
        kernels,
    }
}
