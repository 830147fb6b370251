//! Maps that lie on the ground: of colours, from a picture or from height and slope, and of surface types.

use std::io::{Read, Seek};
use std::path::Path;

use glam::{DVec2, DVec3, UVec2};
use rayon::prelude::*;

use super::files::check_claim;
use super::{HeightField, TerrainError};
use crate::experiment::regular;
use crate::experiment::scene::{Colour, Cover, SurfaceTypes};

/// A rectangle of colours. Its first and last columns and rows are on the terrain's border; row 0 is north.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourMap {
    /// Columns and rows.
    pub size: UVec2,
    /// Red in the lowest byte, `[rows, columns]`.
    pub pixels: Vec<u32>,
}

impl ColourMap {
    /// Reads or makes the map of a terrain; relative paths start at `folder`.
    pub fn load(colour: &Colour, field: &HeightField, folder: &Path) -> Result<Self, TerrainError> {
        match colour {
            Colour::Image(image) => read(&folder.join(&image.file)),
            Colour::Cover(cover) => Ok(grow(cover, field)),
        }
    }
}

/// The number of what lies on the ground at each of the terrain's samples, `[rows, columns]`.
#[derive(Clone, Debug, PartialEq)]
pub struct TypeMap {
    pub size: UVec2,
    pub numbers: Vec<u32>,
}

impl TypeMap {
    /// Reads the map of a terrain, and takes for each sample the nearest of its numbers.
    pub fn load(types: &SurfaceTypes, field: &HeightField, folder: &Path) -> Result<Self, TerrainError> {
        let SurfaceTypes::Image(image) = types;
        let path = folder.join(&image.file);
        let (image, bits) = open(&path)?;
        // fewer bits come out as values of eight, and are not what they were
        let image = match image {
            image::DynamicImage::ImageLuma8(image) if bits == 8 => image,
            other => {
                let kind = if other.color().has_color() { "colours" } else { "grey values" };
                let what =
                    format!("holds {kind} of {bits} bits, and the numbers of surface types are grey values of 8");
                return Err(TerrainError::BadFile { path: path.display().to_string(), what });
            }
        };
        let nearest = |at: u32, last: u32, last_there: u32| {
            let twice = 2 * u64::from(at) * u64::from(last_there) + u64::from(last);
            (twice / (2 * u64::from(last))) as u32
        };
        let last = (field.size - 1).max(UVec2::ONE);
        let number = |at: usize| {
            let (x, y) = (at as u32 % field.size.x, at as u32 / field.size.x);
            let there = (nearest(x, last.x, image.width() - 1), nearest(y, last.y, image.height() - 1));
            u32::from(image.get_pixel(there.0, there.1).0[0])
        };
        Ok(Self { size: field.size, numbers: (0..field.heights_m.len()).into_par_iter().map(number).collect() })
    }
}

fn read(path: &Path) -> Result<ColourMap, TerrainError> {
    let (image, _) = open(path)?;
    let size = UVec2::new(image.width(), image.height());
    let pixels = image.into_rgba8().pixels().map(|pixel| u32::from_le_bytes(pixel.0)).collect();
    Ok(ColourMap { size, pixels })
}

/// Where the header of a PNG has the bits of a channel.
const BITS_AT: usize = 24;

/// A picture, and the bits of a channel in its file.
fn open(path: &Path) -> Result<(image::DynamicImage, u8), TerrainError> {
    let shown = || path.display().to_string();
    let bad = |what: String| TerrainError::BadFile { path: shown(), what };
    let unreadable = |error: std::io::Error| TerrainError::Unreadable { path: shown(), why: error.to_string() };
    let mut file = std::io::BufReader::new(regular::open(path).map_err(unreadable)?);
    // a file that ends before its header does has no zeros there that anybody gets to see: it is no PNG
    let mut header = Vec::new();
    file.by_ref().take(BITS_AT as u64 + 1).read_to_end(&mut header).map_err(unreadable)?;
    header.resize(BITS_AT + 1, 0);
    file.rewind().map_err(unreadable)?;
    let decoder =
        image::codecs::png::PngDecoder::new(file).map_err(|error| bad(format!("is no readable PNG: {error}")))?;
    let (columns, rows) = image::ImageDecoder::dimensions(&decoder);
    check_claim(columns.into(), rows.into()).map_err(bad)?;
    let image = image::DynamicImage::from_decoder(decoder).map_err(|error| bad(format!("is damaged: {error}")))?;
    Ok((image, header[BITS_AT]))
}

const WATER: DVec3 = DVec3::new(0.22, 0.38, 0.52);
const MEADOW: DVec3 = DVec3::new(0.36, 0.50, 0.25);
const HEATH: DVec3 = DVec3::new(0.55, 0.52, 0.33);
const ROCK: DVec3 = DVec3::new(0.47, 0.44, 0.42);
const SNOW: DVec3 = DVec3::new(0.95, 0.96, 0.98);

/// One colour a sample.
fn grow(cover: &Cover, field: &HeightField) -> ColourMap {
    let heights = || field.heights_m.iter().map(|&height| f64::from(height));
    let (low, high) = (heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max));
    let snow_m = cover.snow_m.unwrap_or(low + 0.8 * (high - low));
    let colour = |at: usize| {
        let at = UVec2::new(at as u32 % field.size.x, at as u32 / field.size.x);
        let height_m = f64::from(field.height_m(at.x, at.y));
        let share = ((height_m - low) / (snow_m - low).max(1e-9)).clamp(0.0, 1.0);
        if cover.water_m.is_some_and(|water_m| height_m <= water_m) {
            WATER
        } else if slope_deg(field, at) > cover.rock_deg {
            ROCK
        } else if height_m > snow_m {
            SNOW
        } else {
            MEADOW.lerp(HEATH, share)
        }
    };
    let packed = |at: usize| {
        let [r, g, b] = (colour(at) * 255.0).round().to_array();
        u32::from_le_bytes([r as u8, g as u8, b as u8, u8::MAX])
    };
    ColourMap { size: field.size, pixels: (0..field.heights_m.len()).into_par_iter().map(packed).collect() }
}

/// Degrees from level by differences over the neighbours of a sample; at the border, to the sample itself.
fn slope_deg(field: &HeightField, at: UVec2) -> f64 {
    let last = field.size - 1;
    let (low, high) = (at.max(UVec2::ONE) - 1, (at + 1).min(last));
    let height = |x, y| f64::from(field.height_m(x, y));
    let rise = DVec2::new(height(high.x, at.y) - height(low.x, at.y), height(at.x, high.y) - height(at.x, low.y));
    (rise / ((high - low).as_dvec2() * field.cell_m)).length().atan().to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steep_ground_is_rock_and_high_ground_is_snow() {
        // level to the west, a step of 100 m over one cell of 10 m, level to the east
        let heights_m = vec![0.0, 0.0, 0.0, 100.0, 100.0, 100.0];
        let field = HeightField { size: UVec2::new(6, 1), cell_m: DVec2::splat(10.0), heights_m };
        let field = HeightField { size: UVec2::new(6, 2), heights_m: field.heights_m.repeat(2), ..field };
        let packed = |colour: DVec3| {
            let [r, g, b] = (colour * 255.0).round().to_array().map(|part| part as u8);
            u32::from_le_bytes([r, g, b, 255])
        };
        let map = grow(&Cover::default(), &field);
        let expected = [MEADOW, MEADOW, ROCK, ROCK, SNOW, SNOW].map(packed);
        assert_eq!(map.pixels[..6], expected);
        let map = grow(&Cover { water_m: Some(0.0), rock_deg: 90.0, snow_m: Some(1e3) }, &field);
        assert_eq!(map.pixels[..3], [WATER; 3].map(packed));
        assert_ne!(map.pixels[5], packed(SNOW));
    }
}
