//! A kernel that is part of no plan: it shows what a plan has left, for somebody who looks.

use std::collections::BTreeMap;

use super::bind::layout_entries;
use super::cache::{DrawKey, Pipeline, PipelineKey};
use super::memory::make_buffer;
use super::{Gpu, GpuError};
use crate::kernel::{Binding, BindingKind, Entry, Kernel, Value};

/// What runs, and on what.
pub struct Tool<'a> {
    /// The kernel's path under `kernels/`, and its entry point.
    pub kernel: &'static str,
    pub entry: &'static str,
    pub draw: Option<DrawKey>,
    /// `override` constants, of which the kernel has some.
    pub constants: &'a [(&'static str, f64)],
    /// By the names of their variables.
    pub buffers: &'a [(&'static str, &'a wgpu::Buffer)],
    pub images: &'a [(&'static str, &'a wgpu::TextureView)],
    pub params: &'a [(&'static str, Value)],
}

/// A pipeline with what is bound to it.
pub struct Ready {
    pub pipeline: Pipeline,
    pub group: wgpu::BindGroup,
    pub workgroup_size: [u32; 3],
}

impl Gpu {
    pub(super) fn ready(&self, tool: &Tool) -> Result<Ready, GpuError> {
        let mistake = |why: String| GpuError::Plan(format!("{}: {why}", tool.kernel));
        let kernel = Kernel::built_in(tool.kernel, None).map_err(|error| mistake(error.to_string()))?;
        let is_used = |entry: &&Entry| {
            entry.name == tool.entry || tool.draw.as_ref().is_some_and(|draw| entry.name == draw.fragment)
        };
        let entries: Vec<&Entry> = kernel.entries.iter().filter(is_used).collect();
        let main = entries.iter().find(|entry| entry.name == tool.entry);
        let workgroup_size = main.ok_or_else(|| mistake(format!("no entry point `{}`", tool.entry)))?.workgroup_size;
        let layouts = vec![layout_entries(&entries, 0)];
        let bindings: BTreeMap<u32, &Binding> =
            entries.iter().flat_map(|entry| &entry.bindings).map(|binding| (binding.binding, binding)).collect();
        let uniform = self.uniform(&bindings, tool)?;
        let resource = |binding: &Binding| match &binding.kind {
            BindingKind::Params(structure) => Ok(wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: &uniform,
                offset: 0,
                size: std::num::NonZeroU64::new(structure.bytes.into()),
            })),
            _ => {
                let buffer = tool.buffers.iter().find(|(name, _)| *name == binding.name);
                let buffer = buffer.map(|(_, buffer)| buffer.as_entire_binding());
                let image = tool.images.iter().find(|(name, _)| *name == binding.name);
                let found = buffer.or(image.map(|(_, view)| wgpu::BindingResource::TextureView(view)));
                found.ok_or_else(|| mistake(format!("`{}` is bound to nothing", binding.name)))
            }
        };
        let entries: Vec<wgpu::BindGroupEntry> = bindings
            .iter()
            .map(|(&at, binding)| Ok(wgpu::BindGroupEntry { binding: at, resource: resource(binding)? }))
            .collect::<Result<_, GpuError>>()?;
        let layout = &self.layout(&layouts[0])?;
        let group = self.scoped(&format!("the bindings of `{}`", tool.kernel), || {
            self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
        })?;
        let own = tool.constants.iter().filter(|(name, _)| kernel.overrides.iter().any(|known| known == name));
        let constants = own.map(|(name, value)| (name.to_string(), value.to_bits())).collect();
        let key = PipelineKey {
            kernel: kernel.hash.clone(),
            is_trusted: true,
            entry: tool.entry.into(),
            constants,
            layouts,
            draw: tool.draw.clone(),
        };
        Ok(Ready { pipeline: self.pipeline(tool.entry, &kernel, key)?, group, workgroup_size })
    }

    /// The parameters, each where the kernel's structure has it.
    fn uniform(&self, bindings: &BTreeMap<u32, &Binding>, tool: &Tool) -> Result<wgpu::Buffer, GpuError> {
        let structure = bindings.values().find_map(|binding| match &binding.kind {
            BindingKind::Params(structure) => Some(structure),
            _ => None,
        });
        let mut bytes = vec![0; structure.map_or(16, |structure| structure.bytes as usize)];
        for field in structure.iter().flat_map(|structure| &structure.fields) {
            let value = tool.params.iter().find(|(name, _)| *name == field.name).map(|(_, value)| value);
            match value {
                Some(value) if value.kind == field.kind => value.pack(field, &mut bytes),
                found => {
                    let why = format!("the parameter `{}` of `{}` is {found:?}", field.name, tool.kernel);
                    return Err(GpuError::Plan(why));
                }
            }
        }
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let uniform = make_buffer(self, "parameters of a look", bytes.len() as u64, usage)?;
        self.queue.write_buffer(&uniform, 0, &bytes);
        Ok(uniform)
    }
}
