//! Where canvases meet the window: the one file of the inspector that knows how egui draws.

use std::sync::Arc;

use eframe::egui_wgpu::{self, ScreenDescriptor};
use egui::mutex::RwLock;

use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::paint::{Canvas, read_texture};
use crate::gpu::{Gpu, GpuError};

/// The renderer of a window, or of a picture without one.
#[derive(Clone)]
pub struct Screen {
    gpu: Arc<Gpu>,
    renderer: Arc<RwLock<egui_wgpu::Renderer>>,
}

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

impl Screen {
    /// The renderer of a window that was opened on the device.
    pub fn of_window(gpu: &Arc<Gpu>, state: &egui_wgpu::RenderState) -> Self {
        Self { gpu: gpu.clone(), renderer: state.renderer.clone() }
    }

    /// A renderer for pictures.
    pub fn without_window(gpu: &Arc<Gpu>) -> Self {
        let options = egui_wgpu::RendererOptions::PREDICTABLE;
        let renderer = egui_wgpu::Renderer::new(&gpu.device, FORMAT, options);
        Self { gpu: gpu.clone(), renderer: Arc::new(RwLock::new(renderer)) }
    }

    /// Options for a window on a device that is open.
    pub fn options(gpu: &Gpu) -> eframe::NativeOptions {
        let (instance, adapter) = gpu.instance_and_adapter();
        let setup = egui_wgpu::WgpuSetup::Existing(egui_wgpu::WgpuSetupExisting {
            instance,
            adapter,
            device: gpu.device.clone(),
            queue: gpu.queue.clone(),
        });
        let wgpu_options = egui_wgpu::WgpuConfiguration { wgpu_setup: setup, ..Default::default() };
        let viewport = egui::ViewportBuilder::default()
            .with_title("lodlab")
            .with_app_id("lodlab")
            .with_inner_size([1440.0, 900.0])
            .with_min_inner_size([320.0, 200.0]);
        eframe::NativeOptions { viewport, wgpu_options, renderer: eframe::Renderer::Wgpu, ..Default::default() }
    }

    /// A canvas as a texture, each of its pixels one of the screen's.
    pub fn show(&self, canvas: &Canvas) -> egui::TextureId {
        self.renderer.write().register_native_texture(&self.gpu.device, canvas.view(), wgpu::FilterMode::Nearest)
    }

    pub fn forget(&self, texture: egui::TextureId) {
        self.renderer.write().free_texture(&texture);
    }

    /// Takes in textures that egui has made or dropped.
    pub fn take(&self, delta: &mut egui::TexturesDelta) {
        let mut renderer = self.renderer.write();
        for (id, images) in delta.set.drain() {
            for image in images {
                renderer.update_texture(&self.gpu.device, &self.gpu.queue, id, &image);
            }
        }
        for id in delta.free.drain() {
            renderer.free_texture(&id);
        }
    }

    /// What egui has put out, as a picture of four bytes a pixel.
    pub fn picture(
        &self,
        context: &egui::Context,
        output: egui::FullOutput,
    ) -> Result<([u32; 2], Vec<u8>), Diagnostic> {
        let gpu = &self.gpu;
        let scale = context.pixels_per_point();
        let size = (context.content_rect().size() * scale).round();
        let screen = ScreenDescriptor { size_in_pixels: [size.x as u32, size.y as u32], pixels_per_point: scale };
        let mut renderer = self.renderer.write();
        let shapes = context.tessellate(output.shapes, scale);
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let before = renderer.update_buffers(&gpu.device, &gpu.queue, &mut encoder, &shapes, &screen);
        let [width, height] = screen.size_in_pixels;
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("screenshot"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        {
            let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("screenshot"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                    depth_slice: None,
                })],
                ..Default::default()
            });
            renderer.render(&mut pass.forget_lifetime(), &shapes, &screen);
        }
        gpu.queue.submit(before.into_iter().chain([encoder.finish()]));
        let pixels = read_texture(gpu, &texture).map_err(|error: GpuError| Diagnostic::from(error))?;
        Ok((screen.size_in_pixels, pixels))
    }
}
