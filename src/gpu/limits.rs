//! Whether a plan fits an adapter: everything that its device would refuse later, before anything is allocated.

use super::GpuError;
use crate::kernel::{Binding, BindingKind, Entry, Structure};
use crate::plan::{Buffer, BufferId, How, Plan, Run, Step, Storage};

/// Compares a plan with the limits of an adapter of this name; the error is the first thing that it has too much of.
pub fn check(plan: &Plan, limits: &wgpu::Limits, adapter: &str) -> Result<(), GpuError> {
    let fit = Fit { plan, limits, adapter };
    let living = (0..plan.buffers.len()).map(BufferId).filter(|&id| plan.lives(id));
    living.into_iter().try_for_each(|id| fit.buffer(id))?;
    let runs = plan.steps.iter().filter_map(|step| Some((step, step.run()?)));
    runs.into_iter().try_for_each(|(step, run)| fit.step(step, run))
}

type IsKind = fn(&BindingKind) -> bool;

struct Fit<'a> {
    plan: &'a Plan,
    limits: &'a wgpu::Limits,
    adapter: &'a str,
}

impl Fit<'_> {
    fn limit(
        &self,
        what: impl FnOnce() -> String,
        needed: impl Into<u64>,
        limit: impl Into<u64>,
    ) -> Result<(), GpuError> {
        let (needed, limit) = (needed.into(), limit.into());
        match needed <= limit {
            true => Ok(()),
            false => Err(GpuError::Limit { what: what(), needed, adapter: self.adapter.into(), limit }),
        }
    }

    fn buffer(&self, id: BufferId) -> Result<(), GpuError> {
        let buffer: &Buffer = self.plan.buffer(id);
        let (is_array, is_image) = match buffer.storage {
            Storage::Input => self.plan.bound_as(id),
            Storage::Buffer => (true, false),
            Storage::Target => (false, true),
        };
        let limit = self.limits.max_storage_buffer_binding_size.min(self.limits.max_buffer_size);
        if is_array && buffer.bytes() > limit {
            let (buffer, needed, adapter) = (buffer.name.clone(), buffer.bytes(), self.adapter.into());
            return Err(GpuError::BufferTooLarge { buffer, needed, adapter, limit });
        }
        let side = if is_image { buffer.dims.iter().copied().max().unwrap_or(0) } else { 0 };
        self.limit(|| format!("a side of the image `{}`", buffer.name), side, self.limits.max_texture_dimension_2d)
    }

    fn step(&self, step: &Step, run: &Run) -> Result<(), GpuError> {
        let of_step = |what: &str| format!("the step `{}` ({}) in {what}", step.label, run.kernel.name);
        let names = std::iter::once(run.entry.as_str()).chain(run.drawn().map(|(_, _, fragment)| fragment));
        let entries: Vec<&Entry> = names.filter_map(|name| run.kernel.entry(name).ok()).collect();
        for entry in &entries {
            self.bindings(entry, &of_step)?;
            if entry.stage == naga::ShaderStage::Compute {
                self.workgroup(entry, &of_step)?;
            }
        }
        let slots = if run.is_per_frame() { self.plan.packed_frames() as u64 } else { 1 };
        for structure in entries.iter().flat_map(|entry| structures(entry)) {
            let limit = self.limits.max_uniform_buffer_binding_size;
            self.limit(|| of_step("bytes of parameters"), structure.bytes, limit)?;
            let stride = structure.bytes.next_multiple_of(self.limits.min_uniform_buffer_offset_alignment.max(1));
            let what = || of_step("bytes of the parameters of all frames");
            self.limit(what, u64::from(stride) * slots, self.limits.max_buffer_size)?;
        }
        match &run.how {
            How::Groups(groups) => {
                let what = || format!("a side of the dispatch of `{}`, in workgroups,", step.label);
                let most = groups.iter().copied().max().unwrap_or(0);
                self.limit(what, most, self.limits.max_compute_workgroups_per_dimension)
            }
            How::Draw { .. } => {
                let most = entries.iter().map(|entry| entry.varyings).max().unwrap_or(0);
                self.limit(
                    || of_step("variables between its shaders"),
                    most,
                    self.limits.max_inter_stage_shader_variables,
                )
            }
            // kernels limit the numbers that they write themselves
            How::Indirect(_) => Ok(()),
        }
    }

    /// What one shader stage binds.
    fn bindings(&self, entry: &Entry, of_step: &dyn Fn(&str) -> String) -> Result<(), GpuError> {
        let count =
            |is: fn(&BindingKind) -> bool| entry.bindings.iter().filter(|binding| is(&binding.kind)).count() as u64;
        let limits = self.limits;
        let kinds: [(&str, IsKind, u32); 4] = [
            (
                "storage buffers",
                |kind| matches!(kind, BindingKind::Storage { .. }),
                limits.max_storage_buffers_per_shader_stage,
            ),
            (
                "uniform buffers",
                |kind| matches!(kind, BindingKind::Params(_)),
                limits.max_uniform_buffers_per_shader_stage,
            ),
            ("images", |kind| matches!(kind, BindingKind::Image { .. }), limits.max_sampled_textures_per_shader_stage),
            ("samplers", |kind| matches!(kind, BindingKind::Sampler), limits.max_samplers_per_shader_stage),
        ];
        for (what, is, limit) in kinds {
            self.limit(|| of_step(what), count(is), limit)?;
        }
        let most = |of: fn(&Binding) -> u32| {
            entry.bindings.iter().map(|binding| of(binding).saturating_add(1)).max().unwrap_or(0)
        };
        self.limit(|| of_step("groups of bindings"), most(|binding| binding.group), limits.max_bind_groups)?;
        let number = most(|binding| binding.binding);
        self.limit(|| of_step("numbers of bindings in a group"), number, limits.max_bindings_per_bind_group)
    }

    fn workgroup(&self, entry: &Entry, of_step: &dyn Fn(&str) -> String) -> Result<(), GpuError> {
        let limits = self.limits;
        let sides = [
            limits.max_compute_workgroup_size_x,
            limits.max_compute_workgroup_size_y,
            limits.max_compute_workgroup_size_z,
        ];
        for ((axis, side), limit) in ["x", "y", "z"].into_iter().zip(entry.workgroup_size).zip(sides) {
            self.limit(|| of_step(&format!("threads of a workgroup along {axis}")), side, limit)?;
        }
        let threads = entry.workgroup_size.into_iter().map(u64::from).fold(1, u64::saturating_mul);
        self.limit(|| of_step("threads of a workgroup"), threads, limits.max_compute_invocations_per_workgroup)?;
        let bytes = entry.workgroup_bytes;
        self.limit(|| of_step("bytes of a workgroup's memory"), bytes, limits.max_compute_workgroup_storage_size)
    }
}

/// The parameters of an entry point.
fn structures(entry: &Entry) -> impl Iterator<Item = &Structure> {
    entry.bindings.iter().filter_map(|binding| match &binding.kind {
        BindingKind::Params(structure) => Some(structure),
        _ => None,
    })
}
