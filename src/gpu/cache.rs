//! What lives as long as the device: modules, layouts and pipelines, each made once.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Mutex, PoisonError};

use super::{Gpu, GpuError};
use crate::kernel::{Kernel, on_large_stack};

#[derive(Clone)]
pub enum Pipeline {
    Compute(wgpu::ComputePipeline),
    Render(wgpu::RenderPipeline),
}

/// Everything that a pipeline is made of. Rounds of a stage, cells of a sweep and the ground truth differ in what they bind, not in this.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct PipelineKey {
    /// Of the kernel's text.
    pub kernel: String,
    pub is_trusted: bool,
    pub entry: String,
    pub constants: Vec<(String, u64)>,
    /// One for each group.
    pub layouts: Vec<Vec<wgpu::BindGroupLayoutEntry>>,
    /// What is drawn, if it is a draw.
    pub draw: Option<DrawKey>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct DrawKey {
    pub fragment: String,
    pub topology: Topology,
    pub target: wgpu::TextureFormat,
    /// The nearest is kept, of whatever is drawn.
    pub has_depth: bool,
}

/// What the vertices of a draw make.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Topology {
    Strip,
    Triangles,
    Lines,
}

#[derive(Default)]
pub struct Cache {
    modules: Mutex<HashMap<(String, bool), wgpu::ShaderModule>>,
    layouts: Mutex<HashMap<Vec<wgpu::BindGroupLayoutEntry>, wgpu::BindGroupLayout>>,
    pipelines: Mutex<HashMap<PipelineKey, Pipeline>>,
}

/// What is known under a key, or else what `make` makes. (A thread that failed while it held the lock has left whole entries only.)
fn known<K: Hash + Eq, V: Clone>(
    map: &Mutex<HashMap<K, V>>,
    key: K,
    make: impl FnOnce(&K) -> Result<V, GpuError>,
) -> Result<V, GpuError> {
    let mut map = map.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(value) = map.get(&key) {
        return Ok(value.clone());
    }
    let value = make(&key)?;
    map.insert(key, value.clone());
    Ok(value)
}

impl Gpu {
    pub(super) fn module(&self, kernel: &Kernel) -> Result<wgpu::ShaderModule, GpuError> {
        known(&self.cache.modules, (kernel.hash.clone(), kernel.trusted), |_| {
            let what = format!("the kernel `{}`", kernel.name);
            compiled(kernel, || self.scoped(&what, || make_module(self, kernel)))
        })
    }

    pub(super) fn layout(&self, entries: &[wgpu::BindGroupLayoutEntry]) -> Result<wgpu::BindGroupLayout, GpuError> {
        known(&self.cache.layouts, entries.to_vec(), |entries| {
            let descriptor = wgpu::BindGroupLayoutDescriptor { label: None, entries };
            self.scoped("the layout of bindings", || self.device.create_bind_group_layout(&descriptor))
        })
    }

    pub(super) fn pipeline(&self, label: &str, kernel: &Kernel, key: PipelineKey) -> Result<Pipeline, GpuError> {
        let module = self.module(kernel)?;
        let layouts = key.layouts.iter().map(|entries| self.layout(entries)).collect::<Result<Vec<_>, _>>()?;
        known(&self.cache.pipelines, key, |key| {
            let what = format!("the pipeline of `{label}` ({})", kernel.name);
            let make = || self.scoped(&what, || make_pipeline(self, label, key, &module, &layouts));
            self.watched(|| what.clone(), || compiled(kernel, make))
        })
    }
}

/// Runs what compiles a kernel; a user's may be deeper than the stack of the thread that is here. (Errors are caught by thread: all of it runs
/// on the other.)
fn compiled<T: Send>(kernel: &Kernel, make: impl FnOnce() -> Result<T, GpuError> + Send) -> Result<T, GpuError> {
    if kernel.trusted {
        return make();
    }
    on_large_stack(make).map_err(|why| GpuError::Refused { what: format!("the kernel `{}`", kernel.name), why })?
}

fn make_module(gpu: &Gpu, kernel: &Kernel) -> wgpu::ShaderModule {
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
    label: &str,
    key: &PipelineKey,
    module: &wgpu::ShaderModule,
    layouts: &[wgpu::BindGroupLayout],
) -> Pipeline {
    let layouts: Vec<Option<&wgpu::BindGroupLayout>> = layouts.iter().map(Some).collect();
    let layout = gpu
        .device
        .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor { bind_group_layouts: &layouts, ..Default::default() });
    let constants: Vec<(&str, f64)> =
        key.constants.iter().map(|(name, bits)| (name.as_str(), f64::from_bits(*bits))).collect();
    let compilation_options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
    let Some(draw) = &key.draw else {
        return Pipeline::Compute(gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout: Some(&layout),
            module,
            entry_point: Some(&key.entry),
            compilation_options,
            cache: None,
        }));
    };
    Pipeline::Render(gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(&key.entry),
            compilation_options: compilation_options.clone(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState {
            topology: match draw.topology {
                Topology::Strip => wgpu::PrimitiveTopology::TriangleStrip,
                Topology::Triangles => wgpu::PrimitiveTopology::TriangleList,
                Topology::Lines => wgpu::PrimitiveTopology::LineList,
            },
            ..Default::default()
        },
        depth_stencil: draw.has_depth.then(|| wgpu::DepthStencilState {
            format: super::memory::DEPTH,
            depth_write_enabled: Some(true),
            // reversed depth: nearer is larger
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(&draw.fragment),
            compilation_options,
            targets: &[Some(draw.target.into())],
        }),
        multiview_mask: None,
        cache: None,
    }))
}
