//! The canvases of a view, painted again when something about them changes.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::gpu::GpuError;
use crate::gpu::paint::Canvas;
use crate::inspector::desk::Desk;
use crate::inspector::screen::Picture;

/// A canvas on the screen, and what was painted on it.
pub struct Painted {
    pub canvas: Arc<Canvas>,
    pub picture: Picture,
    frame: [u64; 2],
    key: String,
    at: Option<Instant>,
}

/// What is painted: a frame, and all else that makes a difference.
pub struct What {
    /// What each side shows.
    pub frame: [u64; 2],
    pub key: String,
    /// Painting it takes a part of what the frame takes.
    pub is_costly: bool,
}

/// While newer frames are on their way, what is costly waits so long until it is painted again: otherwise the frames would come later.
const COSTLY_EVERY: Duration = Duration::from_millis(200);

impl Painted {
    fn can_wait(&self, desk: &Desk, what: &What) -> bool {
        let is_fresh = self.at.is_some_and(|at| at.elapsed() < COSTLY_EVERY);
        what.is_costly && self.key == what.key && is_fresh && desk.worker.is_busy()
    }
}

/// A canvas of a size, with something painted on it unless it is there already.
pub fn painted(
    kept: &mut Option<Painted>,
    desk: &Desk,
    size: (u32, u32),
    what: What,
    paint: impl FnOnce(&Canvas) -> Result<(), GpuError>,
) -> Result<(), GpuError> {
    if kept.as_ref().is_none_or(|kept| kept.canvas.size != size) {
        let canvas = Arc::new(desk.gpu.canvas(size)?);
        let picture = desk.screen.show(&canvas)?;
        *kept = Some(Painted { canvas, picture, frame: [0; 2], key: String::new(), at: None });
    }
    if let Some(kept) = kept
        && (kept.frame != what.frame || kept.key != what.key)
        && !kept.can_wait(desk, &what)
    {
        paint(&kept.canvas)?;
        (kept.frame, kept.key, kept.at) = (what.frame, what.key, Some(Instant::now()));
    }
    Ok(())
}
