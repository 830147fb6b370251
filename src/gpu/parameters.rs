//! Parameters: what is the same in all frames, and the blocks of each frame, in uniform buffers behind dynamic offsets.
//!
//! Frames of a path are packed ahead, so that a frame uploads nothing. A camera that the plan has not seen takes one of a few more slots.

use super::memory::make_buffer;
use super::{Gpu, GpuError};
use crate::frame::{Block, FrameInput};
use crate::kernel::{Field, Structure, Value};
use crate::plan::{LIVE_SLOTS, MOST_PACKED, Plan, Run};
use crate::scene::SceneData;

/// The values of all blocks of a plan in one frame.
type FrameValues = Vec<Vec<Value>>;

/// The parameters of all steps.
pub struct Parameters {
    /// The blocks that some step has and that change.
    blocks: Vec<&'static Block>,
    uniforms: Vec<Uniform>,
    /// Slots that hold frames of the path, and the first frame that they hold.
    path_slots: usize,
    first_packed: Option<usize>,
    next_live: usize,
}

/// One uniform structure of one step.
pub struct Uniform {
    pub buffer: wgpu::Buffer,
    pub bytes: u64,
    /// Bytes from one frame's parameters to the next; 0 if they are the same in all.
    stride: u32,
    /// What does not change.
    template: Vec<u8>,
    /// Where the values of a block go: the block, and a field for each value of it that the kernel has.
    patches: Vec<(usize, Vec<(usize, Field)>)>,
}

/// Where the parameters of a frame are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Slot(usize);

impl Parameters {
    pub fn new(plan: &Plan) -> Self {
        let blocks = plan.blocks().into_iter().filter(|block| block.changes).collect();
        let path_slots = plan.frames.min(MOST_PACKED);
        Self { blocks, uniforms: Vec::new(), path_slots, first_packed: None, next_live: 0 }
    }

    /// Makes room for a structure of a step in all slots.
    pub fn add(
        &mut self,
        gpu: &Gpu,
        label: &str,
        run: &Run,
        structure: &Structure,
        data: &SceneData,
    ) -> Result<usize, GpuError> {
        let mut template = vec![0; structure.bytes as usize];
        for field in &structure.fields {
            if let Some((_, value)) = run.params.iter().find(|(name, _)| *name == field.name) {
                value.pack(field, &mut template);
            }
        }
        let mut patches = Vec::new();
        for (prefix, block) in &run.blocks {
            if !structure.nested.iter().any(|nested| nested.prefix == *prefix && nested.name == block.name) {
                continue;
            }
            let place = |field: &Field| {
                let name = field.name.strip_prefix(prefix.as_str())?;
                block.fields.iter().position(|(known, _)| *known == name).map(|at| (at, field.clone()))
            };
            let places: Vec<(usize, Field)> = structure.fields.iter().filter_map(place).collect();
            match self.blocks.iter().position(|known| known == block) {
                Some(at) => patches.push((at, places)),
                None => {
                    let values = block.values(&FrameInput::of_scene(data));
                    places.iter().for_each(|(at, field)| values[*at].pack(field, &mut template));
                }
            }
        }
        let aligned = structure.bytes.next_multiple_of(gpu.limits.min_uniform_buffer_offset_alignment);
        let stride = if patches.is_empty() { 0 } else { aligned };
        let slots = if patches.is_empty() { 1 } else { self.path_slots + LIVE_SLOTS };
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let size = u64::from(aligned) * slots as u64;
        let buffer = make_buffer(gpu, &format!("parameters of {label}"), size, usage)?;
        gpu.queue.write_buffer(&buffer, 0, &template);
        self.uniforms.push(Uniform { buffer, bytes: structure.bytes.into(), stride, template, patches });
        Ok(self.uniforms.len() - 1)
    }

    pub fn uniform(&self, at: usize) -> &Uniform {
        &self.uniforms[at]
    }

    /// Where a step's parameters of a frame are.
    pub fn offset(&self, uniform: usize, slot: Slot) -> u32 {
        self.uniforms[uniform].stride * slot.0 as u32
    }

    fn values(&self, frame: &FrameInput) -> FrameValues {
        self.blocks.iter().map(|block| block.values(frame)).collect()
    }

    /// The slot of a frame of the path. Frames that are not in memory are packed from this one on, which happens between frames.
    pub fn of_path(&mut self, gpu: &Gpu, data: &SceneData, frame: usize) -> Result<Slot, GpuError> {
        if let Some(slot) = self.packed(frame) {
            return Ok(slot);
        }
        let inputs = (frame..frame + self.path_slots).map_while(|frame| FrameInput::of_path(data, frame));
        let frames: Vec<FrameValues> = inputs.map(|input| self.values(&input)).collect();
        for uniform in self.uniforms.iter().filter(|uniform| uniform.stride > 0) {
            let mut bytes = vec![0; uniform.stride as usize * frames.len()];
            bytes.chunks_exact_mut(uniform.stride as usize).zip(&frames).for_each(|(bytes, values)| {
                uniform.pack(values, bytes);
            });
            gpu.queue.write_buffer(&uniform.buffer, 0, &bytes);
        }
        self.first_packed = Some(frame);
        // before the frame, and not with it
        gpu.wait()?;
        Ok(Slot(0))
    }

    fn packed(&self, frame: usize) -> Option<Slot> {
        let slot = frame.checked_sub(self.first_packed?)?;
        (slot < self.path_slots).then_some(Slot(slot))
    }

    /// A slot for a frame that nobody has seen before.
    pub fn live(&mut self, gpu: &Gpu, frame: &FrameInput) -> Slot {
        let slot = self.path_slots + self.next_live;
        self.next_live = (self.next_live + 1) % LIVE_SLOTS;
        let values = self.values(frame);
        for uniform in self.uniforms.iter().filter(|uniform| uniform.stride > 0) {
            let mut bytes = vec![0; uniform.template.len()];
            uniform.pack(&values, &mut bytes);
            gpu.queue.write_buffer(&uniform.buffer, u64::from(uniform.stride) * slot as u64, &bytes);
        }
        Slot(slot)
    }

    /// Some step is told whether this frame is a cut.
    pub fn tells_cuts(&self) -> bool {
        self.blocks.iter().any(|block| block.fields.iter().any(|(name, _)| *name == "is_cut"))
    }
}

impl Uniform {
    fn pack(&self, values: &FrameValues, bytes: &mut [u8]) {
        bytes[..self.template.len()].copy_from_slice(&self.template);
        for (block, places) in &self.patches {
            places.iter().for_each(|(at, field)| values[*block][*at].pack(field, bytes));
        }
    }
}
