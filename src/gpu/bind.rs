//! What a step binds: for each variable of its kernel a buffer, an image, a sampler or parameters.

use std::collections::BTreeMap;
use std::num::NonZeroU64;

use super::cache::{DrawKey, Pipeline, PipelineKey, Topology};
use super::execute::{Half, Memory};
use super::memory::{Place, colour};
use super::parameters::Parameters;
use super::{Gpu, GpuError};
use crate::kernel::{Binding, BindingKind, Entry};
use crate::plan::{How, Life, Plan, Run, Step};
use crate::scene::SceneData;

/// A step, ready to be encoded.
pub struct Prepared {
    pub pipeline: Pipeline,
    /// For both halves of histories; one if the step touches none.
    pub groups: Vec<Vec<wgpu::BindGroup>>,
    /// Where its parameters are, behind a dynamic offset.
    pub uniform: Option<usize>,
}

impl Prepared {
    pub fn groups(&self, half: Half) -> &[wgpu::BindGroup] {
        &self.groups[half.0 % self.groups.len()]
    }
}

/// What is there to bind.
pub struct Binder<'a> {
    pub gpu: &'a Gpu,
    pub plan: &'a Plan,
    pub data: &'a SceneData,
    pub memory: &'a Memory,
}

impl Binder<'_> {
    pub fn prepare(&self, step: &Step, run: &Run, parameters: &mut Parameters) -> Result<Prepared, GpuError> {
        let entries: Vec<&Entry> = run
            .kernel
            .entries
            .iter()
            .filter(|entry| {
                entry.name == run.entry || matches!(&run.how, How::Draw { fragment, .. } if *fragment == entry.name)
            })
            .collect();
        let structure = entries.iter().flat_map(|entry| &entry.bindings).find_map(|binding| match &binding.kind {
            BindingKind::Params(structure) => Some(structure),
            _ => None,
        });
        let add = |structure| parameters.add(self.gpu, &step.label, run, structure, self.data);
        let uniform = structure.map(add).transpose()?;
        let last_group =
            entries.iter().flat_map(|entry| &entry.bindings).map(|binding| binding.group).max().unwrap_or(0);
        let layouts: Vec<Vec<wgpu::BindGroupLayoutEntry>> =
            (0..=last_group).map(|group| layout_entries(&entries, group)).collect();
        let is_pair = |life: Life| matches!(life, Life::Next | Life::LastOf(_));
        let has_pairs = run.bindings.iter().any(|(_, id)| is_pair(self.plan.buffer(*id).life));
        let halves = if has_pairs { &[Half(0), Half(1)][..] } else { &[Half(0)] };
        let binding = Bound { binder: self, step, run, parameters, uniform };
        let groups = halves
            .iter()
            .map(|&half| {
                let group = |(at, layout): (usize, &Vec<_>)| binding.group(&entries, at as u32, layout, half);
                layouts.iter().enumerate().map(group).collect()
            })
            .collect::<Result<_, GpuError>>()?;
        let key = PipelineKey {
            kernel: run.kernel.hash.clone(),
            is_trusted: run.kernel.trusted,
            entry: run.entry.clone(),
            constants: run.constants().map(|(name, value)| (name.to_string(), value.to_bits())).collect(),
            layouts,
            draw: run.drawn().map(|(is_strip, target, fragment)| DrawKey {
                fragment: fragment.into(),
                topology: if is_strip { Topology::Strip } else { Topology::Triangles },
                target: colour(self.plan.buffer(target).elem),
                has_depth: true,
            }),
        };
        Ok(Prepared { pipeline: self.gpu.pipeline(&step.label, &run.kernel, key)?, groups, uniform })
    }
}

/// The entries of one group of a step, each once, whichever entry points have it.
pub(super) fn layout_entries(entries: &[&Entry], group: u32) -> Vec<wgpu::BindGroupLayoutEntry> {
    let mut found: BTreeMap<u32, wgpu::BindGroupLayoutEntry> = BTreeMap::new();
    for entry in entries {
        let visibility = match entry.stage {
            naga::ShaderStage::Vertex => wgpu::ShaderStages::VERTEX,
            naga::ShaderStage::Fragment => wgpu::ShaderStages::FRAGMENT,
            _ => wgpu::ShaderStages::COMPUTE,
        };
        for Binding { binding, kind, .. } in entry.bindings.iter().filter(|binding| binding.group == group) {
            let new = wgpu::BindGroupLayoutEntry { binding: *binding, visibility, ty: ty(kind), count: None };
            found.entry(*binding).or_insert(new).visibility |= visibility;
        }
    }
    found.into_values().collect()
}

fn ty(kind: &BindingKind) -> wgpu::BindingType {
    match kind {
        BindingKind::Params(structure) => wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: true,
            min_binding_size: NonZeroU64::new(structure.bytes.into()),
        },
        BindingKind::Storage { elem, length, written, .. } => wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: !written },
            has_dynamic_offset: false,
            min_binding_size: length.and_then(|length| NonZeroU64::new(u64::from(length) * elem.bytes())),
        },
        BindingKind::Image { float } => wgpu::BindingType::Texture {
            sample_type: match float {
                true => wgpu::TextureSampleType::Float { filterable: false },
                false => wgpu::TextureSampleType::Uint,
            },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        BindingKind::Sampler => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::NonFiltering),
    }
}

/// A step whose parameters have memory.
struct Bound<'a> {
    binder: &'a Binder<'a>,
    step: &'a Step,
    run: &'a Run,
    parameters: &'a Parameters,
    uniform: Option<usize>,
}

impl Bound<'_> {
    fn group(
        &self,
        entries: &[&Entry],
        group: u32,
        layout: &[wgpu::BindGroupLayoutEntry],
        half: Half,
    ) -> Result<wgpu::BindGroup, GpuError> {
        let gpu = self.binder.gpu;
        let bindings = entries.iter().flat_map(|entry| &entry.bindings).filter(|binding| binding.group == group);
        let mut resources: BTreeMap<u32, wgpu::BindingResource> = BTreeMap::new();
        for binding in bindings {
            resources.insert(binding.binding, self.resource(binding, half)?);
        }
        let entries: Vec<_> =
            resources.into_iter().map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        let layout = &gpu.layout(layout)?;
        gpu.scoped(&format!("the bindings of `{}`", self.step.label), || {
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
        })
    }

    fn resource(&self, binding: &Binding, half: Half) -> Result<wgpu::BindingResource<'_>, GpuError> {
        let Binder { plan, memory, .. } = self.binder;
        let attached = self.run.bindings.iter().find(|(variable, _)| *variable == binding.name).map(|(_, id)| *id);
        let place = attached.and_then(|id| memory.place(plan, id, half));
        match (&binding.kind, place) {
            (BindingKind::Params(_), _) => {
                let uniform = self.parameters.uniform(self.uniform.ok_or_else(|| self.unbound(&binding.name))?);
                let size = NonZeroU64::new(uniform.bytes);
                let buffer = &uniform.buffer;
                Ok(wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size }))
            }
            (BindingKind::Storage { elem, written, .. }, place) => {
                let unused = &memory.unused[usize::from(*written)];
                let Some(buffer) = place.and_then(Place::array) else { return Ok(unused.as_entire_binding()) };
                // a block can be larger than its tenant, whose size is what arrayLength() has to say
                let bytes = attached.map_or(0, |id| plan.buffer(id).bytes());
                let size = NonZeroU64::new(bytes.next_multiple_of(elem.bytes()));
                Ok(wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size }))
            }
            (BindingKind::Image { .. }, Some(place)) => {
                let view = place.image().ok_or_else(|| self.unbound(&binding.name))?;
                Ok(wgpu::BindingResource::TextureView(view))
            }
            (BindingKind::Sampler, _) => Ok(wgpu::BindingResource::Sampler(&memory.nearest)),
            _ => Err(self.unbound(&binding.name)),
        }
    }

    fn unbound(&self, name: &str) -> GpuError {
        GpuError::Refused {
            what: format!("the binding `{name}` of `{}`", self.step.label),
            why: "it is bound to nothing".into(),
        }
    }
}
