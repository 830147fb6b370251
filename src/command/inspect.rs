//! `lodlab inspect`

use lodlab::experiment::diagnostic::Diagnostic;
#[cfg(feature = "inspector")]
use lodlab::gpu::Gpu;

use crate::arguments::Inspect;

#[cfg(not(feature = "inspector"))]
pub fn inspect(_wanted: Inspect) -> Result<(), Diagnostic> {
    Err(Diagnostic::input("this lodlab was built without the inspector")
        .help("`scripts/inspect` builds it with, or `cargo build --release --features inspector`"))
}

#[cfg(feature = "inspector")]
pub fn inspect(wanted: Inspect) -> Result<(), Diagnostic> {
    use lodlab::inspector::{Shot, window};
    lodlab::kernel::read_from_checkout();
    let gpu = Gpu::open(wanted.adapter.as_deref())?;
    let shot = Shot {
        file: wanted.file,
        out: wanted.screenshot.clone().unwrap_or_default(),
        set: wanted.set,
        chain: wanted.chain,
        buffers: wanted.buffer,
        after: wanted.after,
        frame: wanted.frame,
        form: wanted.look,
        range: wanted.range,
        level: wanted.level,
        against: wanted.against,
        only_views: wanted.only_views,
        results: wanted.results,
        size: wanted.size,
    };
    match wanted.screenshot {
        Some(out) => {
            shot.take(&gpu)?;
            say!("wrote {}", out.display());
            Ok(())
        }
        None => window(&gpu, &shot),
    }
}
