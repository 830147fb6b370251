//! Pictures of measures as PNG.

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use crate::experiment::diagnostic::Diagnostic;

/// A picture of three bytes a pixel.
pub fn png(width: u32, rgb: &[u8]) -> Result<Vec<u8>, Diagnostic> {
    let mut png = Vec::new();
    let height = rgb.len() as u32 / 3 / width.max(1);
    PngEncoder::new(&mut png)
        .write_image(rgb, width, height, ExtendedColorType::Rgb8)
        .map_err(|error| Diagnostic::run(format!("a picture of {width} x {height} pixels cannot be made: {error}")))?;
    Ok(png)
}
