//! Elevation files of the kinds that need no more than a few lines each; GeoTIFF has its own module.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use image::ImageDecoder;
use npyz::NpyFile;

use super::{LARGEST_SIDE, Samples, TerrainError, geotiff};

/// Mean Earth radius in metres (IUGG).
const EARTH_RADIUS_M: f64 = 6_371_008.8;

pub fn read(path: &Path) -> Result<Samples, TerrainError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let shown = path.display().to_string();
    if ![".png", ".tif", ".tiff", ".hgt", ".hgt.zip", ".npy"].iter().any(|ending| name.ends_with(ending)) {
        return Err(TerrainError::UnknownFormat(shown));
    }
    let file =
        File::open(path).map_err(|error| TerrainError::Unreadable { path: shown.clone(), why: error.to_string() })?;
    let bad = |what: String| TerrainError::BadFile { path: shown.clone(), what };
    let reader = BufReader::new(file);
    if name.ends_with(".png") {
        read_png(reader).map_err(bad)
    } else if name.ends_with(".tif") || name.ends_with(".tiff") {
        geotiff::read(reader).map_err(bad)
    } else if name.ends_with(".hgt") {
        read_hgt(reader, &name).map_err(bad)
    } else if name.ends_with(".hgt.zip") {
        read_hgt_zip(reader).map_err(bad)
    } else {
        read_npy(reader).map_err(bad)
    }
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

fn read_png(reader: BufReader<File>) -> Result<Samples, String> {
    let decoder =
        image::codecs::png::PngDecoder::new(reader).map_err(|error| format!("is no readable PNG: {error}"))?;
    let (columns, rows) = decoder.dimensions();
    let size = check_claim(columns.into(), rows.into())?;
    let image = image::DynamicImage::from_decoder(decoder).map_err(|error| format!("is damaged: {error}"))?;
    let (values, full_scale) = match image {
        image::DynamicImage::ImageLuma8(image) => (image.iter().map(|&v| f64::from(v)).collect(), f64::from(u8::MAX)),
        image::DynamicImage::ImageLuma16(image) => (image.iter().map(|&v| f64::from(v)).collect(), f64::from(u16::MAX)),
        other => return Err(format!("has {:?} pixels; heights need 8 or 16 bit grey", other.color())),
    };
    Ok(Samples { size, values, full_scale: Some(full_scale), nodata_value: None, cell_m: None })
}

/// SRTM: big-endian i16, square, 1201 (3") or 3601 (1") a side, named after its south-west corner.
fn read_hgt(mut reader: impl Read, name: &str) -> Result<Samples, String> {
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
    let values = bytes.chunks_exact(2).map(|two| f64::from(i16::from_be_bytes([two[0], two[1]]))).collect();
    let cells = f64::from(side - 1);
    Ok(Samples {
        size: (side, side),
        values,
        full_scale: Some(f64::from(i16::MAX)),
        nodata_value: Some(f64::from(i16::MIN)),
        cell_m: Some((x / cells, y / cells)),
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

fn read_hgt_zip(reader: BufReader<File>) -> Result<Samples, String> {
    let mut archive = zip::ZipArchive::new(reader).map_err(|error| format!("is no readable zip: {error}"))?;
    let names = archive.file_names().flatten().map(|name| name.into_owned());
    let name = { names }.find(|name| name.to_lowercase().ends_with(".hgt")).ok_or("holds no .hgt file")?;
    let entry = archive.by_name(&name).map_err(|error| format!("is damaged: {error}"))?;
    let base = name.rsplit('/').next().unwrap_or_default().to_lowercase();
    read_hgt(entry, &base)
}

fn read_npy(reader: BufReader<File>) -> Result<Samples, String> {
    let npy = NpyFile::new(reader).map_err(|error| format!("is no readable .npy: {error}"))?;
    let shape = npy.shape().to_vec();
    let [rows, columns] = shape[..] else { return Err(format!("has shape {shape:?}; heights are [rows, cols]")) };
    let size = check_claim(columns, rows)?;
    if npy.order() != npyz::Order::C {
        return Err("is in Fortran order; save it in C order".into());
    }
    let descr = npy.dtype().descr();
    let damaged = |error: std::io::Error| format!("is damaged: {error}");
    macro_rules! values {
        ($kind:ty) => {
            npy.into_vec::<$kind>().map_err(damaged)?.into_iter().map(|v| v as f64).collect()
        };
    }
    let kind = descr.trim_matches('\'').trim_start_matches(['<', '>', '|', '=']).to_string();
    let (values, full_scale): (Vec<f64>, Option<f64>) = match kind.as_str() {
        "f4" => (values!(f32), None),
        "f8" => (values!(f64), None),
        "u1" => (values!(u8), Some(u8::MAX.into())),
        "u2" => (values!(u16), Some(u16::MAX.into())),
        "u4" => (values!(u32), Some(u32::MAX.into())),
        "i2" => (values!(i16), Some(i16::MAX.into())),
        "i4" => (values!(i32), Some(i32::MAX.into())),
        other => return Err(format!("holds {other}; heights are f4, f8, u1, u2, u4, i2 or i4")),
    };
    Ok(Samples { size, values, full_scale, nodata_value: None, cell_m: None })
}
