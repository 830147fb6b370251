//! GeoTIFF: the `tiff` crate reads the samples (strips, tiles, LZW, deflate, predictors); the few tags that say
//! how far samples are apart and what "no data" is are read here (OGC GeoTIFF 1.1, GDAL's nodata tag).

use std::fs::File;
use std::io::BufReader;

use tiff::ColorType;
use tiff::decoder::{ChunkType, Decoder, DecodingResult, DecodingSampleType, Limits};
use tiff::tags::Tag;

use super::LARGEST_SIDE;
use super::files::{Elevation, Put, SampleReader, check_claim, metres_per_degree};

const GT_MODEL_TYPE_KEY: u16 = 1024;
const MODEL_TYPE_GEOGRAPHIC: u16 = 2;
const PROJ_LINEAR_UNITS_KEY: u16 = 3076;
/// Metres of the EPSG linear units that elevation files use: metre, foot, US survey foot.
const LINEAR_UNITS: [(u16, f64); 3] = [(9001, 1.0), (9002, 0.3048), (9003, 1200.0 / 3937.0)];
/// Bytes of the largest strip or tile, which is in memory as a whole beside the heights: as much as the heights of the largest terrain.
const LARGEST_CHUNK: usize = 4 * LARGEST_SIDE as usize * LARGEST_SIDE as usize;

pub fn open(reader: BufReader<File>) -> Result<Elevation, String> {
    let decoder = Decoder::new(reader).map_err(|error| format!("is no readable TIFF: {error}"))?;
    let mut decoder = decoder.with_limits(limits());
    let damaged = |error: tiff::TiffError| format!("is damaged: {error}");
    let (columns, rows) = decoder.dimensions().map_err(damaged)?;
    let size = check_claim(columns.into(), rows.into())?;
    // bands can be in planes of their own, of which a reader gives the first without a word
    let bands = decoder.find_tag_unsigned::<u16>(Tag::SamplesPerPixel).map_err(damaged)?.unwrap_or(1);
    if bands != 1 {
        return Err(format!("has {bands} bands; heights have one band, so save the one that has them alone"));
    }
    let colours = decoder.colortype().map_err(damaged)?;
    let layout = decoder.image_chunk_buffer_layout(0).map_err(damaged)?;
    let full_scale = match (colours, layout.sample_type) {
        (ColorType::Gray(8), Some(DecodingSampleType::U8)) => Some(u8::MAX.into()),
        (ColorType::Gray(16), Some(DecodingSampleType::U16)) => Some(u16::MAX.into()),
        (ColorType::Gray(32), Some(DecodingSampleType::U32)) => Some(u32::MAX.into()),
        (ColorType::Gray(16), Some(DecodingSampleType::I16)) => Some(i16::MAX.into()),
        (ColorType::Gray(32), Some(DecodingSampleType::I32)) => Some(i32::MAX.into()),
        (ColorType::Gray(32), Some(DecodingSampleType::F32)) => None,
        (ColorType::Gray(64), Some(DecodingSampleType::F64)) => None,
        (colours, _) => {
            return Err(format!(
                "holds {colours:?} samples of a type that heights are not read from; grey u8, u16, u32, i16, i32, f32, f64 are"
            ));
        }
    };
    if layout.len > LARGEST_CHUNK {
        let bytes = layout.len;
        return Err(format!(
            "has strips or tiles of {bytes} bytes; at most {LARGEST_CHUNK} are read at once, so save it in more of them"
        ));
    }
    let cell_m = cell_m(&mut decoder, rows);
    let nodata_value =
        decoder.get_tag_ascii_string(Tag::GdalNodata).ok().and_then(|text| text.trim_matches(['\0', ' ']).parse().ok());
    let samples: SampleReader = Box::new(move |put| read_chunks(decoder, size.0, put));
    Ok(Elevation { size, full_scale, nodata_value, cell_m, samples })
}

fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = LARGEST_CHUNK;
    // what does not compress gets a little longer
    limits.intermediate_buffer_size = 2 * LARGEST_CHUNK;
    limits
}

/// Strips or tiles one after the other.
fn read_chunks(mut decoder: Decoder<BufReader<File>>, columns: u32, put: &mut Put) -> Result<(), String> {
    let damaged = |error: tiff::TiffError| format!("is damaged: {error}");
    let (width, height) = decoder.chunk_dimensions();
    let (chunks, across) = match decoder.get_chunk_type() {
        ChunkType::Strip => (decoder.strip_count(), 1),
        ChunkType::Tile => (decoder.tile_count(), columns.div_ceil(width)),
    };
    for chunk in 0..chunks.map_err(damaged)? {
        let (column, row) = (chunk % across * width, chunk / across * height);
        let (chunk_columns, _) = decoder.chunk_data_dimensions(chunk);
        let mut put_all = |values: &mut dyn Iterator<Item = f64>| put_lines(values, (column, row), chunk_columns, put);
        match decoder.read_chunk(chunk).map_err(damaged)? {
            DecodingResult::U8(values) => put_all(&mut values.into_iter().map(f64::from)),
            DecodingResult::U16(values) => put_all(&mut values.into_iter().map(f64::from)),
            DecodingResult::U32(values) => put_all(&mut values.into_iter().map(f64::from)),
            DecodingResult::I16(values) => put_all(&mut values.into_iter().map(f64::from)),
            DecodingResult::I32(values) => put_all(&mut values.into_iter().map(f64::from)),
            DecodingResult::F32(values) => put_all(&mut values.into_iter().map(f64::from)),
            DecodingResult::F64(values) => put_all(&mut values.into_iter()),
            _ => return Err("is damaged: its samples change their type".into()),
        }
    }
    Ok(())
}

/// The rows of a chunk of which the first sample is at `(column, row)`.
fn put_lines(values: &mut dyn Iterator<Item = f64>, (column, row): (u32, u32), columns: u32, put: &mut Put) {
    for row in row.. {
        let line: Vec<f64> = values.take(columns as usize).collect();
        if line.is_empty() {
            return;
        }
        put(column, row, &line);
    }
}

/// Metres between samples; geographic files give degrees, which are taken at the latitude of the middle row.
fn cell_m(decoder: &mut Decoder<BufReader<File>>, rows: u32) -> Option<(f64, f64)> {
    let scale = decoder.get_tag_f64_vec(Tag::ModelPixelScaleTag).ok().filter(|scale| scale.len() >= 2)?;
    let keys = decoder.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).unwrap_or_default();
    let key =
        |id: u16| keys.chunks_exact(4).skip(1).find(|entry| entry[0] == id && entry[1] == 0).map(|entry| entry[3]);
    if key(GT_MODEL_TYPE_KEY) != Some(MODEL_TYPE_GEOGRAPHIC) {
        let unit = key(PROJ_LINEAR_UNITS_KEY).unwrap_or(LINEAR_UNITS[0].0);
        let metres = LINEAR_UNITS.iter().find(|(id, _)| *id == unit)?.1;
        return Some((scale[0] * metres, scale[1] * metres));
    }
    let tie = decoder.get_tag_f64_vec(Tag::ModelTiepointTag).ok().filter(|tie| tie.len() >= 6)?;
    let latitude_deg = tie[4] - scale[1] * (f64::from(rows - 1) / 2.0 - tie[1]);
    let (x, y) = metres_per_degree(latitude_deg);
    Some((scale[0] * x, scale[1] * y))
}
