//! The plan: a pure value that says what runs, on which buffers, how often, and what was left out and why.
//!
//! A chain is planned in three passes: every stage states its buffers and steps ([`chain`]), demand flows back
//! from what is wanted and drops the rest (`prune`), and the buffers that are left get memory (`alias`).

mod alias;
pub mod chain;
mod explain;
mod fingerprint;
mod ground;
mod history;
pub mod once;
pub mod product;
mod prune;
mod reuse;
pub mod spread;
mod step;
mod tap;
mod work;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::experiment::diagnostic::Diagnostic;
use crate::frame::{BLOCKS, Block};
use crate::kernel::{BindingKind, Elem, Packing};
use product::Products;

pub use chain::{Announced, Chain};
pub use explain::{explain, megabytes};
pub use ground::ANY_ADAPTER_BINDS;
pub use spread::Spread;
pub use step::StepBuilder;
pub use tap::step_names;
pub use work::{Guard, How, Run, Step, Vertices, Work};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BufferId(pub usize);

/// How often a step runs or a buffer is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Often {
    /// Nothing in it changes with the camera.
    Once,
    EveryFrame,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// Uploaded before anything runs: an input of the scene by this name.
    Input,
    /// A storage buffer that a step writes.
    Buffer,
    /// A render target of one or two u32 a pixel, with a depth buffer.
    Target,
}

#[derive(Clone, Debug)]
pub struct Buffer {
    pub name: String,
    pub elem: Elem,
    /// C order: rows, columns.
    pub dims: Vec<u32>,
    pub unit: &'static str,
    pub meaning: String,
    pub storage: Storage,
    /// The value that means "no surface here"; dumped as NaN.
    pub missing: Option<f32>,
    /// Coarsest level, for a pyramid that does not go up to a single node.
    pub top_level: Option<u32>,
    pub often: Often,
    /// First and last step that touches it; `None` if nothing does.
    pub lifetime: Option<(usize, usize)>,
    /// Which block of transient memory it lives in; only buffers made every frame share memory.
    pub slot: Option<usize>,
    pub life: Life,
    /// What is in one element.
    pub packing: Packing,
    pub parts: &'static [spread::Part],
    /// What the elements are of.
    pub spread: Spread,
}

/// How long the contents of a buffer count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Life {
    /// Until the frame is over.
    Frame,
    /// For the host, which looks at them between frames.
    Host,
    /// For the next frame, which changes them in place. Zeros after a reset.
    Kept,
    /// The new half of a pair: in the next frame, they are what the old half holds.
    Next,
    /// The old half of a pair: what this buffer held in the frame before. Zeros after a reset. It may be written to, and what is written is
    /// gone with the frame.
    LastOf(BufferId),
}

impl Life {
    /// The next frame depends on them.
    pub fn is_history(self) -> bool {
        matches!(self, Life::Kept | Life::Next | Life::LastOf(_))
    }
}

/// A buffer that a frame writes, and what the frame before wrote there. The planner swaps the two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct History {
    pub last: BufferId,
    pub next: BufferId,
}

impl Buffer {
    /// An ordinary buffer that a step will write.
    pub fn new(name: &str, elem: Elem, dims: &[u32], unit: &'static str, meaning: &str) -> Self {
        Self {
            name: name.into(),
            elem,
            dims: dims.to_vec(),
            unit,
            meaning: meaning.into(),
            storage: Storage::Buffer,
            missing: None,
            top_level: None,
            often: Often::EveryFrame,
            lifetime: None,
            slot: None,
            life: Life::Frame,
            packing: Packing::None,
            parts: &[],
            spread: Spread::Numbers,
        }
    }

    /// Values in one element.
    pub fn components(&self) -> u32 {
        self.packing.components(self.elem)
    }

    /// The values in the bytes of a buffer, unpacked; NaN where there is no surface.
    pub fn values(&self, bytes: &[u8]) -> Vec<f64> {
        let mut values = self.elem.values(self.packing, bytes);
        if self.missing.is_some() {
            values.iter_mut().filter(|value| **value < 0.0).for_each(|value| *value = f64::NAN);
        }
        values
    }

    /// It is uploaded, and something reads it.
    pub fn is_input(&self) -> bool {
        self.storage == Storage::Input && self.lifetime.is_some()
    }

    pub fn elements(&self) -> u64 {
        self.dims.iter().fold(1, |product: u64, &side| product.saturating_mul(side.into()))
    }

    pub fn bytes(&self) -> u64 {
        self.elements().saturating_mul(self.elem.bytes())
    }
}

/// Lists that were made longer than their stages asked for, after they overflowed.
pub type Capacities = std::collections::BTreeMap<String, u32>;

/// Something the scene or the measures do not need.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LeftOut {
    pub what: String,
    pub reason: String,
    pub saved_bytes: u64,
    /// Kernel threads a frame (or once, for what runs once).
    pub saved_threads: u64,
}

#[derive(Clone, Debug)]
pub struct Plan {
    pub chain: String,
    pub buffers: Vec<Buffer>,
    pub steps: Vec<Step>,
    pub left_out: Vec<LeftOut>,
    /// Bytes of each block of transient memory.
    pub slots: Vec<u64>,
    /// What is read back, in the order it was asked for.
    pub outputs: Vec<BufferId>,
    /// Frames of the path; none if any camera may come.
    pub frames: usize,
    /// It does for a camera that sees the surface from below.
    pub sees_underside: bool,
    /// Steps that a frame leaves out, because everything that they depend on is as in the frame before.
    pub reused: BTreeMap<usize, Arc<[usize]>>,
    /// What the stages offer to the measures.
    pub products: Products<BufferId>,
    pub guards: Vec<Guard>,
    /// Steps of every frame that the surface as it was drawn last does not depend on, such as those that make a picture of it. All other
    /// steps of every frame are the method's.
    pub after_surface: BTreeSet<usize>,
}

/// What a plan is made for.
#[derive(Clone, Debug)]
pub struct Demand {
    /// Buffers that are measured, dumped or looked at.
    pub outputs: Vec<BufferId>,
    /// Run everything, needed or not: the yardstick that shows leaving things out changes nothing.
    pub keep_everything: bool,
    /// A step whose inputs are those of the frame before is not run again.
    pub reuse: bool,
}

impl Plan {
    /// Plans a chain whose stages have stated their steps.
    pub fn finish(chain: Chain<'_>, demand: &Demand) -> Plan {
        let data = chain.data;
        let mut plan = chain.into_draft();
        for &id in &demand.outputs {
            if !plan.outputs.contains(&id) {
                plan.outputs.push(id);
            }
        }
        prune::classify(&mut plan);
        if !demand.keep_everything {
            prune::prune(&mut plan);
        }
        prune::resolve_optional(&mut plan, demand.keep_everything);
        plan.add_uploads();
        if demand.reuse {
            reuse::find(&mut plan, data);
        }
        alias::assign(&mut plan, demand.keep_everything);
        plan.after_surface = prune::find_after_surface(&plan);
        // what is left out has no list to overflow
        let guards = std::mem::take(&mut plan.guards);
        plan.guards = guards.into_iter().filter(|guard| plan.lives(guard.needed)).collect();
        plan
    }

    /// What comes from the scene.
    pub fn inputs(&self) -> Vec<BufferId> {
        (0..self.buffers.len()).map(BufferId).filter(|id| self.buffer(*id).storage == Storage::Input).collect()
    }

    /// The first steps are those that bring in what the others read.
    fn add_uploads(&mut self) {
        let is_touched = |id: &BufferId| {
            self.outputs.contains(id) || self.steps.iter().any(|step| step.reads.contains(id) || step.binds(*id))
        };
        let (touched, untouched): (Vec<BufferId>, Vec<BufferId>) = self.inputs().into_iter().partition(is_touched);
        for id in untouched {
            let (what, saved_bytes) = (format!("scene: upload {}", self.buffer(id).name), self.buffer(id).bytes());
            self.left_out.push(LeftOut { what, reason: "nobody reads it".into(), saved_bytes, saved_threads: 0 });
        }
        let uploads = touched.into_iter().map(|id| Step::upload(id, &self.buffer(id).name));
        self.steps.splice(0..0, uploads.collect::<Vec<_>>());
    }

    /// The last buffer of that name.
    pub fn find(&self, name: &str) -> Result<BufferId, Diagnostic> {
        let found = self.buffers.iter().rposition(|buffer| buffer.name == name);
        found.map(BufferId).ok_or_else(|| {
            if let Some((buffer, step)) = name.split_once('@') {
                if self.buffers.iter().any(|known| known.name == buffer && known.storage == Storage::Target) {
                    return Diagnostic::input(format!("`{buffer}` is a render target, which is drawn once a frame"))
                        .help(format!("`--dump {buffer}` writes it"));
                }
                let kernels = self.steps.iter().filter(|known| known.run().is_some());
                let steps: Vec<String> = kernels.map(|known| format!("{}/{}", known.stage, known.label)).collect();
                let chain = &self.chain;
                let message =
                    format!("the chain `{chain}` has no step `{step}` after which there is a buffer `{buffer}`");
                let help = format!("its steps are {}; a stage's name means its last one", steps.join(", "));
                return Diagnostic::input(message).help(help);
            }
            Diagnostic::input(format!("no stage of the chain `{}` makes a buffer `{name}`", self.chain))
                .suggest(name, self.buffers.iter().map(|buffer| buffer.name.as_str()))
        })
    }

    pub fn buffer(&self, id: BufferId) -> &Buffer {
        &self.buffers[id.0]
    }

    /// Whether a buffer is bound as an array, and whether it is as an image.
    pub fn bound_as(&self, id: BufferId) -> (bool, bool) {
        let runs = self.steps.iter().filter_map(Step::run);
        let kinds = runs.flat_map(|run| {
            let attached = run.bindings.iter().filter(move |(_, attached)| *attached == id);
            attached.filter_map(|(variable, _)| run.kernel.binding(variable))
        });
        let (mut array, mut image) = (self.outputs.contains(&id), false);
        for kind in kinds {
            match kind {
                BindingKind::Image { .. } => image = true,
                _ => array = true,
            }
        }
        let is_copied = |step: &Step| matches!(step.work, Work::Copy { from, .. } if from == id);
        (array || self.steps.iter().any(is_copied), image)
    }

    /// Whether a frame starts from what another one left.
    pub fn remembers(&self) -> bool {
        (0..self.buffers.len()).any(|at| self.buffers[at].life.is_history() && self.lives(BufferId(at)))
    }

    /// Whether a buffer has memory: something that is left writes or reads it.
    pub fn lives(&self, id: BufferId) -> bool {
        self.buffer(id).lifetime.is_some()
    }

    /// Bytes of all memory the plan asks for: buffers, the terrain in each form that it is bound in, render targets with their depth,
    /// and the parameters of all frames.
    pub fn bytes(&self) -> u64 {
        let own = |(at, buffer): (usize, &Buffer)| match (buffer.lifetime, buffer.storage, buffer.slot) {
            (None, _, _) | (_, _, Some(_)) => 0,
            (_, Storage::Input, _) => {
                let (array, image) = self.bound_as(BufferId(at));
                buffer.bytes().saturating_mul(u64::from(array) + u64::from(image))
            }
            (_, Storage::Target, _) => buffer.bytes().saturating_add(buffer.elements().saturating_mul(DEPTH_BYTES)),
            (_, Storage::Buffer, _) => buffer.bytes(),
        };
        let buffers = self.buffers.iter().enumerate().map(own).fold(0, u64::saturating_add);
        let parameters = self.steps.iter().map(|step| step.parameter_bytes(self.packed_frames()));
        let shared = self.slots.iter().copied();
        shared.chain(parameters).fold(buffers, u64::saturating_add)
    }
}

impl Plan {
    /// The blocks that some step has, each once.
    pub fn blocks(&self) -> Vec<&'static Block> {
        let has = |run: &Run, block: &Block| run.blocks.iter().any(|(_, own)| *own == block);
        let is_used = |block: &&'static Block| self.steps.iter().filter_map(Step::run).any(|run| has(run, block));
        BLOCKS.iter().filter(is_used).collect()
    }

    /// Frames whose parameters are in memory at a time: those of a path are packed ahead, a camera that comes takes one of the last.
    pub fn packed_frames(&self) -> usize {
        self.frames.min(MOST_PACKED) + LIVE_SLOTS
    }
}

/// Frames of a path that are packed ahead at most; of a longer path the next ones are packed between frames.
pub const MOST_PACKED: usize = 256;
/// Frames that can be on their way while another comes.
pub const LIVE_SLOTS: usize = 3;

/// Bytes a pixel of a render target's depth.
const DEPTH_BYTES: u64 = 4;
