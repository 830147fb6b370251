//! Buffers back to the host. Not for use inside a frame.

use super::execute::Executor;
use super::memory::{Place, make_buffer};
use super::{Gpu, GpuError};
use crate::plan::BufferId;

impl Executor {
    /// The bytes of a buffer as they are now.
    pub fn read(&self, id: BufferId) -> Result<Vec<u8>, GpuError> {
        let buffer = self.plan.buffer(id);
        let size = buffer.bytes();
        let gpu = &self.gpu;
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let place = self.memory.place(&self.plan, id, self.half());
        let staging = match (place, place.and_then(Place::array)) {
            (_, Some(source)) => {
                let staging = make_buffer(gpu, &buffer.name, size, usage)?;
                encoder.copy_buffer_to_buffer(source, 0, &staging, 0, size);
                staging
            }
            (Some(Place::Target { texture, .. }), None) => {
                let row =
                    (texture.width() * buffer.elem.bytes() as u32).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
                let staging = make_buffer(gpu, &buffer.name, u64::from(row) * u64::from(texture.height()), usage)?;
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
        let mut bytes = map(gpu, &staging, &gpu.queue.submit([encoder.finish()]))?;
        if let Some(Place::Target { texture, .. }) = place {
            let row = texture.width() as usize * buffer.elem.bytes() as usize;
            let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT as usize);
            bytes = bytes.chunks_exact(padded).flat_map(|padded| &padded[..row]).copied().collect();
        }
        // the smallest buffers are made larger than they need
        bytes.truncate(size as usize);
        Ok(bytes)
    }
}

/// The contents of a buffer that a submission has copied to.
pub fn map(gpu: &Gpu, buffer: &wgpu::Buffer, submission: &wgpu::SubmissionIndex) -> Result<Vec<u8>, GpuError> {
    // what map_async says is said again by get_mapped_range
    buffer.map_async(wgpu::MapMode::Read, .., |_| {});
    gpu.wait_for(submission)?;
    let bytes = buffer.get_mapped_range(..).map_err(|error| GpuError::Lost(error.to_string()))?.to_vec();
    buffer.unmap();
    Ok(bytes)
}
