//! `.npy`: the `npyz` crate reads header and samples; a header that it should not be given is refused here.

use std::fs::File;
use std::io::{BufReader, Read};

use npyz::{Deserialize, NpyFile, NpyHeader, Order};

use super::files::{Elevation, SampleReader, check_claim};

/// Bytes of the longest header that is read; `numpy.load` has the same limit (`max_header_size`).
const LONGEST_HEADER: usize = 10_000;
const MAGIC: &[u8] = b"\x93NUMPY";
/// The keys of a header, each of which is there once (NEP 1).
const KEYS: [&str; 3] = ["descr", "fortran_order", "shape"];

pub fn open(mut reader: BufReader<File>) -> Result<Elevation, String> {
    let header = read_header(&mut reader)?;
    let size = match *header.shape() {
        [rows, columns] => check_claim(columns, rows)?,
        ref shape => return Err(format!("has shape {shape:?}; heights are [rows, cols]")),
    };
    if header.order() != Order::C {
        return Err("is in Fortran order; save it in C order".into());
    }
    let descr = header.dtype().descr();
    let npy = NpyFile::with_header(header, reader);
    let kind = descr.trim_matches('\'').trim_start_matches(['<', '>', '|', '=']);
    let (samples, full_scale): (SampleReader, Option<f64>) = match kind {
        "f4" => (samples::<f32>(npy, size, f64::from), None),
        "f8" => (samples::<f64>(npy, size, f64::from), None),
        "u1" => (samples::<u8>(npy, size, f64::from), Some(u8::MAX.into())),
        "u2" => (samples::<u16>(npy, size, f64::from), Some(u16::MAX.into())),
        "u4" => (samples::<u32>(npy, size, f64::from), Some(u32::MAX.into())),
        "i2" => (samples::<i16>(npy, size, f64::from), Some(i16::MAX.into())),
        "i4" => (samples::<i32>(npy, size, f64::from), Some(i32::MAX.into())),
        other => return Err(format!("holds {other}; heights are f4, f8, u1, u2, u4, i2 or i4")),
    };
    Ok(Elevation { size, full_scale, nodata_value: None, cell_m: None, samples })
}

fn samples<T: Deserialize + 'static>(
    npy: NpyFile<BufReader<File>>,
    (columns, rows): (u32, u32),
    widen: fn(T) -> f64,
) -> SampleReader {
    Box::new(move |put| {
        let mut values = npy.data::<T>().map_err(|error| format!("is damaged: {error}"))?;
        let mut line = Vec::with_capacity(columns as usize);
        for row in 0..rows {
            line.clear();
            for value in values.by_ref().take(columns as usize) {
                line.push(widen(value.map_err(|error| format!("is damaged: {error}"))?));
            }
            put(0, row, &line);
        }
        Ok(())
    })
}

/// The header, if it is one that `npyz` can be given: it is a Python expression, and of one that is nested deeply, the parser takes forever
/// or runs out of stack.
fn read_header(reader: &mut impl Read) -> Result<NpyHeader, String> {
    let cut = |error: std::io::Error| format!("is no readable .npy: its header is cut off ({error})");
    let mut bytes = vec![0; MAGIC.len() + 4];
    reader.read_exact(&mut bytes).map_err(cut)?;
    let version = bytes[MAGIC.len()];
    if !bytes.starts_with(MAGIC) || !(1..=3).contains(&version) {
        return Err("is no readable .npy: it does not begin like one of version 1 to 3".into());
    }
    if version > 1 {
        bytes.resize(MAGIC.len() + 6, 0);
        reader.read_exact(&mut bytes[MAGIC.len() + 4..]).map_err(cut)?;
    }
    let start = bytes.len();
    let length = bytes[MAGIC.len() + 2..].iter().rev().fold(0, |length, &byte| length << 8 | usize::from(byte));
    if length > LONGEST_HEADER {
        return Err(format!("has a header of {length} bytes; at most {LONGEST_HEADER} are read"));
    }
    bytes.resize(start + length, 0);
    reader.read_exact(&mut bytes[start..]).map_err(cut)?;
    if !is_flat(&bytes[start..]) {
        return Err(format!(
            "has a header that is not one flat dictionary of {}; save an array of plain numbers, [rows, cols]",
            KEYS.join(", ")
        ));
    }
    NpyHeader::from_reader(&bytes[..]).map_err(|error| format!("is no readable .npy: {error}"))
}

/// Whether a header has one dictionary with as many entries as there are keys, and in it one tuple at most (the shape).
fn is_flat(header: &[u8]) -> bool {
    let mut quote = None;
    let (mut brackets, mut entries) = (Vec::new(), 0);
    for &byte in header {
        match (quote, byte) {
            (Some(open), _) => quote = quote.filter(|_| byte != open),
            (None, b'\'' | b'"') => quote = Some(byte),
            (None, b'{' | b'}' | b'(' | b')' | b'[' | b']') => brackets.push(byte),
            (None, b':') => entries += 1,
            (None, _) => {}
        }
    }
    entries == KEYS.len() && matches!(brackets[..], [b'{', b'}'] | [b'{', b'(', b')', b'}'])
}
