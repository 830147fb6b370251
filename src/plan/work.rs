//! Steps, and what they do.

use std::sync::Arc;

use super::{BufferId, Often};
use crate::frame::Block;
use crate::kernel::{BindingKind, Kernel, Structure, Value};

/// One upload, dispatch, draw or copy.
#[derive(Clone, Debug)]
pub struct Step {
    /// Name of the stage it belongs to, and its place in the chain.
    pub stage: String,
    pub stage_index: usize,
    pub label: String,
    pub work: Work,
    pub often: Often,
    /// The buffers it reads and writes, found by reflection.
    pub reads: Vec<BufferId>,
    pub writes: Vec<BufferId>,
}

#[derive(Clone, Debug)]
pub enum Work {
    /// Runs entry points of a kernel.
    Run(Box<Run>),
    /// Brings an input of the scene to the device.
    Upload(BufferId),
    /// Keeps what a buffer holds at this point of the frame, for somebody to look at.
    Copy { from: BufferId, to: BufferId },
}

/// A kernel with everything it runs on.
#[derive(Clone, Debug)]
pub struct Run {
    pub kernel: Arc<Kernel>,
    pub entry: String,
    pub bindings: Vec<(String, BufferId)>,
    /// Outputs that are only written if somebody wants them: variable, buffer, override constant.
    pub optional: Vec<(String, BufferId, String)>,
    /// Variables that an `override` keeps the kernel from using: they need no buffer.
    pub unused: Vec<String>,
    /// Parameters that are the same in all frames.
    pub params: Vec<(String, Value)>,
    /// Structures among its parameters that are filled: what the names of their fields begin with, and how.
    pub blocks: Vec<(String, &'static Block)>,
    pub constants: Vec<(String, f64)>,
    pub how: How,
}

#[derive(Clone, Debug)]
pub enum How {
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

/// A list whose length only the GPU knows, and where it says how long it wanted to be. Checked between frames.
#[derive(Clone, Debug)]
pub struct Guard {
    pub list: String,
    pub capacity: u32,
    pub needed: BufferId,
    /// Which u32 of the buffer.
    pub at: usize,
}

impl Step {
    pub(super) fn upload(input: BufferId, name: &str) -> Self {
        Self {
            stage: "scene".into(),
            stage_index: usize::MAX,
            label: format!("upload {name}"),
            work: Work::Upload(input),
            often: Often::Once,
            reads: Vec::new(),
            writes: vec![input],
        }
    }

    /// The kernel that it runs, if it does.
    pub fn run(&self) -> Option<&Run> {
        match &self.work {
            Work::Run(run) => Some(run),
            _ => None,
        }
    }

    /// Buffers that it writes only if somebody wants them.
    pub fn optional(&self) -> impl Iterator<Item = BufferId> {
        self.run().into_iter().flat_map(|run| run.optional.iter().map(|(_, id, _)| *id))
    }

    pub fn binds(&self, id: BufferId) -> bool {
        self.run().is_some_and(|run| run.bindings.iter().any(|(_, attached)| *attached == id))
    }

    /// It is there for somebody who looks at a frame, and not part of the frame.
    pub fn is_tap(&self) -> bool {
        matches!(self.work, Work::Copy { .. })
    }

    pub fn is_per_frame(&self) -> bool {
        self.run().is_some_and(Run::is_per_frame)
    }

    /// Bytes of its parameters, for every frame in memory if they change.
    pub fn parameter_bytes(&self, frames: usize) -> u64 {
        self.run().map_or(0, |run| {
            let bytes = run.structures().map(|structure| u64::from(structure.bytes)).sum::<u64>();
            bytes * if run.is_per_frame() { frames as u64 } else { 1 }
        })
    }

    /// Threads started, for what leaving the step out saves.
    pub fn threads(&self) -> u64 {
        let Some(run) = self.run() else { return 0 };
        match run.how {
            How::Groups(groups) => {
                let size = run.kernel.entry(&run.entry).map_or([1; 3], |entry| entry.workgroup_size);
                groups.iter().zip(size).map(|(&groups, size)| u64::from(groups) * u64::from(size)).product()
            }
            How::Draw { vertices: Vertices::Strip { vertices, .. }, .. } => vertices.into(),
            How::Indirect(_) | How::Draw { vertices: Vertices::List(_), .. } => 0,
        }
    }
}

impl Run {
    pub fn is_per_frame(&self) -> bool {
        self.blocks.iter().any(|(_, block)| block.changes)
    }

    /// The uniform structures of the entry point.
    pub fn structures(&self) -> impl Iterator<Item = &Structure> {
        let bindings = self.kernel.entry(&self.entry).map_or(&[][..], |entry| &entry.bindings);
        bindings.iter().filter_map(|binding| match &binding.kind {
            BindingKind::Params(structure) => Some(structure),
            _ => None,
        })
    }

    /// What a draw's pipeline depends on: strip or list, the target, the fragment shader.
    pub fn drawn(&self) -> Option<(bool, BufferId, &str)> {
        match &self.how {
            How::Draw { vertices, target, fragment } => {
                Some((matches!(vertices, Vertices::Strip { .. }), *target, fragment))
            }
            _ => None,
        }
    }

    /// The constants that the kernel has, with their values.
    pub fn constants(&self) -> impl Iterator<Item = (&str, f64)> {
        let known = self.constants.iter().filter(|(name, _)| self.kernel.overrides.contains(name));
        known.map(|(name, value)| (name.as_str(), *value))
    }
}
