//! The plan: a pure value that says what runs, on which buffers, how often, and what was left out and why.
//!
//! A chain is planned in three passes: every stage states its buffers and steps ([`chain`]), demand flows back
//! from what is wanted and drops the rest (`prune`), and the buffers that are left get memory (`alias`).

mod alias;
pub mod chain;
mod explain;
mod fingerprint;
pub mod product;
mod prune;
mod scene;
mod step;

use std::sync::Arc;

use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{BindingKind, Elem, Kernel};
use product::Products;

pub use chain::{Announced, Chain};
pub use explain::{explain, megabytes};
pub use scene::{Part, SceneData};
pub use step::StepBuilder;

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
    /// Uploaded before anything runs: the terrain.
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
    /// Shares no memory: its contents survive the frame, for the next frame or for the host to look at.
    pub lasts: bool,
    /// What is in one element.
    pub packing: Packing,
}

/// Several values in one element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    /// As many values as the element has components.
    None,
    /// Four bytes in a u32, the lowest first.
    Bytes,
    /// Two f16 in a u32, the lower first.
    Halves,
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
            lasts: false,
            packing: Packing::None,
        }
    }

    /// Values in one element.
    pub fn components(&self) -> u32 {
        match self.packing {
            Packing::None => self.elem.components(),
            Packing::Bytes => 4,
            Packing::Halves => 2,
        }
    }

    /// The values in the bytes of a buffer, unpacked; NaN where there is no surface.
    pub fn values(&self, bytes: &[u8]) -> Vec<f64> {
        let numbers = || bytemuck::pod_collect_to_vec::<u8, u32>(bytes).into_iter();
        match (self.packing, self.elem) {
            (Packing::Bytes, _) => bytes.iter().map(|&byte| byte.into()).collect(),
            (Packing::Halves, _) => bytemuck::pod_collect_to_vec::<u8, u16>(bytes)
                .into_iter()
                .map(|bits| half::f16::from_bits(bits).into())
                .collect(),
            (_, elem) if elem.is_float() => numbers()
                .map(|bits| f64::from(f32::from_bits(bits)))
                .map(|value| if self.missing.is_some() && value < 0.0 { f64::NAN } else { value })
                .collect(),
            (_, Elem::I32) => numbers().map(|bits| f64::from(bits as i32)).collect(),
            _ => numbers().map(f64::from).collect(),
        }
    }

    pub fn elements(&self) -> u64 {
        self.dims.iter().fold(1, |product: u64, &side| product.saturating_mul(side.into()))
    }

    pub fn bytes(&self) -> u64 {
        self.elements().saturating_mul(self.elem.bytes())
    }
}

/// The value of one parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    F32(Vec<f32>),
    U32(Vec<u32>),
    I32(Vec<i32>),
}

/// A parameter over the frames.
#[derive(Clone, Debug, PartialEq)]
pub enum Series {
    Same(Value),
    /// One value a frame.
    PerFrame(Vec<Value>),
}

impl Series {
    pub fn at(&self, frame: usize) -> &Value {
        match self {
            Series::Same(value) => value,
            Series::PerFrame(values) => &values[frame],
        }
    }
}

#[derive(Clone, Debug)]
pub enum Work {
    /// Compute, this many workgroups.
    Groups([u32; 3]),
    /// Compute, with the number of workgroups in a buffer of three u32.
    Indirect(BufferId),
    /// Triangles of vertices that the vertex shader pulls from buffers.
    Draw { vertices: Vertices, target: BufferId, fragment: String },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vertices {
    /// One strip of so many, in which so many triangles have an area.
    Strip { vertices: u32, triangles: u32 },
    /// Three a triangle, as many as the first of four u32 in a buffer says: vertices, instances, first vertex, first instance.
    List(BufferId),
}

impl Work {
    /// What a draw's pipeline depends on: strip or list, the target, the fragment shader.
    pub fn drawn(&self) -> Option<(bool, BufferId, &str)> {
        match self {
            Work::Draw { vertices, target, fragment } => {
                Some((matches!(vertices, Vertices::Strip { .. }), *target, fragment))
            }
            _ => None,
        }
    }
}

/// A list whose length only the GPU knows, and where it says how long it wanted to be. Checked between frames.
#[derive(Clone, Debug)]
pub struct Guard {
    pub list: String,
    pub capacity: u32,
    pub needed: BufferId,
    /// Which u32 of the buffer.
    pub at: usize,
}

/// Lists that were made longer than their stages asked for, after they overflowed.
pub type Capacities = std::collections::BTreeMap<String, u32>;

/// One dispatch or one draw.
#[derive(Clone, Debug)]
pub struct Step {
    /// Name of the stage it belongs to, and its place in the chain.
    pub stage: String,
    pub stage_index: usize,
    pub label: String,
    pub kernel: Arc<Kernel>,
    pub entry: String,
    pub bindings: Vec<(String, BufferId)>,
    /// Outputs that are only written if somebody wants them: variable, buffer, override constant.
    pub optional: Vec<(String, BufferId, String)>,
    /// Variables that an `override` keeps the kernel from using: they need no buffer.
    pub unused: Vec<String>,
    pub params: Vec<(String, Series)>,
    pub constants: Vec<(String, f64)>,
    pub work: Work,
    pub often: Often,
    /// The buffers it writes, found by reflection.
    pub writes: Vec<BufferId>,
    pub reads: Vec<BufferId>,
}

impl Step {
    pub fn is_per_frame(&self) -> bool {
        self.params.iter().any(|(_, series)| matches!(series, Series::PerFrame(_)))
    }

    /// Bytes of its parameters, for every frame if they change.
    pub fn parameter_bytes(&self, frames: usize) -> u64 {
        let bindings = self.kernel.entry(&self.entry).map_or(&[][..], |entry| &entry.bindings);
        let structure = bindings.iter().find_map(|binding| match &binding.kind {
            BindingKind::Params(structure) => Some(u64::from(structure.bytes)),
            _ => None,
        });
        structure.unwrap_or(0) * if self.is_per_frame() { frames as u64 } else { 1 }
    }

    /// Threads started, for what leaving the step out saves.
    pub fn threads(&self) -> u64 {
        match self.work {
            Work::Groups(groups) => {
                let size = self.kernel.entry(&self.entry).map_or([1; 3], |entry| entry.workgroup_size);
                groups.iter().zip(size).map(|(&groups, size)| u64::from(groups) * u64::from(size)).product()
            }
            Work::Draw { vertices: Vertices::Strip { vertices, .. }, .. } => vertices.into(),
            Work::Indirect(_) | Work::Draw { vertices: Vertices::List(_), .. } => 0,
        }
    }
}

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
    pub frames: usize,
    /// What the stages offer to the measures.
    pub products: Products<BufferId>,
    pub guards: Vec<Guard>,
}

/// What a plan is made for.
#[derive(Clone, Debug)]
pub struct Demand {
    /// Buffers that are measured, dumped or looked at.
    pub outputs: Vec<BufferId>,
    /// Run everything, needed or not: the yardstick that shows leaving things out changes nothing.
    pub keep_everything: bool,
}

impl Plan {
    /// Plans a chain whose stages have stated their steps.
    pub fn finish(chain: Chain<'_>, demand: &Demand) -> Plan {
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
        alias::assign(&mut plan, demand.keep_everything);
        // what is left out has no list to overflow
        let guards = std::mem::take(&mut plan.guards);
        plan.guards = guards.into_iter().filter(|guard| plan.lives(guard.needed)).collect();
        plan
    }

    /// The last buffer of that name.
    pub fn find(&self, name: &str) -> Result<BufferId, Diagnostic> {
        let found = self.buffers.iter().rposition(|buffer| buffer.name == name);
        found.map(BufferId).ok_or_else(|| {
            Diagnostic::input(format!("no stage of the chain `{}` makes a buffer `{name}`", self.chain))
                .suggest(name, self.buffers.iter().map(|buffer| buffer.name.as_str()))
        })
    }

    pub fn buffer(&self, id: BufferId) -> &Buffer {
        &self.buffers[id.0]
    }

    /// Whether a buffer is bound as an array, and whether it is as an image.
    pub fn bound_as(&self, id: BufferId) -> (bool, bool) {
        let kinds = self.steps.iter().flat_map(|step| {
            let variables =
                step.bindings.iter().filter(move |(_, attached)| *attached == id).map(|(variable, _)| variable);
            variables.filter_map(|variable| step.kernel.binding(variable))
        });
        let (mut array, mut image) = (self.outputs.contains(&id), false);
        for kind in kinds {
            match kind {
                BindingKind::Image { .. } => image = true,
                _ => array = true,
            }
        }
        (array, image)
    }

    /// Whether a frame starts from what another one left.
    pub fn remembers(&self) -> bool {
        let touched = |id: BufferId| self.buffer(id).lasts && self.guards.iter().all(|guard| guard.needed != id);
        (0..self.buffers.len()).any(|at| touched(BufferId(at)) && self.lives(BufferId(at)))
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
        let parameters: u64 = self.steps.iter().map(|step| step.parameter_bytes(self.frames)).sum();
        buffers.saturating_add(self.slots.iter().sum()).saturating_add(parameters)
    }
}

/// Bytes a pixel of a render target's depth.
const DEPTH_BYTES: u64 = 4;
