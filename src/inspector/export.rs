//! Files of what is seen.

use std::path::Path;

use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::paint::Canvas;
use crate::gpu::{Gpu, Held};
use crate::report::pictures;
use crate::run::dump;

/// Writes a buffer as `.npy` (with what its numbers are beside it) or `.csv`, by the name of the file.
pub fn export(gpu: &Gpu, held: &Held, path: &Path) -> Result<String, Diagnostic> {
    let mut bytes = held.read_all(gpu)?;
    let whole = held.length * held.about.elem.bytes();
    bytes.truncate(usize::try_from(whole).unwrap_or(usize::MAX));
    match path.extension().and_then(|kind| kind.to_str()) {
        Some("csv") => write(path, &dump::csv(&held.about, &bytes)?)?,
        Some("npy") => {
            write(path, &dump::npy(&held.about, &bytes)?)?;
            write(&path.with_extension("json"), format!("{:#}", dump::about(&held.about)).as_bytes())?;
        }
        _ => {
            return Err(Diagnostic::input(format!("`{}` is no file that a buffer can be written to", path.display()))
                .help("its name ends in .npy or .csv; a picture is .png"));
        }
    }
    Ok(format!("wrote {}", path.display()))
}

/// Writes what is painted as `.png`.
pub fn canvas(gpu: &Gpu, canvas: &Canvas, path: &Path) -> Result<String, Diagnostic> {
    picture(path, canvas.size.0, &canvas.read(gpu)?)?;
    Ok(format!("wrote {}", path.display()))
}

/// Writes a picture of four bytes a pixel as `.png`.
pub fn picture(path: &Path, width: u32, rgba: &[u8]) -> Result<(), Diagnostic> {
    let rgb: Vec<u8> = rgba.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    write(path, &pictures::png(width, &rgb)?)
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Diagnostic> {
    std::fs::write(path, bytes).map_err(|error| Diagnostic::run(format!("cannot write `{}`: {error}", path.display())))
}
