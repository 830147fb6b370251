//! GeoTIFF: the `tiff` crate reads the samples (strips, tiles, LZW, deflate, predictors); the few tags that say
//! how far samples are apart and what "no data" is are read here (OGC GeoTIFF 1.1, GDAL's nodata tag).

use std::fs::File;
use std::io::BufReader;

use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;

use super::Samples;
use super::files::{check_claim, metres_per_degree};

const GT_MODEL_TYPE_KEY: u16 = 1024;
const MODEL_TYPE_GEOGRAPHIC: u16 = 2;
const PROJ_LINEAR_UNITS_KEY: u16 = 3076;
/// Metres of the EPSG linear units that elevation files use: metre, foot, US survey foot.
const LINEAR_UNITS: [(u16, f64); 3] = [(9001, 1.0), (9002, 0.3048), (9003, 1200.0 / 3937.0)];

pub fn read(reader: BufReader<File>) -> Result<Samples, String> {
    let mut decoder = Decoder::new(reader).map_err(|error| format!("is no readable TIFF: {error}"))?;
    let (columns, rows) = decoder.dimensions().map_err(|error| format!("is damaged: {error}"))?;
    let size = check_claim(columns.into(), rows.into())?;
    let cell_m = cell_m(&mut decoder, rows);
    let nodata_value =
        decoder.get_tag_ascii_string(Tag::GdalNodata).ok().and_then(|text| text.trim_matches(['\0', ' ']).parse().ok());
    let (values, full_scale) = match decoder.read_image().map_err(|error| format!("is damaged: {error}"))? {
        DecodingResult::U8(values) => widen(values, Some(u8::MAX.into())),
        DecodingResult::U16(values) => widen(values, Some(u16::MAX.into())),
        DecodingResult::U32(values) => widen(values, Some(u32::MAX.into())),
        DecodingResult::I16(values) => widen(values, Some(i16::MAX.into())),
        DecodingResult::I32(values) => widen(values, Some(i32::MAX.into())),
        DecodingResult::F32(values) => widen(values, None),
        DecodingResult::F64(values) => (values, None),
        _ => {
            return Err(
                "holds samples of a type that heights are not read from; u8, u16, u32, i16, i32, f32, f64 are".into()
            );
        }
    };
    if values.len() != size.0 as usize * size.1 as usize {
        return Err(format!("holds {} values for {columns} x {rows} samples; heights have one band", values.len()));
    }
    Ok(Samples { size, values, full_scale, nodata_value, cell_m })
}

fn widen<T: Into<f64>>(values: Vec<T>, full_scale: Option<f64>) -> (Vec<f64>, Option<f64>) {
    (values.into_iter().map(Into::into).collect(), full_scale)
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
