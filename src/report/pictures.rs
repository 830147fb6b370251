//! Pictures of measures as PNG.

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use crate::experiment::diagnostic::Diagnostic;

/// A picture of three bytes a pixel.
pub fn png(width: u32, rgb: &[u8]) -> Result<Vec<u8>, Diagnostic> {
    let mut png = Vec::new();
    let height = rgb.len() as u32 / 3 / width.max(1);
    let refuse = |why: String| Diagnostic::run(format!("a picture of {width} x {height} pixels cannot be made: {why}"));
    // the encoder panics at it
    if rgb.len() as u64 != 3 * u64::from(width) * u64::from(height) {
        return Err(refuse(format!("it has {} bytes", rgb.len())));
    }
    PngEncoder::new(&mut png)
        .write_image(rgb, width, height, ExtendedColorType::Rgb8)
        .map_err(|error| refuse(error.to_string()))?;
    Ok(png)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_that_cannot_be_made_is_said_to_be() {
        assert!(png(2, &[7; 12]).is_ok());
        // two pixels and a half
        assert!(png(2, &[7; 16]).is_err());
        assert!(png(0, &[7; 12]).is_err());
    }
}
