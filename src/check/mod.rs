//! Numerical check: every stage of the registry against its f64 reference, on ordinary and extreme input.
//!
//! Each case is a small scene, over which the registry's example chains run on the GPU, frame by frame, with a copy of what each stage leaves. Then each
//! stage's reference is fed once with what the GPU fed its kernel (*local*: is this kernel right?) and once with the reference chain
//! (*accumulated*: how much has the chain lost by then?).

pub mod cases;

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use cases::Case;

use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::Gpu;
use crate::reference::{self, Buffers, Difference, Frame, Values};
use crate::run::Tapped;
use crate::run::walk::{read, without_gaps};
use crate::scene::HEIGHT;
use crate::stages::{self, Example};

/// One buffer of one stage in one case.
#[derive(Clone, Debug)]
pub struct Outcome {
    pub case: String,
    pub stage: String,
    pub buffer: String,
    pub local: Difference,
    pub accumulated: Difference,
    pub verdict: Verdict,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The differences say.
    Compared,
    /// Nothing could be compared, and why.
    Failed(String),
}

/// Share of values that may hang on a decision, in a comparison with what the GPU fed its kernel; with more, the case would say nothing.
const MOST_UNDECIDED: f64 = 0.25;

impl Outcome {
    fn of_chain(case: &str, chain: &str, verdict: Verdict) -> Self {
        let (local, accumulated) = Default::default();
        Self { case: case.into(), stage: chain.into(), buffer: String::new(), local, accumulated, verdict }
    }

    pub fn passed(&self) -> bool {
        match &self.verdict {
            Verdict::Failed(_) => false,
            Verdict::Compared => {
                let is_decided = self.local.undecided_share() <= MOST_UNDECIDED;
                self.local.beyond == 0 && self.accumulated.beyond == 0 && is_decided
            }
        }
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.verdict {
            Verdict::Failed(why) => write!(f, "FAIL {:<34} {} {}: {why}", self.case, self.stage, self.buffer),
            Verdict::Compared => write!(
                f,
                "{} {:<34} {:<17} {:<14} {:>7} values, {:>5} undecided, {:>5} gaps; local {:.2e} ({:.2} of bound, {} beyond), accumulated {:.2e} ({} beyond, {:.0} % undecided)",
                if self.passed() { "ok  " } else { "FAIL" },
                self.case,
                self.stage,
                self.buffer,
                self.local.compared,
                self.local.undecided,
                self.local.gaps,
                self.local.largest,
                self.local.largest_of_bound,
                self.local.beyond,
                self.accumulated.largest,
                self.accumulated.beyond,
                self.accumulated.undecided_share() * 100.0,
            ),
        }
    }
}

/// Runs the examples of a case on one adapter.
pub fn run_case(gpu: &Arc<Gpu>, case: &Case) -> Result<Vec<Outcome>, Diagnostic> {
    let folder =
        tempfile::tempdir().map_err(|error| Diagnostic::run(format!("no place for example files: {error}")))?;
    let mut outcomes = Vec::new();
    for (number, example) in case.examples.iter().enumerate() {
        let tapped = match set_up(case, example, folder.path()) {
            Err(error) if case.may_be_refused() && error.to_string().contains("octaves") => continue,
            tapped => tapped?,
        };
        let name = format!("{}, chain {}", case.name, number + 1);
        match gpu.check_plan(&tapped.setup.plan) {
            Ok(()) => outcomes.extend(check_chain(gpu, &tapped, &name)?),
            Err(error) => outcomes.push(Outcome::of_chain(&name, example.chain, Verdict::Failed(error.to_string()))),
        }
    }
    Ok(outcomes)
}

/// An example over a scene, with the files that it names. What each stage makes is kept, before a later one makes a buffer of the same name
/// or changes it in place.
fn set_up(case: &Case, example: &Example, folder: &Path) -> Result<Tapped, Diagnostic> {
    for (name, text) in example.files {
        std::fs::write(folder.join(name), text)
            .map_err(|error| Diagnostic::run(format!("no place for example files: {error}")))?;
    }
    Tapped::chain(&case.scene, example.chain, folder)
}

/// Walks a chain on the GPU and in f64, frame by frame: a reference finds what the frame before left.
fn check_chain(gpu: &Arc<Gpu>, tapped: &Tapped, case: &str) -> Result<Vec<Outcome>, Diagnostic> {
    let Tapped { setup, taps } = tapped;
    let (prepared, plan) = (&setup.prepared, &setup.plan);
    let mut executor = setup.executor(gpu)?;
    let mut outcomes: Vec<Outcome> = Vec::new();
    let mut previous: Option<[Buffers; 2]> = None;
    for (number, camera) in prepared.data.cameras().iter().enumerate() {
        executor.frame(number)?;
        let [mut accumulated, mut local] = [0, 1].map(|_| Buffers::of_scene(&prepared.data));
        for (index, (stage, call)) in prepared.stages.iter().zip(&prepared.cell.stages).enumerate() {
            let walked = [&mut accumulated, &mut local].into_iter().enumerate().try_for_each(|(which, buffers)| {
                let ground = buffers.ground();
                let frame = Frame {
                    data: &prepared.data,
                    camera,
                    ground: ground.as_ref(),
                    is_scene_ground: buffers.is_scene_ground(),
                    previous: previous.as_ref().map(|previous| &previous[which]),
                };
                stage.reference(&frame, buffers)
            });
            if let Err(absent) = walked {
                outcomes.push(Outcome::of_chain(case, &call.name, Verdict::Failed(absent.to_string())));
                return Ok(outcomes);
            }
            let compared = stages::makes(call, stage.as_ref());
            let unchecked = stages::find(&call.name).map_or(&[][..], |entry| entry.info.unchecked);
            for tap in taps.iter().filter(|tap| tap.stage_index == index) {
                let name = &tap.buffer;
                if compared.contains(name) && unchecked.iter().all(|(other, _)| other != name) {
                    let values = read(&executor, plan, tap.copy)?;
                    merge(&mut outcomes, compare(case, &call.name, name, values, &mut local, &accumulated));
                }
            }
        }
        previous = Some([accumulated, local]);
    }
    Ok(outcomes)
}

/// Holds what the GPU left in a buffer to both references, and puts it where the next stage's local reference finds it.
fn compare(
    case: &str,
    stage: &str,
    buffer: &str,
    values: Values,
    local: &mut Buffers,
    accumulated: &Buffers,
) -> Outcome {
    let mut outcome = Outcome { buffer: buffer.into(), ..Outcome::of_chain(case, stage, Verdict::Compared) };
    let (Some(id), Ok(by_chain)) = (local.find(buffer), accumulated.get(buffer)) else {
        outcome.verdict = Verdict::Failed("its reference does not make this buffer".into());
        return outcome;
    };
    let by_input = local.values(id);
    outcome.local = reference::compare(&values.value, &by_input);
    outcome.accumulated = match accumulated.is_scene_ground() || buffer == HEIGHT {
        true => reference::compare(&values.value, &by_chain),
        // over heights that are not known to the last digit, no reference says how far off it is
        false => Difference { undecided: values.value.len(), ..Difference::default() },
    };
    local.replace(id, without_gaps(values, &by_input));
    outcome
}

/// Frames of a case are one line: the worst of them.
fn merge(outcomes: &mut Vec<Outcome>, outcome: Outcome) {
    let same = outcomes.iter_mut().find(|known| known.stage == outcome.stage && known.buffer == outcome.buffer);
    let Some(known) = same else { return outcomes.push(outcome) };
    known.local.merge(&outcome.local);
    known.accumulated.merge(&outcome.accumulated);
    if known.verdict == Verdict::Compared {
        known.verdict = outcome.verdict;
    }
}
