//! Pictures: the final image and the error heat map, as PNG.

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

/// A picture with red in the lowest byte of each pixel.
pub fn colour_png(width: u32, pixels: &[u32]) -> Vec<u8> {
    let rgb: Vec<u8> =
        pixels.iter().flat_map(|pixel| [*pixel as u8, (*pixel >> 8) as u8, (*pixel >> 16) as u8]).collect();
    encode(width, &rgb)
}

/// Error in pixels from black (none) over red and yellow to white (four thresholds and more); grey is sky, and
/// blue are pixels where sky and surface are mixed up.
pub fn error_png(width: u32, error_px: &[f32], mixed_up: &[bool], threshold_px: f64) -> Vec<u8> {
    let rgb: Vec<u8> = error_px
        .iter()
        .zip(mixed_up)
        .flat_map(|(&error, &mixed_up)| match (mixed_up, error.is_nan()) {
            (true, _) => [40, 90, 255],
            (false, true) => [70, 74, 80],
            (false, false) => heat((f64::from(error) / (4.0 * threshold_px)).clamp(0.0, 1.0)),
        })
        .collect();
    encode(width, &rgb)
}

fn heat(share: f64) -> [u8; 3] {
    let ramp = |from: f64| ((share - from) * 3.0).clamp(0.0, 1.0) * 255.0;
    [ramp(0.0) as u8, ramp(1.0 / 3.0) as u8, ramp(2.0 / 3.0) as u8]
}

fn encode(width: u32, rgb: &[u8]) -> Vec<u8> {
    let mut png = Vec::new();
    let height = rgb.len() as u32 / 3 / width.max(1);
    // writing to memory fails for no picture whose size is right, and it is
    let _ = PngEncoder::new(&mut png).write_image(rgb, width, height, ExtendedColorType::Rgb8);
    png
}
