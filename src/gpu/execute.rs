//! A plan on a device: its memory, its pipelines and the frame that it is at.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Instant;

use super::bind::{Binder, Prepared};
use super::memory::{self, Place, make_buffer, make_places};
use super::parameters::{Parameters, Slot};
use super::stamps::Stamps;
use super::{Gpu, GpuError};
use crate::frame::FrameInput;
use crate::plan::once::{self, Shared};
use crate::plan::{BufferId, Life, Often, Plan, Step};
use crate::scene::SceneData;

/// Which of the two buffers of each pair is the new one. It changes with every frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Half(pub usize);

/// Where the buffers of a plan are.
pub struct Memory {
    pub places: Vec<Option<Place>>,
    /// For variables that a kernel has and does not use: one for those that are read, one for those that are written, which no step may
    /// have the same buffer for.
    pub unused: [wgpu::Buffer; 2],
    pub nearest: wgpu::Sampler,
}

impl Memory {
    /// Where a buffer is in a frame: the halves of a pair swap.
    pub fn place(&self, plan: &Plan, id: BufferId, half: Half) -> Option<&Place> {
        let other = |id: BufferId| match plan.buffer(id).life {
            Life::LastOf(next) => Some(next),
            Life::Next => (0..plan.buffers.len()).map(BufferId).find(|old| plan.buffer(*old).life == Life::LastOf(id)),
            _ => None,
        };
        let id = if half.0 == 1 { other(id).unwrap_or(id) } else { id };
        self.places[id.0].as_ref()
    }
}

/// Owns everything that it runs, and nothing waits for it: who has an encoder of their own uses [`Executor::encode_frame`], and who wants
/// a frame by itself [`Executor::frame`].
pub struct Executor {
    pub(super) gpu: Arc<Gpu>,
    pub(super) plan: Arc<Plan>,
    pub(super) data: Arc<SceneData>,
    pub(super) memory: Memory,
    pub(super) prepared: Vec<Option<Prepared>>,
    pub(super) stamps: Option<Stamps>,
    parameters: Parameters,
    now: Now,
    /// Steps whose results were on the device before.
    done: BTreeSet<usize>,
    /// Somebody has put other contents into a buffer than its steps make.
    pub(super) is_altered: bool,
    /// Something that was submitted is done, and so is what was before it.
    pub(super) has_run: bool,
    /// Time it took to make buffers and pipelines.
    pub prepare_ms: f64,
}

/// Steps that one set of queries has room for; longer plans are timed as whole frames only.
const MOST_STAMPED: usize = wgpu::QUERY_SET_MAX_QUERIES as usize / 2;

/// The frame that was begun.
#[derive(Clone, Copy, Debug)]
struct Now {
    slot: Slot,
    half: Half,
    /// Its number on the path; `None` for one that came by itself, or before the first.
    frame: Option<usize>,
    /// It goes on from the frame before it on the path, of which nothing was told that this one is not.
    follows: bool,
    is_cut: bool,
    /// What earlier frames have left is to be forgotten, or there is none.
    resets: bool,
    is_first: bool,
}

impl Executor {
    pub fn new(gpu: &Arc<Gpu>, plan: &Arc<Plan>, data: &Arc<SceneData>) -> Result<Self, GpuError> {
        let start = Instant::now();
        let mut executor = Self::without_waiting(gpu, plan, data, None)?;
        gpu.wait()?;
        executor.prepare_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(executor)
    }

    /// The same while the device still works on something else; nothing is known of how long it took. What the executor before it has of
    /// the scene, and has made of that once and for all, is not made again; it shares that memory, and has to be done with its own frames.
    pub fn without_waiting(
        gpu: &Arc<Gpu>,
        plan: &Arc<Plan>,
        data: &Arc<SceneData>,
        before: Option<&Executor>,
    ) -> Result<Self, GpuError> {
        gpu.check_plan(plan)?;
        let (known, done) = before.map(|before| before.known_for(plan, data)).unwrap_or_default();
        let unused = |label: &str| make_buffer(gpu, label, 64, wgpu::BufferUsages::STORAGE);
        let memory = Memory {
            places: make_places(gpu, plan, known)?,
            unused: [unused("left out of reading")?, unused("left out of writing")?],
            // the default is nearest and clamped to the edge
            nearest: gpu.device.create_sampler(&wgpu::SamplerDescriptor::default()),
        };
        let mut parameters = Parameters::new(plan);
        let binder = Binder { gpu, plan, data, memory: &memory };
        let prepare = |step: &Step| step.run().map(|run| binder.prepare(step, run, &mut parameters)).transpose();
        let prepared = plan.steps.iter().map(prepare).collect::<Result<_, _>>()?;
        let has_stamps = gpu.summary.timestamps && (1..=MOST_STAMPED).contains(&plan.steps.len());
        let stamps = has_stamps.then(|| Stamps::new(gpu, plan.steps.len())).transpose()?;
        let now = Now {
            slot: Slot::default(),
            half: Half(0),
            frame: None,
            follows: false,
            is_cut: true,
            resets: false,
            is_first: true,
        };
        let prepare_ms = f64::NAN;
        let (gpu, plan, data) = (gpu.clone(), plan.clone(), data.clone());
        Ok(Self {
            gpu,
            plan,
            data,
            memory,
            prepared,
            stamps,
            parameters,
            now,
            done,
            is_altered: false,
            has_run: false,
            prepare_ms,
        })
    }

    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Somebody has put other contents into a buffer than its steps make.
    pub fn is_altered(&self) -> bool {
        self.is_altered
    }

    pub fn believes_stamps(&self) -> bool {
        self.stamps.is_some()
    }

    /// Begins a frame of the path: from now on its steps can be encoded. A frame that does not come after the one before is a cut.
    pub fn begin_path_frame(&mut self, frame: usize) -> Result<(), GpuError> {
        self.begin_of_path(frame, true)
    }

    /// The same for a frame that nobody times: nothing is packed ahead for those after it, and nothing is waited for. Of such frames, three can
    /// be encoded before the first has to be submitted.
    pub fn begin_single_path_frame(&mut self, frame: usize) -> Result<(), GpuError> {
        self.begin_of_path(frame, false)
    }

    fn begin_of_path(&mut self, frame: usize, packs_ahead: bool) -> Result<(), GpuError> {
        let Some(input) = FrameInput::of_path(&self.data, frame) else {
            return Err(GpuError::Plan(format!("there is no frame {frame} on the path")));
        };
        let (before, resets) = (self.now.frame, self.now.resets || self.now.is_first);
        let is_cut = resets || before.is_none_or(|before| frame != before && frame != before + 1);
        let slot = match is_cut && self.parameters.tells_cuts() {
            true => {
                let input = FrameInput { is_cut, ..input };
                self.parameters.live(&self.gpu, &input)
            }
            false if packs_ahead => self.parameters.of_path(&self.gpu, &self.data, frame)?,
            false => self.parameters.live(&self.gpu, &input),
        };
        let told_otherwise = self.now.is_cut && self.parameters.tells_cuts();
        let follows = !is_cut && !told_otherwise && before.is_some_and(|before| before + 1 == frame);
        self.begin(slot, Some(frame), follows, is_cut);
        Ok(())
    }

    /// Begins a frame with a camera that the plan has not seen. Of such frames, three can be encoded before the first has to be submitted.
    pub fn begin_live_frame(&mut self, frame: &FrameInput) -> Result<(), GpuError> {
        if !self.plan.sees_underside && self.data.ground.can_see_underside(frame.camera.eye_m) {
            let what = "the camera is under the surface or outside the terrain, and the plan is for cameras above it";
            return Err(GpuError::Plan(what.into()));
        }
        let is_cut = frame.is_cut || self.now.resets || self.now.is_first;
        let slot = self.parameters.live(&self.gpu, &FrameInput { is_cut, ..*frame });
        self.begin(slot, None, false, is_cut);
        Ok(())
    }

    fn begin(&mut self, slot: Slot, frame: Option<usize>, follows: bool, is_cut: bool) {
        let Now { half, resets, is_first, .. } = self.now;
        let half = if is_first { half } else { Half(1 - half.0) };
        self.now = Now { slot, half, frame, follows, is_cut, resets, is_first: false };
    }

    /// The next frame finds nothing of the frames before it.
    pub fn reset_history(&mut self) {
        self.now.resets = true;
    }

    /// Whether the frame that was begun has to forget what was before. Who encodes frames into an encoder of their own does so first.
    pub(super) fn take_reset(&mut self) -> bool {
        std::mem::take(&mut self.now.resets)
    }

    pub(super) fn half(&self) -> Half {
        self.now.half
    }

    /// Where the parameters of a step are in the frame that was begun.
    pub(super) fn offset(&self, step: usize) -> Option<u32> {
        let uniform = self.prepared[step].as_ref()?.uniform?;
        Some(self.parameters.offset(uniform, self.now.slot))
    }

    /// The steps that run once and are not done.
    pub(super) fn steps_to_set_up(&self) -> Vec<usize> {
        self.steps_of(Often::Once).into_iter().filter(|at| !self.done.contains(at)).collect()
    }

    pub(super) fn steps_of(&self, often: Often) -> Vec<usize> {
        (0..self.plan.steps.len()).filter(|&at| self.plan.steps[at].often == often).collect()
    }

    /// The steps of the frame that was begun: what is as in the frame before is not run again.
    pub(super) fn steps_of_frame(&self, with_taps: bool) -> Vec<usize> {
        let reused = self.now.frame.filter(|_| self.now.follows).and_then(|frame| self.plan.reused.get(&frame));
        let runs = |at: &usize| {
            let is_reused = reused.is_some_and(|steps| steps.contains(at));
            !is_reused && (with_taps || !self.plan.steps[*at].is_tap())
        };
        self.steps_of(Often::EveryFrame).into_iter().filter(runs).collect()
    }

    /// What is here of what another plan wants, and its steps that are done with it.
    fn known_for(&self, plan: &Plan, data: &SceneData) -> (BTreeMap<BufferId, Place>, BTreeSet<usize>) {
        if self.is_altered || !self.has_run {
            return Default::default();
        }
        let Shared { buffers, mut steps } = once::shared((&self.plan, &self.data), (plan, data));
        let place = |(new, old): (BufferId, BufferId)| {
            let place = self.memory.places[old.0].as_ref()?;
            place.binds_as(plan.bound_as(new)).then(|| (new, place.clone()))
        };
        let known: BTreeMap<BufferId, Place> = buffers.into_iter().filter_map(place).collect();
        // an input in another form has to come again
        steps.retain(|at| plan.steps[*at].writes.iter().all(|id| known.contains_key(id)));
        (known, steps)
    }

    pub(super) fn upload(&self, id: BufferId) -> Result<(), GpuError> {
        let name = &self.plan.buffer(id).name;
        let input = self.data.input(name);
        let (Some(input), Some(place)) = (input, &self.memory.places[id.0]) else {
            return Err(GpuError::Plan(format!("the scene has no input `{name}`")));
        };
        memory::upload(&self.gpu, place, input.bytes());
        Ok(())
    }
}
