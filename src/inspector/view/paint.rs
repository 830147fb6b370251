//! The canvases of a view, painted again when something about them changes.

use super::super::desk::Desk;
use super::super::screen::Screen;
use crate::gpu::paint::{Canvas, Image, Part, Tones};
use crate::gpu::{GpuError, Held};
use crate::look::Channel;

/// A canvas on the screen, and what was painted on it.
pub struct Painted {
    pub canvas: Canvas,
    pub texture: egui::TextureId,
    screen: Screen,
    key: String,
}

impl Drop for Painted {
    fn drop(&mut self) {
        self.screen.forget(self.texture);
    }
}

/// A canvas of a size, with something painted on it unless it is there already. `key` says what; it is different for anything else.
pub fn painted(
    kept: &mut Option<Painted>,
    desk: &Desk,
    size: (u32, u32),
    key: String,
    paint: impl FnOnce(&Canvas) -> Result<(), GpuError>,
) -> Result<(), GpuError> {
    if kept.as_ref().is_none_or(|kept| kept.canvas.size != size) {
        let canvas = desk.gpu.canvas(size)?;
        let texture = desk.screen.show(&canvas);
        *kept = Some(Painted { canvas, texture, screen: desk.screen.clone(), key: String::new() });
    }
    if let Some(kept) = kept
        && kept.key != key
    {
        paint(&kept.canvas)?;
        kept.key = key;
    }
    Ok(())
}

/// Elements from a corner on, so many a pixel.
pub struct Window {
    pub origin: [f32; 2],
    pub step: [f32; 2],
}

pub fn image<'a>(
    held: &'a Held,
    channel: &'a Channel,
    minus: Option<(&'a Held, &'a Channel)>,
    part: Part,
    window: &Window,
    tones: Tones,
) -> Image<'a> {
    Image { held, channel, minus, part, origin: window.origin, step: window.step, tones }
}
