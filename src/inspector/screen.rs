//! Where canvases meet the window: the one file of the inspector that knows how egui draws.

use std::sync::Arc;

use eframe::egui_wgpu::{self, ScreenDescriptor};
use egui::mutex::RwLock;

use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::paint::{Canvas, DrawnCanvas, read_texture};
use crate::gpu::{Gpu, GpuError};

/// The renderer of a window, or of a picture without one.
#[derive(Clone)]
pub struct Screen {
    gpu: Arc<Gpu>,
    renderer: Arc<RwLock<egui_wgpu::Renderer>>,
    format: wgpu::TextureFormat,
}

/// A canvas among the shapes of a window, each of its pixels one of the screen's. (egui draws textures as well, by one kernel for all that
/// there is in a window, for which a CPU takes ten times as long.)
#[derive(Clone)]
pub struct Picture(Arc<DrawnCanvas>);

impl Picture {
    /// All of it in a rectangle of whole pixels.
    pub fn filling(&self, rect: egui::Rect) -> egui::Shape {
        egui_wgpu::Callback::new_paint_callback(rect, self.clone()).into()
    }
}

impl egui_wgpu::CallbackTrait for Picture {
    fn paint(
        &self,
        info: egui::PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        _resources: &egui_wgpu::CallbackResources,
    ) {
        // egui's own viewport ends with the window, and all of the picture would be squeezed into what is left
        let [low, high] = [info.viewport.min, info.viewport.max].map(|corner| (corner * info.pixels_per_point).round());
        self.0.draw(pass, low.into(), (high - low).into());
    }
}

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

impl Screen {
    /// The renderer of a window that was opened on the device.
    pub fn of_window(gpu: &Arc<Gpu>, state: &egui_wgpu::RenderState) -> Self {
        Self { gpu: gpu.clone(), renderer: state.renderer.clone(), format: state.target_format }
    }

    /// A renderer for pictures.
    pub fn without_window(gpu: &Arc<Gpu>) -> Self {
        let options = egui_wgpu::RendererOptions::PREDICTABLE;
        let renderer = egui_wgpu::Renderer::new(&gpu.device, FORMAT, options);
        Self { gpu: gpu.clone(), renderer: Arc::new(RwLock::new(renderer)), format: FORMAT }
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

    /// A canvas as what egui can draw.
    pub fn show(&self, canvas: &Canvas) -> Result<Picture, GpuError> {
        self.gpu.drawn(canvas, self.format).map(|drawn| Picture(Arc::new(drawn)))
    }

    /// What a window is cleared to, as its pixels want it.
    pub fn background(&self, visuals: &egui::Visuals) -> [f32; 4] {
        match self.format.is_srgb() {
            true => egui::Rgba::from(visuals.panel_fill).to_array(),
            false => visuals.panel_fill.to_normalized_gamma_f32(),
        }
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

    /// A texture for what egui puts out, as large as its window.
    pub fn target(&self, context: &egui::Context) -> wgpu::Texture {
        let size = (context.content_rect().size() * context.pixels_per_point()).round();
        self.gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("window"),
            size: wgpu::Extent3d { width: size.x as u32, height: size.y as u32, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    }

    /// Draws what egui has put out.
    pub fn draw(&self, context: &egui::Context, output: egui::FullOutput, target: &wgpu::Texture) {
        let gpu = &self.gpu;
        let scale = context.pixels_per_point();
        let screen = ScreenDescriptor { size_in_pixels: [target.width(), target.height()], pixels_per_point: scale };
        let mut renderer = self.renderer.write();
        let shapes = context.tessellate(output.shapes, scale);
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let before = renderer.update_buffers(&gpu.device, &gpu.queue, &mut encoder, &shapes, &screen);
        let [r, g, b, a] = self.background(&context.global_style().visuals).map(f64::from);
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        {
            let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("window"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }),
                        store: wgpu::StoreOp::Store,
                    },
                    depth_slice: None,
                })],
                ..Default::default()
            });
            renderer.render(&mut pass.forget_lifetime(), &shapes, &screen);
        }
        gpu.queue.submit(before.into_iter().chain([encoder.finish()]));
    }

    /// What egui has put out, as a picture of four bytes a pixel.
    pub fn picture(
        &self,
        context: &egui::Context,
        output: egui::FullOutput,
    ) -> Result<([u32; 2], Vec<u8>), Diagnostic> {
        let target = self.target(context);
        self.draw(context, output, &target);
        let pixels = read_texture(&self.gpu, &target).map_err(|error: GpuError| Diagnostic::from(error))?;
        Ok(([target.width(), target.height()], pixels))
    }
}
