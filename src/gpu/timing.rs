//! What a submission costs, and whether an adapter's timestamps can be believed.
//!
//! Some software adapters stamp the moment a command is recorded, not the moment it is done: their kernels seem
//! to take microseconds. A kernel whose length is known from the clock shows it.

use std::time::Instant;

use super::{Gpu, GpuError};

const KERNEL: &str = "
@group(0) @binding(0) var<storage, read_write> sink: array<u32>;
override TURNS: u32 = 1u;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    var state = id.x;
    for (var turn = 0u; turn < TURNS; turn++) {
        state = state * 747796405u + 2891336453u;
        state ^= state >> 13u;
    }
    sink[id.x] = state;
}
";

const GROUPS: u32 = 256;
/// Long enough that a submission's own cost does not count.
const LONG_ENOUGH_MS: f64 = 8.0;
const MOST_TURNS: f64 = 4e6;

/// Passes of equal length in one submission; each has to have its share of the time.
const PASSES: u32 = 3;

/// Median of a few submissions with nothing in them.
pub fn empty_submission_ms(gpu: &Gpu) -> Result<f64, GpuError> {
    let mut samples = Vec::new();
    for _ in 0..9 {
        let start = Instant::now();
        let encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        gpu.wait_for(&gpu.queue.submit([encoder.finish()]))?;
        samples.push(start.elapsed().as_secs_f64() * 1e3);
    }
    samples.sort_by(f64::total_cmp);
    Ok(samples[samples.len() / 2])
}

/// Runs ever longer kernels until they take long enough on the clock, and compares each with its stamps.
pub fn stamps_agree_with_clock(gpu: &Gpu) -> Result<bool, GpuError> {
    if !gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
        return Ok(false);
    }
    let mut turns = 1e3;
    loop {
        let (clock_ms, passes_ms) = gpu.scoped("the timestamp check", || measure(gpu, turns))??;
        if clock_ms >= LONG_ENOUGH_MS || turns >= MOST_TURNS {
            let share = clock_ms / f64::from(PASSES);
            return Ok(passes_ms.iter().all(|ms| (0.5 * share..1.5 * share).contains(ms)));
        }
        turns *= (1.5 * LONG_ENOUGH_MS / clock_ms.max(0.1)).clamp(2.0, 64.0);
    }
}

/// Milliseconds by the clock for all passes, and by the stamps for each.
fn measure(gpu: &Gpu, turns: f64) -> Result<(f64, Vec<f64>), GpuError> {
    let device = &gpu.device;
    let buffer = |size, usage| {
        device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    };
    use wgpu::BufferUsages as Usage;
    let sink = buffer(u64::from(GROUPS) * 64 * 4, Usage::STORAGE);
    let bytes = u64::from(PASSES) * 16;
    let resolved = buffer(bytes, Usage::QUERY_RESOLVE | Usage::COPY_SRC);
    let readable = buffer(bytes, Usage::MAP_READ | Usage::COPY_DST);
    let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
        label: None,
        ty: wgpu::QueryType::Timestamp,
        count: 2 * PASSES,
    });
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(KERNEL.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions { constants: &[("TURNS", turns)], ..Default::default() },
        cache: None,
    });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: sink.as_entire_binding() }],
    });
    let mut clock_ms = 0.0;
    // the first run also compiles
    for _ in 0..2 {
        let start = Instant::now();
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for pass in 0..PASSES {
            let timestamp_writes = wgpu::ComputePassTimestampWrites {
                query_set: &queries,
                beginning_of_pass_write_index: Some(2 * pass),
                end_of_pass_write_index: Some(2 * pass + 1),
            };
            let descriptor = wgpu::ComputePassDescriptor { label: None, timestamp_writes: Some(timestamp_writes) };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(GROUPS, 1, 1);
        }
        encoder.resolve_query_set(&queries, 0..2 * PASSES, &resolved, 0);
        encoder.copy_buffer_to_buffer(&resolved, 0, &readable, 0, bytes);
        gpu.wait_for(&gpu.queue.submit([encoder.finish()]))?;
        clock_ms = start.elapsed().as_secs_f64() * 1e3;
    }
    readable.map_async(wgpu::MapMode::Read, .., |_| {});
    gpu.wait()?;
    let bytes = readable.get_mapped_range(..).map_err(|error| GpuError::Lost(error.to_string()))?.to_vec();
    let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&bytes);
    let tick_ms = f64::from(gpu.queue.get_timestamp_period()) / 1e6;
    let passes_ms = ticks.chunks_exact(2).map(|pass| pass[1].saturating_sub(pass[0]) as f64 * tick_ms);
    Ok((clock_ms, passes_ms.collect()))
}
