//! Memory: where the buffers and images of a plan live.

use std::collections::BTreeMap;

use super::{Gpu, GpuError};
use crate::kernel::Elem;
use crate::plan::{BufferId, Plan, Storage};

/// The format of a render target with these elements.
pub fn colour(elem: Elem) -> wgpu::TextureFormat {
    match elem {
        Elem::Vec2U32 => wgpu::TextureFormat::Rg32Uint,
        _ => wgpu::TextureFormat::R32Uint,
    }
}

pub const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Where a buffer of the plan lives.
#[derive(Clone)]
pub enum Place {
    Buffer(wgpu::Buffer),
    Target {
        texture: wgpu::Texture,
        view: wgpu::TextureView,
        depth: wgpu::TextureView,
    },
    /// The terrain, in the forms its kernels bind it.
    Input {
        array: Option<wgpu::Buffer>,
        image: Option<(wgpu::Texture, wgpu::TextureView)>,
    },
}

impl Place {
    pub fn array(&self) -> Option<&wgpu::Buffer> {
        match self {
            Place::Buffer(buffer) => Some(buffer),
            Place::Input { array, .. } => array.as_ref(),
            Place::Target { .. } => None,
        }
    }

    pub fn image(&self) -> Option<&wgpu::TextureView> {
        match self {
            Place::Target { view, .. } => Some(view),
            Place::Input { image, .. } => image.as_ref().map(|(_, view)| view),
            Place::Buffer(_) => None,
        }
    }

    /// Whether it has each form in which another plan binds it. Only an input has more than one.
    pub fn binds_as(&self, (is_array, is_image): (bool, bool)) -> bool {
        match self {
            Place::Input { array, image } => (array.is_some() || !is_array) && (image.is_some() || !is_image),
            Place::Buffer(_) | Place::Target { .. } => true,
        }
    }
}

/// Makes the buffers and images of a plan, but for those that are there already.
pub fn make_places(
    gpu: &Gpu,
    plan: &Plan,
    mut known: BTreeMap<BufferId, Place>,
) -> Result<Vec<Option<Place>>, GpuError> {
    use wgpu::BufferUsages as Usage;
    let usage = Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST | Usage::INDIRECT;
    let slots =
        plan.slots.iter().enumerate().map(|(at, &bytes)| make_buffer(gpu, &format!("block {at}"), bytes, usage));
    let slots: Vec<wgpu::Buffer> = slots.collect::<Result<_, _>>()?;
    let place = |(at, buffer): (usize, &crate::plan::Buffer)| match (buffer.lifetime, buffer.storage, buffer.slot) {
        (None, _, _) => Ok(None),
        _ if known.contains_key(&BufferId(at)) => Ok(known.remove(&BufferId(at))),
        (_, Storage::Input, _) => {
            let (is_array, is_image) = plan.bound_as(BufferId(at));
            let array = is_array.then(|| make_buffer(gpu, &buffer.name, buffer.bytes(), usage)).transpose()?;
            let image = is_image.then(|| make_image(gpu, &buffer.name, buffer.dims[1], buffer.dims[0])).transpose()?;
            Ok(Some(Place::Input { array, image }))
        }
        (_, Storage::Target, _) => make_target(gpu, buffer).map(Some),
        (_, _, Some(slot)) => Ok(Some(Place::Buffer(slots[slot].clone()))),
        _ => make_buffer(gpu, &buffer.name, buffer.bytes(), usage).map(Place::Buffer).map(Some),
    };
    plan.buffers.iter().enumerate().map(place).collect()
}

/// (A multiple of 16 bytes: an array of scalars can be bound as one of four at once.)
pub fn make_buffer(gpu: &Gpu, name: &str, bytes: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, GpuError> {
    let descriptor = wgpu::BufferDescriptor {
        label: Some(name),
        size: bytes.max(16).next_multiple_of(16),
        usage,
        mapped_at_creation: false,
    };
    gpu.scoped(&format!("the buffer `{name}`"), || gpu.device.create_buffer(&descriptor))
}

pub fn make_texture(
    gpu: &Gpu,
    name: &str,
    (width, height): (u32, u32),
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(name),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

fn make_image(gpu: &Gpu, name: &str, width: u32, height: u32) -> Result<(wgpu::Texture, wgpu::TextureView), GpuError> {
    use wgpu::TextureUsages as Usage;
    gpu.scoped(&format!("the image `{name}`"), || {
        let texture = make_texture(
            gpu,
            name,
            (width, height),
            wgpu::TextureFormat::R32Float,
            Usage::TEXTURE_BINDING | Usage::COPY_DST,
        );
        let view = texture.create_view(&Default::default());
        (texture, view)
    })
}

fn make_target(gpu: &Gpu, buffer: &crate::plan::Buffer) -> Result<Place, GpuError> {
    use wgpu::TextureUsages as Usage;
    let (name, size) = (&buffer.name, (buffer.dims[1], buffer.dims[0]));
    let texture = |format, usage| make_texture(gpu, name, size, format, usage);
    gpu.scoped(&format!("the render target `{name}`"), || {
        let colour = texture(colour(buffer.elem), Usage::RENDER_ATTACHMENT | Usage::TEXTURE_BINDING | Usage::COPY_SRC);
        let depth = texture(DEPTH, Usage::RENDER_ATTACHMENT);
        Place::Target {
            view: colour.create_view(&Default::default()),
            depth: depth.create_view(&Default::default()),
            texture: colour,
        }
    })
}

pub fn upload(gpu: &Gpu, place: &Place, bytes: &[u8]) {
    let Place::Input { array, image } = place else { return };
    if let Some(array) = array {
        gpu.queue.write_buffer(array, 0, bytes);
    }
    if let Some((texture, _)) = image {
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * texture.width()), rows_per_image: None };
        gpu.queue.write_texture(texture.as_image_copy(), bytes, layout, texture.size());
    }
}
