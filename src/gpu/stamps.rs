//! Timestamps of steps: two a step, and what they say when the submission is done.

use super::memory::make_buffer;
use super::{Gpu, GpuError, readback};

pub struct Stamps {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
}

impl Stamps {
    /// For so many steps.
    pub fn new(gpu: &Gpu, steps: usize) -> Result<Self, GpuError> {
        let count = 2 * steps as u32;
        let descriptor = wgpu::QuerySetDescriptor { label: None, ty: wgpu::QueryType::Timestamp, count };
        let queries = gpu.scoped("timestamps", || gpu.device.create_query_set(&descriptor))?;
        let bytes = u64::from(count) * 8;
        use wgpu::BufferUsages as Usage;
        Ok(Self {
            queries,
            resolved: make_buffer(gpu, "timestamps", bytes, Usage::QUERY_RESOLVE | Usage::COPY_SRC)?,
            readable: make_buffer(gpu, "timestamps", bytes, Usage::MAP_READ | Usage::COPY_DST)?,
        })
    }

    pub fn of_compute(&self, step: usize) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(2 * step as u32),
            end_of_pass_write_index: Some(2 * step as u32 + 1),
        }
    }

    pub fn of_render(&self, step: usize) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(2 * step as u32),
            end_of_pass_write_index: Some(2 * step as u32 + 1),
        }
    }

    /// To be encoded after the steps.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        let count = (self.resolved.size() / 8) as u32;
        encoder.resolve_query_set(&self.queries, 0..count, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readable, 0, self.resolved.size());
    }

    /// From the first step's beginning to the last step's end, and each step, in milliseconds. Stamps that run backwards, or that claim
    /// more time than passed on the clock, are worth nothing.
    pub fn read(
        &self,
        gpu: &Gpu,
        submission: &wgpu::SubmissionIndex,
        steps: &[usize],
        wall_ms: f64,
    ) -> Result<(Option<f64>, Vec<Option<f64>>), GpuError> {
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&readback::map(gpu, &self.readable, submission)?);
        let tick_ms = f64::from(gpu.queue.get_timestamp_period()) / 1e6;
        let between = |from: u64, to: u64| {
            let ms = to.checked_sub(from)? as f64 * tick_ms;
            (from != 0 && ms <= wall_ms * 1.05).then_some(ms)
        };
        let each = steps.iter().map(|&step| between(ticks[2 * step], ticks[2 * step + 1])).collect();
        let all =
            steps.first().zip(steps.last()).and_then(|(first, last)| between(ticks[2 * first], ticks[2 * last + 1]));
        Ok((all, each))
    }
}
