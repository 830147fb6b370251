//! How often the loops of a thread may turn.
//!
//! Software adapters have been seen to end all loops of a thread after 65535 turns in all, without a word: what the kernel leaves is wrong.

use super::memory::make_buffer;
use super::{Gpu, GpuError, readback};
use crate::plan::Plan;

/// Turns that the adapter is asked for.
const WANTED: u32 = 200_000;

/// Numbers that nobody knows but who takes every turn.
const KERNEL: &str = "
@group(0) @binding(0) var<storage, read_write> state: array<u32>;
override TURNS: u32 = 1u;
@compute @workgroup_size(1)
fn main() {
    var own = state[0];
    for (var turn = 0u; turn < TURNS; turn++) {
        own = own * 747796405u + 2891336453u;
    }
    state[0] = own;
}
";

/// The turns that the adapter has taken where it was asked for more; `None` if it took them all.
pub fn most_turns(gpu: &Gpu) -> Result<Option<u32>, GpuError> {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    let state = make_buffer(gpu, "state of a loop", 4, usage)?;
    let staging = make_buffer(gpu, "state of a loop", 4, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)?;
    let copied = gpu.scoped("the kernel that counts turns", || {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encode(gpu, &mut encoder, &state);
        encoder.copy_buffer_to_buffer(&state, 0, &staging, 0, 4);
        gpu.queue.submit([encoder.finish()])
    })?;
    let found: Vec<u32> = bytemuck::pod_collect_to_vec(&readback::map(gpu, &staging, &copied)?[..4]);
    let mut own = 0u32;
    let taken = (0..WANTED).find(|_| {
        let is_it = found[0] == own;
        own = own.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        is_it
    });
    // a number that no turn leads to is not the mistake that is looked for here
    Ok(taken)
}

fn encode(gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, state: &wgpu::Buffer) {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(KERNEL.into()),
    });
    let constants = &[("TURNS", f64::from(WANTED))];
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
        cache: None,
    });
    let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: state.as_entire_binding() }],
    });
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups(1, 1, 1);
}

impl Gpu {
    /// Which of a user's kernels this adapter may leave before they are done, as far as their text says how often their loops turn. (The
    /// kernels of lodlab stay below what any adapter is known to take.)
    pub fn warn_of_loops(&self, plan: &Plan) -> Vec<String> {
        let Some(most) = self.summary.loop_turns else { return Vec::new() };
        let runs = plan.steps.iter().filter_map(|step| step.run()).filter(|run| !run.kernel.trusted);
        let mut warnings: Vec<String> = Vec::new();
        for run in runs {
            let parameter = |name: &str| run.params.iter().find(|(known, _)| known == name)?.1.whole();
            let turns = run.kernel.turns(&run.entry, parameter);
            let warning = format!(
                "the loops of `{}` ({}) turn up to {turns} times, and this adapter ends the loops of a thread after {most} turns in all, in silence",
                run.entry, run.kernel.name
            );
            if turns > most.into() && !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
        warnings
    }
}
