//! The canvases of a view, painted again when something about them changes.

use std::sync::Arc;

use crate::gpu::GpuError;
use crate::gpu::paint::Canvas;
use crate::inspector::desk::Desk;
use crate::inspector::screen::Screen;

/// A canvas on the screen, and what was painted on it.
pub struct Painted {
    pub canvas: Arc<Canvas>,
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
        let canvas = Arc::new(desk.gpu.canvas(size)?);
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
