//! Carries out a plan: everything is made beforehand, a frame is one submission.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use super::memory::{DEPTH, Place, colour, make_buffer, make_buffers, upload};
use super::{Gpu, GpuError};
use crate::kernel::{BindingKind, Entry, Field, FieldKind, Kernel, Structure};
use crate::plan::{BufferId, Often, Plan, SceneData, Step, Value, Vertices, Work};

/// GPU time of one step; `None` if the adapter's stamps are missing or contradict the clock.
#[derive(Clone, Debug, PartialEq)]
pub struct StepTime {
    pub step: usize,
    pub ms: Option<f64>,
}

/// One submission: wall time from the first command to the end of its execution, and its steps.
#[derive(Clone, Debug)]
pub struct SubmissionTime {
    pub wall_ms: f64,
    /// From the first step's beginning to the last step's end.
    pub gpu_ms: Option<f64>,
    pub steps: Vec<StepTime>,
}

pub struct Executor<'a> {
    gpu: &'a Gpu,
    plan: &'a Plan,
    buffers: Vec<Option<Place>>,
    steps: Vec<Prepared>,
    stamps: Option<Stamps>,
    nearest: wgpu::Sampler,
    /// Time it took to make buffers and pipelines and to upload the terrain.
    pub prepare_ms: f64,
}

struct Prepared {
    pipeline: Pipeline,
    bind_group: wgpu::BindGroup,
    /// Bytes from one frame's parameters to the next; `None` without parameters.
    params_stride: Option<u32>,
}

/// Modules and pipelines that several steps share.
#[derive(Default)]
struct Shared {
    modules: BTreeMap<String, wgpu::ShaderModule>,
    /// By kernel, entry point, and constants with what is drawn.
    pipelines: BTreeMap<(String, String, String), Pipeline>,
}

#[derive(Clone)]
enum Pipeline {
    Compute(wgpu::ComputePipeline),
    Render(wgpu::RenderPipeline),
}

struct Stamps {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
}

impl<'a> Executor<'a> {
    pub fn new(gpu: &'a Gpu, plan: &'a Plan, data: &SceneData) -> Result<Self, GpuError> {
        gpu.check_plan(plan)?;
        let start = Instant::now();
        let buffers = make_buffers(gpu, plan)?;
        buffers.iter().flatten().for_each(|place| upload(gpu, place, bytemuck::cast_slice(&data.terrain.heights_m)));
        // the default is nearest and clamped to the edge
        let nearest = gpu.device.create_sampler(&wgpu::SamplerDescriptor::default());
        let mut executor = Self { gpu, plan, buffers, steps: Vec::new(), stamps: None, nearest, prepare_ms: 0.0 };
        let mut shared = Shared::default();
        let unused = make_buffer(gpu, "left out", 64, wgpu::BufferUsages::STORAGE)?;
        for step in &plan.steps {
            let prepared = executor.prepare(step, &mut shared, &unused)?;
            executor.steps.push(prepared);
        }
        if gpu.summary.timestamps && !plan.steps.is_empty() {
            executor.stamps = Some(executor.make_stamps()?);
        }
        gpu.queue.submit([]);
        gpu.wait()?;
        executor.prepare_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(executor)
    }

    /// Runs the steps that run once.
    pub fn setup(&self) -> Result<SubmissionTime, GpuError> {
        self.submit(&self.chosen(Often::Once), 0)
    }

    /// Runs the steps of one frame.
    pub fn frame(&self, frame: usize) -> Result<SubmissionTime, GpuError> {
        self.submit(&self.chosen(Often::EveryFrame), frame)
    }

    /// Runs a frame with each step as a submission of its own, timed by the clock less what an empty submission
    /// takes: what is left to say about kernels where the stamps are not to be believed.
    pub fn frame_by_steps(&self, frame: usize) -> Result<SubmissionTime, GpuError> {
        self.by_steps(Often::EveryFrame, frame)
    }

    pub fn setup_by_steps(&self) -> Result<SubmissionTime, GpuError> {
        self.by_steps(Often::Once, 0)
    }

    /// Runs one step by itself.
    pub fn step(&self, step: usize, frame: usize) -> Result<SubmissionTime, GpuError> {
        self.submit(&[step], frame)
    }

    fn by_steps(&self, often: Often, frame: usize) -> Result<SubmissionTime, GpuError> {
        let mut steps = Vec::new();
        for step in self.chosen(often) {
            let ms = self.submit(&[step], frame)?.wall_ms - self.gpu.submission_ms;
            steps.push(StepTime { step, ms: Some(ms.max(0.0)) });
        }
        Ok(SubmissionTime { wall_ms: steps.iter().filter_map(|time| time.ms).sum(), gpu_ms: None, steps })
    }

    pub fn believes_stamps(&self) -> bool {
        self.stamps.is_some()
    }

    fn chosen(&self, often: Often) -> Vec<usize> {
        (0..self.plan.steps.len()).filter(|&at| self.plan.steps[at].often == often).collect()
    }

    fn submit(&self, chosen: &[usize], frame: usize) -> Result<SubmissionTime, GpuError> {
        let start = Instant::now();
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        // beginning a pass costs as much as a small kernel: with no stamps to write, steps share one
        let is_compute = |at: usize| matches!(self.steps[at].pipeline, Pipeline::Compute(_));
        let shares = |a: &usize, b: &usize| self.stamps.is_none() && is_compute(*a) && is_compute(*b);
        for steps in chosen.chunk_by(shares) {
            self.encode(&mut encoder, steps, frame)?;
        }
        if let Some(stamps) = &self.stamps {
            let count = 2 * self.plan.steps.len() as u32;
            encoder.resolve_query_set(&stamps.queries, 0..count, &stamps.resolved, 0);
            encoder.copy_buffer_to_buffer(&stamps.resolved, 0, &stamps.readable, 0, stamps.resolved.size());
        }
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.wait()?;
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        self.times(chosen, wall_ms)
    }

    /// One pass: any number of compute steps, or one draw.
    fn encode(&self, encoder: &mut wgpu::CommandEncoder, steps: &[usize], frame: usize) -> Result<(), GpuError> {
        let Some(&at) = steps.first() else { return Ok(()) };
        let (step, prepared) = (&self.plan.steps[at], &self.steps[at]);
        let stamps = self.stamps.as_ref().map(|stamps| (&stamps.queries, 2 * at as u32));
        match (&prepared.pipeline, &step.work) {
            (Pipeline::Compute(_), _) => {
                let timestamp_writes = stamps.map(|(query_set, first)| wgpu::ComputePassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: Some(first),
                    end_of_pass_write_index: Some(first + 1),
                });
                let mut pass = encoder
                    .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(&step.label), timestamp_writes });
                for &at in steps {
                    self.dispatch(&mut pass, at, frame)?;
                }
            }
            (Pipeline::Render(pipeline), Work::Draw { vertices, target, .. }) => {
                let Some(Place::Target { view, depth, .. }) = &self.buffers[target.0] else {
                    return Err(no_memory(step, "render target"));
                };
                let timestamp_writes = stamps.map(|(query_set, first)| wgpu::RenderPassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: Some(first),
                    end_of_pass_write_index: Some(first + 1),
                });
                let clear = |value| wgpu::Operations { load: wgpu::LoadOp::Clear(value), store: wgpu::StoreOp::Store };
                let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some(&step.label),
                    color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                        view,
                        depth_slice: None,
                        resolve_target: None,
                        ops: clear(wgpu::Color::TRANSPARENT),
                    })],
                    depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                        view: depth,
                        depth_ops: Some(wgpu::Operations {
                            load: wgpu::LoadOp::Clear(0.0),
                            store: wgpu::StoreOp::Discard,
                        }),
                        stencil_ops: None,
                    }),
                    timestamp_writes,
                    ..Default::default()
                });
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, &prepared.bind_group, self.offset(at, frame).as_slice());
                match vertices {
                    Vertices::Strip { vertices, .. } => pass.draw(0..*vertices, 0..1),
                    Vertices::List(id) => {
                        let count = self.buffers[id.0].as_ref().and_then(Place::array);
                        pass.draw_indirect(count.ok_or_else(|| no_memory(step, "number of vertices"))?, 0);
                    }
                }
            }
            _ => return Err(no_memory(step, "pipeline")),
        }
        Ok(())
    }

    /// Where a step's parameters of a frame are.
    fn offset(&self, at: usize, frame: usize) -> Option<u32> {
        self.steps[at].params_stride.map(|stride| stride * frame as u32)
    }

    fn dispatch(&self, pass: &mut wgpu::ComputePass, at: usize, frame: usize) -> Result<(), GpuError> {
        let (step, prepared) = (&self.plan.steps[at], &self.steps[at]);
        let Pipeline::Compute(pipeline) = &prepared.pipeline else { return Err(no_memory(step, "pipeline")) };
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &prepared.bind_group, self.offset(at, frame).as_slice());
        match step.work {
            Work::Groups([x, y, z]) => pass.dispatch_workgroups(x, y, z),
            Work::Indirect(id) => {
                let groups = self.buffers[id.0].as_ref().and_then(Place::array);
                pass.dispatch_workgroups_indirect(groups.ok_or_else(|| no_memory(step, "number of workgroups"))?, 0);
            }
            Work::Draw { .. } => return Err(no_memory(step, "render pass")),
        }
        Ok(())
    }

    /// Reads the stamps after the submission is done. Stamps that run backwards, or that claim more time than
    /// passed on the clock, are worth nothing.
    fn times(&self, chosen: &[usize], wall_ms: f64) -> Result<SubmissionTime, GpuError> {
        let unmeasured = |&step: &usize| StepTime { step, ms: None };
        let none = SubmissionTime { wall_ms, gpu_ms: None, steps: chosen.iter().map(unmeasured).collect() };
        let (Some(stamps), Some(&first), Some(&last)) = (&self.stamps, chosen.first(), chosen.last()) else {
            return Ok(none);
        };
        let bytes = self.map(&stamps.readable)?;
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&bytes);
        let tick_ms = f64::from(self.gpu.queue.get_timestamp_period()) / 1e6;
        let between = |from: u64, to: u64| {
            let ms = to.checked_sub(from)? as f64 * tick_ms;
            (from != 0 && ms <= wall_ms * 1.05).then_some(ms)
        };
        let steps: Vec<StepTime> =
            chosen.iter().map(|&step| StepTime { step, ms: between(ticks[2 * step], ticks[2 * step + 1]) }).collect();
        Ok(SubmissionTime { wall_ms, gpu_ms: between(ticks[2 * first], ticks[2 * last + 1]), steps })
    }

    /// The bytes of a buffer as they are now. Not for use inside a frame.
    pub fn read(&self, id: BufferId) -> Result<Vec<u8>, GpuError> {
        let buffer = self.plan.buffer(id);
        let size = buffer.bytes();
        let device = &self.gpu.device;
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let place = self.buffers[id.0].as_ref();
        let staging = match (place, place.and_then(Place::array)) {
            (_, Some(source)) => {
                let staging = make_buffer(self.gpu, &buffer.name, size, usage)?;
                encoder.copy_buffer_to_buffer(source, 0, &staging, 0, size);
                staging
            }
            (Some(Place::Target { texture, .. }), None) => {
                let row =
                    (texture.width() * buffer.elem.bytes() as u32).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
                let staging = make_buffer(self.gpu, &buffer.name, u64::from(row) * u64::from(texture.height()), usage)?;
                let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
                encoder.copy_texture_to_buffer(
                    texture.as_image_copy(),
                    wgpu::TexelCopyBufferInfo { buffer: &staging, layout },
                    texture.size(),
                );
                staging
            }
            _ => return Err(GpuError::Plan(format!("the buffer `{}` is read and has no memory", buffer.name))),
        };
        self.gpu.queue.submit([encoder.finish()]);
        let mut bytes = self.map(&staging)?;
        if let Some(Place::Target { texture, .. }) = &self.buffers[id.0] {
            let row = texture.width() as usize * buffer.elem.bytes() as usize;
            let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT as usize);
            bytes = bytes.chunks_exact(padded).flat_map(|padded| &padded[..row]).copied().collect();
        }
        // the smallest buffers are made larger than they need
        bytes.truncate(size as usize);
        Ok(bytes)
    }

    fn map(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
        // what map_async says is said again by get_mapped_range
        buffer.map_async(wgpu::MapMode::Read, .., |_| {});
        self.gpu.wait()?;
        let bytes = buffer.get_mapped_range(..).map_err(|error| GpuError::Lost(error.to_string()))?.to_vec();
        buffer.unmap();
        Ok(bytes)
    }

    fn make_stamps(&self) -> Result<Stamps, GpuError> {
        let count = 2 * self.plan.steps.len() as u32;
        let queries = self.gpu.scoped("timestamps", || {
            self.gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: None,
                ty: wgpu::QueryType::Timestamp,
                count,
            })
        })?;
        let bytes = u64::from(count) * 8;
        use wgpu::BufferUsages as Usage;
        Ok(Stamps {
            queries,
            resolved: make_buffer(self.gpu, "timestamps", bytes, Usage::QUERY_RESOLVE | Usage::COPY_SRC)?,
            readable: make_buffer(self.gpu, "timestamps", bytes, Usage::MAP_READ | Usage::COPY_DST)?,
        })
    }

    fn prepare(&self, step: &Step, shared: &mut Shared, unused: &wgpu::Buffer) -> Result<Prepared, GpuError> {
        let hash = step.kernel.hash.clone();
        let module = shared.modules.entry(hash.clone()).or_insert_with(|| make_module(self.gpu, &step.kernel));
        let entries: Vec<&Entry> = step
            .kernel
            .entries
            .iter()
            .filter(|entry| {
                entry.name == step.entry || matches!(&step.work, Work::Draw { fragment, .. } if *fragment == entry.name)
            })
            .collect();
        let params = self.make_params(step, &entries)?;
        let (layout, bind_group) =
            self.bind(step, &entries, params.as_ref().map(|(buffer, bytes, _)| (buffer, *bytes)), unused)?;
        let constants: Vec<(&str, f64)> = step
            .constants
            .iter()
            .filter(|(name, _)| step.kernel.overrides.contains(name))
            .map(|(name, value)| (name.as_str(), *value))
            .collect();
        // rounds of a stage differ in what they bind, not in what they run
        let key = (hash, step.entry.clone(), format!("{constants:?} {:?}", step.work.drawn()));
        let pipeline = match shared.pipelines.get(&key) {
            Some(pipeline) => pipeline.clone(),
            None => {
                let what = format!("the pipeline of `{}` ({})", step.label, step.kernel.name);
                let new = || make_pipeline(self.gpu, self.plan, step, module, &layout, &constants);
                shared.pipelines.entry(key).or_insert(self.gpu.scoped(&what, new)?).clone()
            }
        };
        Ok(Prepared { pipeline, bind_group, params_stride: params.map(|(_, _, stride)| stride) })
    }

    /// One uniform buffer with the parameters of all frames, so that a frame uploads nothing.
    fn make_params(&self, step: &Step, entries: &[&Entry]) -> Result<Option<(wgpu::Buffer, u64, u32)>, GpuError> {
        let structure = entries.iter().flat_map(|entry| &entry.bindings).find_map(|binding| match &binding.kind {
            BindingKind::Params(structure) => Some(structure),
            _ => None,
        });
        let Some(structure) = structure else { return Ok(None) };
        let aligned = structure.bytes.next_multiple_of(self.gpu.limits.min_uniform_buffer_offset_alignment);
        let frames = if step.is_per_frame() { self.plan.frames } else { 1 };
        let mut bytes = vec![0; aligned as usize * frames];
        for (frame, bytes) in bytes.chunks_exact_mut(aligned as usize).enumerate() {
            pack(structure, step, frame, bytes);
        }
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let buffer = make_buffer(self.gpu, &format!("parameters of {}", step.label), bytes.len() as u64, usage)?;
        self.gpu.queue.write_buffer(&buffer, 0, &bytes);
        let stride = if step.is_per_frame() { aligned } else { 0 };
        Ok(Some((buffer, structure.bytes.into(), stride)))
    }

    fn bind(
        &self,
        step: &Step,
        entries: &[&Entry],
        params: Option<(&wgpu::Buffer, u64)>,
        unused: &wgpu::Buffer,
    ) -> Result<(wgpu::PipelineLayout, wgpu::BindGroup), GpuError> {
        let mut layout_entries: BTreeMap<u32, wgpu::BindGroupLayoutEntry> = BTreeMap::new();
        let mut group_entries: BTreeMap<u32, wgpu::BindingResource> = BTreeMap::new();
        for entry in entries {
            let visibility = match entry.stage {
                naga::ShaderStage::Vertex => wgpu::ShaderStages::VERTEX,
                naga::ShaderStage::Fragment => wgpu::ShaderStages::FRAGMENT,
                _ => wgpu::ShaderStages::COMPUTE,
            };
            for binding in &entry.bindings {
                let (ty, resource) = self.resource(step, &binding.name, &binding.kind, params, unused)?;
                let slot = layout_entries.entry(binding.binding).or_insert(wgpu::BindGroupLayoutEntry {
                    binding: binding.binding,
                    visibility,
                    ty,
                    count: None,
                });
                slot.visibility |= visibility;
                group_entries.insert(binding.binding, resource);
            }
        }
        let layout_entries: Vec<_> = layout_entries.into_values().collect();
        let entries: Vec<_> =
            group_entries.into_iter().map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        let device = &self.gpu.device;
        self.gpu.scoped(&format!("the bindings of `{}`", step.label), || {
            let layout = device
                .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &layout_entries });
            let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &layout,
                entries: &entries,
            });
            let pipeline = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                bind_group_layouts: &[Some(&layout)],
                ..Default::default()
            });
            (pipeline, group)
        })
    }

    fn resource<'r>(
        &'r self,
        step: &Step,
        name: &str,
        kind: &BindingKind,
        params: Option<(&'r wgpu::Buffer, u64)>,
        unused: &'r wgpu::Buffer,
    ) -> Result<(wgpu::BindingType, wgpu::BindingResource<'r>), GpuError> {
        let attached =
            step.bindings.iter().find(|(variable, _)| variable == name).and_then(|(_, id)| self.buffers[id.0].as_ref());
        match (kind, attached, params) {
            (BindingKind::Params(structure), _, Some((buffer, bytes))) => {
                let size = std::num::NonZeroU64::new(bytes);
                let ty = wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Uniform,
                    has_dynamic_offset: true,
                    min_binding_size: std::num::NonZeroU64::new(structure.bytes.into()),
                };
                Ok((ty, wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size })))
            }
            (BindingKind::Storage { elem, written, .. }, place, _) => {
                let ty = wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage { read_only: !written },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                };
                let Some(buffer) = place.and_then(Place::array) else { return Ok((ty, unused.as_entire_binding())) };
                // a block can be larger than its tenant, whose size is what arrayLength() has to say
                let bytes = step
                    .bindings
                    .iter()
                    .find(|(variable, _)| variable == name)
                    .map_or(0, |(_, id)| self.plan.buffer(*id).bytes());
                let size = std::num::NonZeroU64::new(bytes.next_multiple_of(elem.bytes()));
                Ok((ty, wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size })))
            }
            (BindingKind::Image { float }, Some(place), _) => {
                let ty = wgpu::BindingType::Texture {
                    sample_type: if *float {
                        wgpu::TextureSampleType::Float { filterable: false }
                    } else {
                        wgpu::TextureSampleType::Uint
                    },
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                };
                let view = place.image().ok_or_else(|| unbound(step, name))?;
                Ok((ty, wgpu::BindingResource::TextureView(view)))
            }
            (BindingKind::Sampler, _, _) => {
                let ty = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::NonFiltering);
                Ok((ty, wgpu::BindingResource::Sampler(&self.nearest)))
            }
            _ => Err(unbound(step, name)),
        }
    }
}

/// A step lacks something that every plan gives it.
fn no_memory(step: &Step, what: &str) -> GpuError {
    GpuError::Plan(format!("the step `{}` has no {what}", step.label))
}

fn unbound(step: &Step, name: &str) -> GpuError {
    GpuError::Refused {
        what: format!("the binding `{name}` of `{}`", step.label),
        why: "it is bound to nothing".into(),
    }
}

fn make_module(gpu: &Gpu, kernel: &Arc<Kernel>) -> wgpu::ShaderModule {
    let source = wgpu::ShaderSource::Wgsl(kernel.assembled.text.as_str().into());
    let descriptor = wgpu::ShaderModuleDescriptor { label: Some(&kernel.name), source };
    if !kernel.trusted {
        return gpu.device.create_shader_module(descriptor);
    }
    // SAFETY: only the kernels in `kernels/` are trusted. Their indices are clamped to the sizes they are given
    // or computed from in-range coordinates, and their loops end; the numeric tests run them on every adapter.
    unsafe { gpu.device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked()) }
}

fn make_pipeline(
    gpu: &Gpu,
    plan: &Plan,
    step: &Step,
    module: &wgpu::ShaderModule,
    layout: &wgpu::PipelineLayout,
    constants: &[(&str, f64)],
) -> Pipeline {
    let compilation_options = wgpu::PipelineCompilationOptions { constants, ..Default::default() };
    let Work::Draw { fragment, target, vertices } = &step.work else {
        return Pipeline::Compute(gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(&step.label),
            layout: Some(layout),
            module,
            entry_point: Some(&step.entry),
            compilation_options,
            cache: None,
        }));
    };
    Pipeline::Render(gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(&step.label),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(&step.entry),
            compilation_options: compilation_options.clone(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState {
            topology: match vertices {
                Vertices::Strip { .. } => wgpu::PrimitiveTopology::TriangleStrip,
                Vertices::List(_) => wgpu::PrimitiveTopology::TriangleList,
            },
            ..Default::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            // reversed depth: nearer is larger
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(fragment),
            compilation_options,
            targets: &[Some(colour(plan.buffer(*target).elem).into())],
        }),
        multiview_mask: None,
        cache: None,
    }))
}

/// Writes a frame's parameters where naga says their fields are.
fn pack(structure: &Structure, step: &Step, frame: usize, bytes: &mut [u8]) {
    for Field { name, offset, kind, .. } in &structure.fields {
        let Some((_, series)) = step.params.iter().find(|(field, _)| field == name) else { continue };
        let packed: &[u8] = match series.at(frame) {
            Value::F32(values) => bytemuck::cast_slice(values),
            Value::U32(values) => bytemuck::cast_slice(values),
            Value::I32(values) => bytemuck::cast_slice(values),
        };
        let (FieldKind::F32(components) | FieldKind::U32(components) | FieldKind::I32(components)) = *kind;
        let length = packed.len().min(4 * components as usize);
        let start = *offset as usize;
        bytes[start..start + length].copy_from_slice(&packed[..length]);
    }
}
