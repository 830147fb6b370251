//! Times of a cell: warm-up, the path as often as asked for, and what each step took.

use super::overflow::Overflow;
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::submit::SubmissionTime;
use crate::gpu::{Executor, Gpu};
use crate::measure::Sampling;
use crate::measure::time;
use crate::plan::{Often, Plan};
use crate::report::records::{KernelTime, Timings};

/// Whole frames and frames in steps, or a list that was too short for one of them.
pub enum Timed {
    Frames { frames: Vec<SubmissionTime>, by_steps: Vec<SubmissionTime> },
    Overflowed(Overflow),
}

/// The path as often as asked for, in whole frames and, where nothing better tells, in steps. Whole frames and steps alternate frame by
/// frame, so that both see the same machine state. With history that would run each frame twice in a row, so the two passes over the
/// path are made one after the other, and each begins with a frame that does not count: it comes after none that it could go on from.
pub fn timed(gpu: &Gpu, plan: &Plan, executor: &mut Executor, sampling: Sampling) -> Result<Timed, Diagnostic> {
    for frame in 0..sampling.warmup {
        executor.timed_frame(frame as usize % plan.frames)?;
    }
    let (mut frames, mut by_steps) = (Vec::new(), Vec::new());
    let needs_steps = !gpu.summary.timestamps;
    let ways = if needs_steps { &[false, true][..] } else { &[false] };
    let goes_on = plan.remembers() || !plan.reused.is_empty();
    let order: Vec<(usize, bool)> = match goes_on {
        true => ways.iter().flat_map(|&way| (0..plan.frames).map(move |frame| (frame, way))).collect(),
        false => (0..plan.frames).flat_map(|frame| ways.iter().map(move |&way| (frame, way))).collect(),
    };
    for _ in 0..sampling.repeats {
        for &(frame, in_steps) in &order {
            if goes_on && frame == 0 && plan.frames > 1 {
                executor.reset_history();
                executor.timed_frame(frame)?;
                continue;
            }
            match in_steps {
                true => by_steps.push(executor.frame_by_steps(frame)?),
                false => frames.push(executor.timed_frame(frame)?),
            }
            // after another frame than before, a list can be longer
            if let Some(overflow) = Overflow::after_frame(executor, plan)? {
                return Ok(Timed::Overflowed(overflow));
            }
        }
    }
    Ok(Timed::Frames { frames, by_steps })
}

/// `frames` are whole submissions; `by_steps` say what each step took in them, or by itself.
pub fn timings(
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
