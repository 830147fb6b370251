//! Pictures of buffers, painted on the device: nothing comes back to the host to be seen.

use glam::{DVec3, UVec2};

use super::cache::{DrawKey, Pipeline, Topology};
use super::memory::{self, make_buffer};
use super::tool::{Ready, Tool};
use super::{Gpu, GpuError, Held, readback};
use crate::kernel::Value;
use crate::look::scale::Scaled;
use crate::look::{Channel, Colours, Projection};

/// The kernels that show what others have made.
pub const KERNELS: [&str; 4] = ["looks/canvas.wgsl", "looks/image.wgsl", "looks/mesh.wgsl", "looks/statistics.wgsl"];

/// Where the parameters are in their buffer, which holds nothing else.
const PARAMETERS: &[wgpu::DynamicOffset] = &[0];

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// A row of a texture that is copied to begins at a multiple of so many pixels.
const PITCH: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT / 4;

/// What is painted on: eight bits a channel, which every adapter shows.
pub struct Canvas {
    pub size: (u32, u32),
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    depth: wgpu::TextureView,
    pixels: wgpu::Buffer,
}

/// A canvas that is drawn among other things.
pub struct DrawnCanvas {
    ready: Ready,
    /// Pixels of a viewport's side at most.
    most: f32,
}

impl DrawnCanvas {
    /// Fills a rectangle, from its top left corner, in a pass that has no depth. It may reach beyond what the pass draws on.
    pub fn draw(&self, pass: &mut wgpu::RenderPass, corner: [f32; 2], size: [f32; 2]) {
        // what the device takes for a viewport
        let far = 2.0 * self.most;
        let is_taken = |(at, side): (f32, f32)| (1.0..=self.most).contains(&side) && at >= -far && at + side < far;
        let Pipeline::Render(pipeline) = &self.ready.pipeline else { return };
        if !corner.into_iter().zip(size).all(is_taken) {
            return;
        }
        pass.set_viewport(corner[0], corner[1], size[0], size[1], 0.0, 1.0);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &self.ready.group, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// Which elements of a buffer are shown, as a rectangle of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Row and column of its first element.
    pub row: u32,
    pub columns: u32,
    pub rows: u32,
}

impl Part {
    /// All elements of a buffer.
    pub fn all(held: &Held) -> Self {
        let (columns, rows) = held.size();
        Self { row: 0, columns, rows }
    }
}

/// How values become colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tones {
    pub colours: Colours,
    pub scaled: Scaled,
    /// Larger values are marked.
    pub mark_above: Option<f32>,
}

/// A picture of elements.
pub struct Image<'a> {
    pub held: &'a Held,
    pub channel: &'a Channel,
    /// What is taken away from it, of the same size.
    pub minus: Option<(&'a Held, &'a Channel)>,
    pub part: Part,
    /// Where the canvas' top left corner is, in elements, and elements a pixel.
    pub origin: [f32; 2],
    pub step: [f32; 2],
    pub tones: Tones,
}

impl Image<'_> {
    /// The first pixel of a canvas that may show an element, and columns and rows of such pixels; rounded, there may be some more.
    fn pixels(&self, size: (u32, u32)) -> ([u32; 2], [u32; 2]) {
        let of = |axis: usize, elements: u32, pixels: u32| {
            let pixel = |element: f32| (element - self.origin[axis]) / self.step[axis];
            let low = (pixel(0.0).floor() - 1.0).max(0.0) as u32;
            let high = ((pixel(elements as f32).ceil() + 1.0).max(0.0) as u32).min(pixels);
            (low, high.saturating_sub(low))
        };
        let (left, columns) = of(0, self.part.columns, size.0);
        let (top, rows) = of(1, self.part.rows, size.1);
        ([left, top], [columns, rows])
    }
}

/// The pixels of a canvas between two corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clip {
    pub low: (u32, u32),
    pub high: (u32, u32),
}

/// What a mesh's points are.
#[derive(Clone, Copy)]
pub enum Points<'a> {
    /// Rows and columns of points of at least two numbers.
    Grid(&'a Held),
    /// Triangles, or blocks of a quadtree, between samples.
    Lattice(&'a Lattice<'a>, &'a Held, Listed),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Listed {
    Triangles,
    Blocks,
}

/// The ground under a list.
pub struct Lattice<'a> {
    pub heights: &'a Held,
    pub size: UVec2,
    pub cell_m: [f32; 2],
    /// The south-west sample at the height 0, relative to what the projection is for.
    pub south_west_m: DVec3,
}

/// What gives a mesh its colour.
#[derive(Clone, Copy)]
pub enum Colouring<'a> {
    One(u32),
    /// A number of each point, triangle or block.
    Points(&'a Held, &'a Channel),
    Cells(&'a Held, &'a Channel),
    /// Values over the square that a grid is over, and where each point is in it.
    Places(&'a Held, &'a Channel, &'a Held),
}

/// A picture of a mesh.
pub struct MeshImage<'a> {
    pub points: Points<'a>,
    pub projection: Projection,
    pub is_filled: bool,
    pub colouring: Colouring<'a>,
    pub tones: Tones,
    /// What is painted later is seen only where it is lifted more, or nearer.
    pub lift: f32,
    /// What is under it shows through.
    pub is_sheer: bool,
}

impl Gpu {
    pub fn canvas(&self, size: (u32, u32)) -> Result<Canvas, GpuError> {
        use wgpu::{BufferUsages, TextureUsages as Usage};
        let most = self.limits.max_texture_dimension_2d;
        let size = (size.0.clamp(1, most), size.1.clamp(1, most));
        let pixels = u64::from(size.0.next_multiple_of(PITCH)) * u64::from(size.1) * 4;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let pixels = make_buffer(self, "pixels of a look", pixels, usage)?;
        self.scoped("the picture of a look", || {
            let make = |format, usage| memory::make_texture(self, "look", size, format, usage);
            let usage = Usage::RENDER_ATTACHMENT | Usage::TEXTURE_BINDING | Usage::COPY_DST | Usage::COPY_SRC;
            let texture = make(FORMAT, usage);
            let depth = make(memory::DEPTH, Usage::RENDER_ATTACHMENT).create_view(&Default::default());
            let view = texture.create_view(&Default::default());
            Canvas { size, texture, view, depth, pixels }
        })
    }

    /// A canvas ready to be drawn into a window whose pixels have this format.
    pub fn drawn(&self, canvas: &Canvas, format: wgpu::TextureFormat) -> Result<DrawnCanvas, GpuError> {
        let tool = Tool {
            kernel: "looks/canvas.wgsl",
            entry: "cover",
            draw: Some(DrawKey {
                fragment: "show".into(),
                topology: Topology::Triangles,
                target: format,
                has_depth: false,
            }),
            constants: &[("IN_LIGHT", f64::from(format.is_srgb()))],
            buffers: &[],
            images: &[("canvas", &canvas.view)],
            params: &[],
        };
        Ok(DrawnCanvas { ready: self.ready(&tool)?, most: self.limits.max_texture_dimension_2d as f32 })
    }

    /// Paints elements over the whole canvas.
    pub fn paint_image(&self, canvas: &Canvas, image: &Image) -> Result<(), GpuError> {
        let colours = self.table(image.tones.colours)?;
        let (minus, minus_channel) = image.minus.unwrap_or((image.held, image.channel));
        let pitch = canvas.size.0.next_multiple_of(PITCH);
        let (corner, threads) = image.pixels(canvas.size);
        let mut params = tones_params(image.tones);
        params.extend(format_params("format", image.channel));
        params.extend(format_params("minus", minus_channel));
        params.extend([
            ("size", Value::from([canvas.size.0, canvas.size.1])),
            ("pitch", pitch.into()),
            ("corner", corner.into()),
            ("first", (image.part.row * image.held.stride).into()),
            ("stride", image.held.stride.into()),
            ("minus_first", (image.part.row * minus.stride).into()),
            ("minus_stride", minus.stride.into()),
            ("extent", [image.part.columns, image.part.rows].into()),
            ("origin", image.origin.into()),
            ("step", image.step.into()),
            ("mark_above", image.tones.mark_above.unwrap_or(f32::MAX).into()),
            ("is_marked", u32::from(image.tones.mark_above.is_some()).into()),
        ]);
        let tool = Tool {
            kernel: "looks/image.wgsl",
            entry: "main",
            draw: None,
            constants: &constants(image.channel, image.minus.map(|(_, channel)| channel), image.tones.scaled.scale),
            buffers: &[
                ("data", &image.held.buffer),
                ("other", &minus.buffer),
                ("colours", &colours),
                ("painted", &canvas.pixels),
            ],
            images: &[],
            params: &params,
        };
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        // where there is no element, nothing is painted
        encoder.clear_buffer(&canvas.pixels, 0, None);
        self.encode_compute(&mut encoder, &tool, threads)?;
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * pitch), rows_per_image: None };
        let painted = wgpu::TexelCopyBufferInfo { buffer: &canvas.pixels, layout };
        encoder.copy_buffer_to_texture(painted, canvas.texture.as_image_copy(), canvas.texture.size());
        self.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Paints meshes over what is on the canvas, or over a colour.
    pub fn paint_meshes(
        &self,
        canvas: &Canvas,
        over: Option<[f64; 3]>,
        clip: Option<Clip>,
        meshes: &[MeshImage],
    ) -> Result<(), GpuError> {
        let ready: Vec<_> = meshes.iter().map(|mesh| self.ready_mesh(mesh)).collect::<Result<_, _>>()?;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let load = match over {
            Some([r, g, b]) => wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }),
            None => wgpu::LoadOp::Load,
        };
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("look"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &canvas.view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
                })],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &canvas.depth,
                    depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
                    stencil_ops: None,
                }),
                ..Default::default()
            });
            if let Some(Clip { low, high }) = clip {
                let [low, high] = [low, high].map(|at| (at.0.min(canvas.size.0), at.1.min(canvas.size.1)));
                pass.set_scissor_rect(low.0, low.1, high.0.saturating_sub(low.0), high.1.saturating_sub(low.1));
            }
            for (ready, vertices) in &ready {
                let Pipeline::Render(pipeline) = &ready.pipeline else { continue };
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, &ready.group, PARAMETERS);
                pass.draw(0..*vertices, 0..1);
            }
        }
        self.queue.submit([encoder.finish()]);
        Ok(())
    }

    fn ready_mesh(&self, mesh: &MeshImage) -> Result<(Ready, u32), GpuError> {
        let colours = self.table(mesh.tones.colours)?;
        let nothing = make_buffer(self, "nothing", 16, wgpu::BufferUsages::STORAGE)?;
        let points = match mesh.points {
            Points::Grid(held) | Points::Lattice(_, held, _) => held,
        };
        let (lattice, size) = match mesh.points {
            Points::Grid(held) => (None, held.size()),
            Points::Lattice(lattice, ..) => (Some(lattice), (lattice.size.x, lattice.size.y)),
        };
        let plain = Channel {
            name: String::new(),
            kind: crate::look::channel::Kind::Float,
            words: 1,
            word: 0,
            shift: 0,
            mask: u32::MAX,
            is_missing_below_zero: false,
        };
        let (from, values, channel, places): (u32, _, _, _) = match mesh.colouring {
            Colouring::One(_) => (0, None, &plain, None),
            Colouring::Points(held, channel) => (1, Some(held), channel, None),
            Colouring::Places(held, channel, places) => (2, Some(held), channel, Some(places)),
            Colouring::Cells(held, channel) => (3, Some(held), channel, None),
        };
        let kind: u32 = match mesh.points {
            Points::Grid(_) => 0,
            Points::Lattice(_, _, Listed::Triangles) => 1,
            Points::Lattice(_, _, Listed::Blocks) => 2,
        };
        let corner = lattice.map_or(DVec3::ZERO, |lattice| lattice.south_west_m).as_vec3();
        let values_size = values.map_or((1, 1), Held::size);
        let rows = ["clip_x", "clip_y", "clip_z", "clip_w"];
        let rows = rows.into_iter().zip(mesh.projection.0).map(|(name, row)| (name, row.as_vec4().to_array().into()));
        let mut params = tones_params(mesh.tones);
        params.extend(format_params("format", channel));
        params.extend(rows);
        params.extend([
            ("south_west", Value::from(corner.to_array())),
            ("size", [size.0, size.1].into()),
            ("cell_m", lattice.map_or([1.0; 2], |lattice| lattice.cell_m).into()),
            ("values", [values_size.0, values_size.1].into()),
            ("components", points.about.elem.components().into()),
            ("lift", mesh.lift.into()),
            ("colour", if let Colouring::One(colour) = mesh.colouring { colour } else { 0 }.into()),
        ]);
        let constants = [
            ("MESH", f64::from(kind)),
            ("VALUE_FROM", f64::from(from)),
            ("IS_FILLED", f64::from(mesh.is_filled)),
            ("IS_SHEER", f64::from(mesh.is_sheer)),
        ]
        .into_iter()
        .chain(constants(channel, None, mesh.tones.scaled.scale));
        let topology = if mesh.is_filled { Topology::Triangles } else { Topology::Lines };
        let tool = Tool {
            kernel: "looks/mesh.wgsl",
            entry: "draw",
            draw: Some(DrawKey { fragment: "paint".into(), topology, target: FORMAT, has_depth: true }),
            constants: &constants.collect::<Vec<_>>(),
            buffers: &[
                ("points", &points.buffer),
                ("places", places.map_or(&nothing, |held| &held.buffer)),
                ("data", values.map_or(&nothing, |held| &held.buffer)),
                ("heights", lattice.map_or(&nothing, |lattice| &lattice.heights.buffer)),
                ("colours", &colours),
            ],
            images: &[],
            params: &params,
        };
        Ok((self.ready(&tool)?, vertices(mesh)))
    }

    fn table(&self, colours: Colours) -> Result<wgpu::Buffer, GpuError> {
        let table = colours.table();
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let buffer = make_buffer(self, "colours", 4 * table.len() as u64, usage)?;
        self.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(&table));
        Ok(buffer)
    }

    pub(super) fn encode_compute(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        tool: &Tool,
        threads: [u32; 2],
    ) -> Result<(), GpuError> {
        let ready = self.ready(tool)?;
        let Pipeline::Compute(pipeline) = &ready.pipeline else {
            return Err(GpuError::Plan(format!("`{}` has no compute pipeline", tool.kernel)));
        };
        let [x, y, _] = ready.workgroup_size;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &ready.group, PARAMETERS);
        pass.dispatch_workgroups(threads[0].div_ceil(x), threads[1].div_ceil(y), 1);
        Ok(())
    }
}

/// Vertices of a draw: three a triangle, two a line.
fn vertices(mesh: &MeshImage) -> u32 {
    let count = |primitives: u64, corners: u64| u32::try_from(primitives * corners).unwrap_or(u32::MAX / 6 * 6);
    match (mesh.points, mesh.is_filled) {
        (Points::Grid(held), is_filled) => {
            let (columns, rows) = held.size();
            let (columns, rows) = (u64::from(columns), u64::from(rows));
            let cells = columns.saturating_sub(1) * rows.saturating_sub(1);
            if is_filled { count(2 * cells, 3) } else { count(3 * columns * rows, 2) }
        }
        (Points::Lattice(_, held, Listed::Triangles), true) => count(held.length, 3),
        (Points::Lattice(_, held, Listed::Triangles), false) => count(3 * held.length, 2),
        (Points::Lattice(_, held, Listed::Blocks), true) => count(2 * held.length, 3),
        (Points::Lattice(_, held, Listed::Blocks), false) => count(4 * held.length, 2),
    }
}

/// A channel as the structure `Format` of `kernels/lib/look.wgsl`.
pub(super) fn format_params(of: &'static str, channel: &Channel) -> [(&'static str, Value); 5] {
    let names = match of {
        "minus" => ["minus.words", "minus.word", "minus.shift", "minus.mask", "minus.is_missing_below_zero"],
        _ => ["format.words", "format.word", "format.shift", "format.mask", "format.is_missing_below_zero"],
    };
    let values = [channel.words, channel.word, channel.shift, channel.mask, channel.is_missing_below_zero.into()];
    std::array::from_fn(|at| (names[at], values[at].into()))
}

/// What is the same for all elements: kinds of words, the scale, and whether something is taken away.
pub(super) fn constants(
    channel: &Channel,
    minus: Option<&Channel>,
    scale: crate::look::Scale,
) -> [(&'static str, f64); 4] {
    let kind = |channel: &Channel| f64::from(channel.kind as u32);
    [
        ("KIND", kind(channel)),
        ("MINUS_KIND", kind(minus.unwrap_or(channel))),
        ("SCALE", f64::from(scale as u32)),
        ("IS_DIFFERENCE", f64::from(minus.is_some())),
    ]
}

pub(super) fn tones_params(tones: Tones) -> Vec<(&'static str, Value)> {
    let Scaled { low, high, .. } = tones.scaled;
    let (low_scaled, per_unit) = tones.scaled.scaled_low_and_per_unit();
    vec![
        ("scale.low", low.into()),
        ("scale.high", high.into()),
        ("scale.linear_below", tones.scaled.linear_below().into()),
        ("scale.low_scaled", low_scaled.into()),
        ("scale.per_unit", per_unit.into()),
    ]
}

impl Canvas {
    /// Four bytes a pixel, row by row.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<u8>, GpuError> {
        read_texture(gpu, &self.texture)
    }
}

/// The bytes of a picture of four bytes a pixel.
pub fn read_texture(gpu: &Gpu, texture: &wgpu::Texture) -> Result<Vec<u8>, GpuError> {
    let (width, height) = (texture.width(), texture.height());
    let row = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let staging = make_buffer(gpu, "picture", u64::from(row) * u64::from(height), usage)?;
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
    let target = wgpu::TexelCopyBufferInfo { buffer: &staging, layout };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), target, texture.size());
    let bytes = readback::map(gpu, &staging, &gpu.queue.submit([encoder.finish()]))?;
    let rows = bytes.chunks_exact(row as usize).take(height as usize);
    Ok(rows.flat_map(|bytes| &bytes[..4 * width as usize]).copied().collect())
}
