//! Elevation files of the kinds that need no more than a few lines each; GeoTIFF and `.npy` have their own modules.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use image::{ColorType, ImageDecoder};

use super::{LARGEST_SIDE, TerrainError, geotiff, npy};
use crate::experiment::regular;

/// Mean Earth radius in metres (IUGG).
const EARTH_RADIUS_M: f64 = 6_371_008.8;

/// An elevation file of which the header has been read, before any of the user's wishes are applied to it.
pub struct Elevation {
    /// Columns and rows.
    pub size: (u32, u32),
    /// Value of the largest number the sample type holds, for integer types.
    pub full_scale: Option<f64>,
    pub nodata_value: Option<f64>,
    pub cell_m: Option<(f64, f64)>,
    pub samples: SampleReader,
}

/// Reads the samples and hands them on, a part of a row at a time: all of them in f64 would be twice as large as the heights.
pub type SampleReader = Box<dyn FnOnce(&mut Put) -> Result<(), String>>;

/// Takes samples side by side in one row: column of the first, row, values.
pub type Put<'a> = dyn FnMut(u32, u32, &[f64]) + 'a;

/// Opens an elevation file and reads its header.
pub fn open(path: &Path) -> Result<Elevation, TerrainError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let shown = path.display().to_string();
    if ![".png", ".tif", ".tiff", ".hgt", ".hgt.zip", ".npy"].iter().any(|ending| name.ends_with(ending)) {
        return Err(TerrainError::UnknownFormat(shown));
    }
    let file = regular::open(path).map_err(|error| TerrainError::Unreadable { path: shown, why: error.to_string() })?;
    let reader = BufReader::new(file);
    let opened = if name.ends_with(".png") {
        open_png(reader)
    } else if name.ends_with(".tif") || name.ends_with(".tiff") {
        geotiff::open(reader)
    } else if name.ends_with(".hgt") {
        open_hgt(reader, &name)
    } else if name.ends_with(".hgt.zip") {
        open_hgt_zip(reader)
    } else {
        npy::open(reader)
    };
    opened.map_err(|what| bad(path, &what))
}

/// Letters of what is said of a file. Some readers repeat what they found in it, however long that is.
const MOST_LETTERS: usize = 300;

/// What is wrong with a file.
pub fn bad(path: &Path, what: &str) -> TerrainError {
    let line = what.lines().next().unwrap_or_default();
    let mut shown: String = line.chars().take(MOST_LETTERS).collect();
    if shown.len() < line.len() {
        shown.push_str(" ...");
    }
    TerrainError::BadFile { path: path.display().to_string(), what: shown }
}

/// Refuses a size before anything of that size is allocated: the header may lie.
pub fn check_claim(columns: u64, rows: u64) -> Result<(u32, u32), String> {
    let most = u64::from(LARGEST_SIDE);
    if columns == 0 || rows == 0 || columns > most || rows > most {
        return Err(format!("says it holds {columns} x {rows} samples; 1 to {most} a side can be held"));
    }
    Ok((columns as u32, rows as u32))
}

/// Metres a degree of longitude and of latitude on the sphere of mean radius.
pub fn metres_per_degree(latitude_deg: f64) -> (f64, f64) {
    let degree = EARTH_RADIUS_M.to_radians();
    (degree * latitude_deg.to_radians().cos(), degree)
}

/// Hands on samples of which each is some bytes, rows from top to bottom.
fn put_rows(bytes: &[u8], bytes_each: usize, columns: u32, widen: fn(&[u8]) -> f64, put: &mut Put) {
    for (row, bytes) in bytes.chunks_exact(columns as usize * bytes_each).enumerate() {
        let values: Vec<f64> = bytes.chunks_exact(bytes_each).map(widen).collect();
        put(0, row as u32, &values);
    }
}

fn open_png(reader: BufReader<File>) -> Result<Elevation, String> {
    let decoder =
        image::codecs::png::PngDecoder::new(reader).map_err(|error| format!("is no readable PNG: {error}"))?;
    let (columns, rows) = decoder.dimensions();
    let size = check_claim(columns.into(), rows.into())?;
    let (widen, full_scale): (fn(&[u8]) -> f64, f64) = match decoder.color_type() {
        ColorType::L8 => (|one| one[0].into(), u8::MAX.into()),
        ColorType::L16 => (|two| u16::from_ne_bytes([two[0], two[1]]).into(), u16::MAX.into()),
        other => return Err(format!("has {other:?} pixels; heights need 8 or 16 bit grey")),
    };
    let bytes_each = usize::from(decoder.color_type().bytes_per_pixel());
    let samples: SampleReader = Box::new(move |put| {
        // at most half of what the heights need
        let mut bytes = vec![0; columns as usize * rows as usize * bytes_each];
        decoder.read_image(&mut bytes).map_err(|error| format!("is damaged: {error}"))?;
        put_rows(&bytes, bytes_each, columns, widen, put);
        Ok(())
    });
    Ok(Elevation { size, full_scale: Some(full_scale), nodata_value: None, cell_m: None, samples })
}

/// SRTM: big-endian i16, square, 1201 (3") or 3601 (1") a side, named after its south-west corner.
fn open_hgt(mut reader: impl Read, name: &str) -> Result<Elevation, String> {
    let mut bytes = Vec::new();
    // one byte more than the largest, so that a longer file is noticed and never read whole
    reader
        .by_ref()
        .take(3601 * 3601 * 2 + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| format!("is damaged: {error}"))?;
    let side = match bytes.len() {
        length if length == 1201 * 1201 * 2 => 1201,
        length if length == 3601 * 3601 * 2 => 3601,
        length => return Err(format!("holds {length} bytes; an .hgt has 1201^2 or 3601^2 samples of 2 bytes")),
    };
    let south_deg = tile_latitude_deg(name)
        .ok_or_else(|| "is not named after its corner like N47W122.hgt, so its latitude is not known".to_string())?;
    let (x, y) = metres_per_degree(south_deg + 0.5);
    let cells = f64::from(side - 1);
    let samples: SampleReader = Box::new(move |put| {
        put_rows(&bytes, 2, side, |two| i16::from_be_bytes([two[0], two[1]]).into(), put);
        Ok(())
    });
    Ok(Elevation {
        size: (side, side),
        full_scale: Some(f64::from(i16::MAX)),
        nodata_value: Some(f64::from(i16::MIN)),
        cell_m: Some((x / cells, y / cells)),
        samples,
    })
}

fn tile_latitude_deg(name: &str) -> Option<f64> {
    let degrees: f64 = name.get(1..3)?.parse().ok()?;
    match name.as_bytes().first()? {
        b'n' => Some(degrees),
        b's' => Some(-degrees),
        _ => None,
    }
}

fn open_hgt_zip(reader: BufReader<File>) -> Result<Elevation, String> {
    let mut archive = zip::ZipArchive::new(reader).map_err(|error| format!("is no readable zip: {error}"))?;
    let names = archive.file_names().flatten().map(|name| name.into_owned());
    let name = { names }.find(|name| name.to_lowercase().ends_with(".hgt")).ok_or("holds no .hgt file")?;
    let entry = archive.by_name(&name).map_err(|error| format!("is damaged: {error}"))?;
    let base = name.rsplit('/').next().unwrap_or_default().to_lowercase();
    open_hgt(entry, &base)
}
