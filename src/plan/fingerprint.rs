//! What a plan carries out, as one hash: two plans with the same fingerprint compute the same.
//!
//! Names of stages and steps, meanings and what was left out are not part of it: they say how a plan is told, not what it does.

use std::collections::BTreeMap;

use blake3::Hasher;

use super::product::Drawn;
use super::{BufferId, How, Life, Plan, Run, Step, Storage, Vertices, Work};
use crate::frame::FrameInput;
use crate::kernel::{Packing, Value};
use crate::scene::{SceneData, Views};

impl Plan {
    /// Kernel texts, entry points, constants, cameras and parameters, sizes, and what is read back, in 32 hexadecimal digits.
    pub fn fingerprint(&self, data: &SceneData) -> String {
        let mut digest = Digest::default();
        digest.plan(self);
        digest.frames(self, data);
        digest.hasher.finalize().to_hex().as_str()[..32].to_string()
    }

    /// The kernel files that run and the hash of each text, sorted.
    pub fn kernels(&self) -> Vec<(String, String)> {
        let mut kernels: Vec<(String, String)> = self
            .steps
            .iter()
            .filter_map(Step::run)
            .map(|run| (run.kernel.name.clone(), run.kernel.hash.clone()))
            .collect();
        kernels.sort();
        kernels.dedup();
        kernels
    }
}

#[derive(Default)]
pub(super) struct Digest {
    hasher: Hasher,
    /// Buffers in the order in which they are first met: one that nothing touches changes no number.
    numbers: BTreeMap<BufferId, u64>,
}

impl Digest {
    pub fn number(&mut self, number: u64) {
        self.hasher.update(&number.to_le_bytes());
    }

    pub fn bytes(&mut self, bytes: &[u8]) {
        self.number(bytes.len() as u64);
        self.hasher.update(bytes);
    }

    /// The buffers that were met, in the order in which they were.
    pub fn buffers(&self) -> Vec<BufferId> {
        let mut met: Vec<BufferId> = self.numbers.keys().copied().collect();
        met.sort_by_key(|id| self.numbers[id]);
        met
    }

    pub fn finish(self) -> [u8; 32] {
        *self.hasher.finalize().as_bytes()
    }

    fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }

    fn plan(&mut self, plan: &Plan) {
        self.number(plan.frames as u64);
        self.number(plan.steps.len() as u64);
        for step in &plan.steps {
            self.step(plan, step);
        }
        self.number(plan.slots.len() as u64);
        plan.slots.iter().for_each(|&bytes| self.number(bytes));
        self.number(plan.outputs.len() as u64);
        for &id in &plan.outputs {
            self.buffer(plan, id);
            self.text(&plan.buffer(id).name);
            self.number(plan.buffer(id).missing.is_some().into());
            self.number(match plan.buffer(id).packing {
                Packing::None => 0,
                Packing::Bytes => 1,
                Packing::Halves => 2,
            });
        }
        let promise = plan.products.latest::<Drawn<BufferId>>().and_then(|drawn| drawn.promise);
        self.number(promise.map_or(u64::MAX, |promise| promise.bound_px.to_bits()));
        // they are timed apart
        self.number(plan.after_surface.len() as u64);
        plan.after_surface.iter().for_each(|&step| self.number(step as u64));
        self.number(plan.guards.len() as u64);
        for guard in &plan.guards {
            self.text(&guard.list);
            self.number(guard.capacity.into());
            self.buffer(plan, guard.needed);
            self.number(guard.at as u64);
        }
    }

    /// The buffer's number, and what it is where it is met for the first time.
    fn buffer(&mut self, plan: &Plan, id: BufferId) {
        let next = self.numbers.len() as u64;
        let number = *self.numbers.entry(id).or_insert(next);
        self.number(number);
        if number < next {
            return;
        }
        let buffer = plan.buffer(id);
        self.number(buffer.elem as u64);
        self.number(buffer.dims.len() as u64);
        buffer.dims.iter().for_each(|&side| self.number(side.into()));
        self.number(match buffer.storage {
            Storage::Input => 0,
            Storage::Buffer => 1,
            Storage::Target => 2,
        });
        match buffer.life {
            Life::Frame | Life::Host => self.number(0),
            Life::Kept => self.number(1),
            Life::Next => self.number(2),
            Life::LastOf(next) => {
                self.number(3);
                self.buffer(plan, next);
            }
        }
        self.number(buffer.slot.map_or(0, |slot| slot as u64 + 1));
    }

    pub fn step(&mut self, plan: &Plan, step: &Step) {
        self.number(step.often as u64);
        match &step.work {
            Work::Run(run) => self.run(plan, run),
            Work::Upload(id) => {
                self.text(&plan.buffer(*id).name);
                self.buffer(plan, *id);
            }
            Work::Copy { from, to } => {
                self.buffer(plan, *from);
                self.buffer(plan, *to);
            }
        }
    }

    fn run(&mut self, plan: &Plan, run: &Run) {
        self.text(&run.kernel.hash);
        self.number(run.kernel.trusted.into());
        self.text(&run.entry);
        self.number(run.bindings.len() as u64);
        for (variable, id) in &run.bindings {
            self.text(variable);
            self.buffer(plan, *id);
        }
        self.number(run.constants.len() as u64);
        for (name, value) in &run.constants {
            self.text(name);
            self.number(value.to_bits());
        }
        self.number(run.params.len() as u64);
        for (name, value) in &run.params {
            self.text(name);
            self.value(value);
        }
        self.number(run.blocks.len() as u64);
        for (prefix, block) in &run.blocks {
            self.text(prefix);
            self.text(block.name);
        }
        match &run.how {
            How::Groups(groups) => groups.iter().for_each(|&count| self.number(count.into())),
            How::Indirect(id) => self.buffer(plan, *id),
            How::Draw { vertices, target, fragment } => {
                self.text(fragment);
                self.buffer(plan, *target);
                match vertices {
                    Vertices::Strip { vertices, .. } => self.number((*vertices).into()),
                    Vertices::List(id) => self.buffer(plan, *id),
                }
            }
        }
    }

    pub fn value(&mut self, value: &Value) {
        // the type is the kernel's own, of which the text is hashed
        self.hasher.update(bytemuck::cast_slice(value.words()));
    }

    /// The cameras of all frames, and what the blocks make of some of them: that is code, which does not change in one frame alone.
    fn frames(&mut self, plan: &Plan, data: &SceneData) {
        let Views::Path(path) = &data.views else { return self.number(0) };
        self.text(&data.fingerprint());
        self.number(plan.reused.len() as u64);
        for (frame, steps) in &plan.reused {
            self.number(*frame as u64);
            steps.iter().for_each(|&step| self.number(step as u64));
        }
        let blocks = plan.blocks();
        let frames = path.cameras.len();
        for at in 0..frames.min(MOST_FRAMES) {
            let frame = at * frames / frames.min(MOST_FRAMES);
            let Some(input) = FrameInput::of_path(data, frame) else { continue };
            blocks.iter().flat_map(|block| block.values(&input)).for_each(|value| self.value(&value));
        }
    }
}

/// Frames of which the values of blocks are hashed, evenly over the path.
const MOST_FRAMES: usize = 64;
