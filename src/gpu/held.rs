//! Buffers that somebody looks at after a frame: where they are on the device, and what is in them.

use super::execute::Executor;
use super::memory::{Place, make_buffer};
use super::{Gpu, GpuError, readback};
use crate::plan::{Buffer, BufferId};

/// A buffer on the device, and how to read it. It stays what it is for as long as it is held, but a frame that runs changes what is in it.
#[derive(Clone, Debug)]
pub struct Held {
    pub(super) buffer: wgpu::Buffer,
    /// Its declaration in the plan.
    pub about: Buffer,
    /// Elements from one row to the next.
    pub stride: u32,
    /// Elements that count: of a list, those that it has.
    pub length: u64,
}

impl Held {
    /// A buffer that comes from the host: what was computed in f64, or a picture.
    pub fn upload(gpu: &Gpu, about: Buffer, bytes: &[u8]) -> Result<Self, GpuError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let buffer = make_buffer(gpu, &about.name, bytes.len() as u64, usage)?;
        let whole = bytes.len() / 4 * 4;
        gpu.queue.write_buffer(&buffer, 0, &bytes[..whole]);
        let stride = about.dims.last().copied().unwrap_or(1);
        let length = about.elements();
        Ok(Self { buffer, about, stride, length })
    }

    /// Columns and rows of its elements; a list has one row.
    pub fn size(&self) -> (u32, u32) {
        match self.about.dims[..] {
            [rows, columns] => (columns, rows),
            _ => (self.length.min(self.about.elements()) as u32, 1),
        }
    }

    /// The bytes of some elements of a row, as they are now.
    pub fn read(&self, gpu: &Gpu, (column, row): (u32, u32), elements: u32) -> Result<Vec<u8>, GpuError> {
        let each = self.about.elem.bytes();
        let start = (u64::from(row) * u64::from(self.stride) + u64::from(column)) * each;
        let bytes = u64::from(elements) * each;
        let end = (start + bytes).min(self.buffer.size());
        if start >= end {
            return Ok(Vec::new());
        }
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging = make_buffer(gpu, &self.about.name, end - start, usage)?;
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&self.buffer, start, &staging, 0, end - start);
        let mut read = readback::map(gpu, &staging, &gpu.queue.submit([encoder.finish()]))?;
        read.truncate((end - start) as usize);
        Ok(read)
    }

    /// All elements that count, row by row without what stands between rows.
    pub fn read_all(&self, gpu: &Gpu) -> Result<Vec<u8>, GpuError> {
        let (columns, rows) = self.size();
        let each = self.about.elem.bytes() as usize;
        if rows == 0 || columns == 0 {
            return Ok(Vec::new());
        }
        let all = self.read(gpu, (0, 0), self.stride * (rows - 1) + columns)?;
        let rows = all.chunks(self.stride.max(1) as usize * each);
        Ok(rows.flat_map(|row| &row[..row.len().min(columns as usize * each)]).copied().collect())
    }
}

impl Executor {
    /// A buffer to look at after a frame. A render target is copied out of its image.
    pub fn held(&self, id: BufferId) -> Result<Held, GpuError> {
        let about = self.plan.buffer(id).clone();
        let place = self.memory.place(&self.plan, id, self.half());
        let (buffer, stride) = match (place, place.and_then(Place::array)) {
            (_, Some(array)) => (array.clone(), about.dims.last().copied().unwrap_or(1)),
            (Some(Place::Target { texture, .. }), None) => self.copied(texture, &about)?,
            _ => return Err(GpuError::Plan(format!("the buffer `{}` is looked at and has no memory", about.name))),
        };
        let length = match self.plan.products.length_of(id).filter(|length| self.plan.lives(length.count)) {
            None => about.elements(),
            Some(length) => {
                let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&self.read(length.count)?);
                let counted = counts.get(length.at).copied().unwrap_or(0) / length.per_element;
                about.elements().min(counted.into())
            }
        };
        Ok(Held { buffer, about, stride, length })
    }

    fn copied(&self, texture: &wgpu::Texture, about: &Buffer) -> Result<(wgpu::Buffer, u32), GpuError> {
        let each = about.elem.bytes() as u32;
        let row = (texture.width() * each).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let buffer = make_buffer(&self.gpu, &about.name, u64::from(row) * u64::from(texture.height()), usage)?;
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
        let target = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), target, texture.size());
        self.gpu.queue.submit([encoder.finish()]);
        Ok((buffer, row / each))
    }

    /// Puts other contents into a buffer that a step has made.
    pub fn replace(&mut self, id: BufferId, bytes: &[u8]) -> Result<(), GpuError> {
        self.is_altered = true;
        let place = self.memory.place(&self.plan, id, self.half());
        let Some(array) = place.and_then(Place::array) else {
            let name = &self.plan.buffer(id).name;
            return Err(GpuError::Plan(format!("the buffer `{name}` is replaced and has no memory")));
        };
        self.gpu.queue.write_buffer(array, 0, &bytes[..bytes.len() / 4 * 4]);
        Ok(())
    }
}
