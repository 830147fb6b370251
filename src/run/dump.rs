//! Buffers as files, and what somebody needs to know to read them.
//!
//! A buffer is an `.npy`: C order, `[rows, cols(, components)]`, what is missing as NaN, what is packed unpacked. Beside it stand
//! `BUFFER.json`, which says what its numbers are and where the levels of a pyramid lie, and `camera.json` with the camera of each frame.

use std::num::NonZeroUsize;

use npyz::WriterBuilder;
use serde_json::{Value, json};

use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Packing};
use crate::look::channel::{Kind, channels};
use crate::plan::{Buffer, Spread};
use crate::scene::SceneData;

pub fn npy(buffer: &Buffer, bytes: &[u8]) -> Result<Vec<u8>, Diagnostic> {
    let mut shape: Vec<u64> = buffer.dims.iter().map(|&side| side.into()).collect();
    // of a list there may be less than its buffer holds
    let row = shape[1..].iter().product::<u64>() * buffer.elem.bytes();
    shape[0] = bytes.len() as u64 / row.max(1);
    let numbers = if buffer.parts.is_empty() { buffer.components() as usize } else { buffer.parts.len() };
    if numbers > 1 {
        shape.push(numbers as u64);
    }
    let mut out = Vec::new();
    let written = match (buffer.packing, buffer.elem) {
        _ if !buffer.parts.is_empty() => write(&mut out, &shape, parts(buffer, bytes)),
        (Packing::Bytes, _) => write(&mut out, &shape, bytes.to_vec()),
        (Packing::Halves, elem) => {
            let values = elem.values(buffer.packing, bytes).into_iter().map(|value| value as f32);
            write(&mut out, &shape, values.collect())
        }
        (_, elem) if elem.is_float() => {
            let mut values: Vec<f32> = bytemuck::pod_collect_to_vec(bytes);
            if buffer.missing.is_some() {
                values.iter_mut().filter(|value| **value < 0.0).for_each(|value| *value = f32::NAN);
            }
            write(&mut out, &shape, values)
        }
        (_, Elem::I32) => write(&mut out, &shape, bytemuck::pod_collect_to_vec::<u8, i32>(bytes)),
        _ => write(&mut out, &shape, bytemuck::pod_collect_to_vec::<u8, u32>(bytes)),
    };
    written.map_err(|error| Diagnostic::run(format!("`{}` cannot be dumped: {error}", buffer.name)))?;
    Ok(out)
}

/// The numbers in the bits of each element.
fn parts(buffer: &Buffer, bytes: &[u8]) -> Vec<u32> {
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
    let elements = words.chunks_exact(buffer.elem.components() as usize);
    elements.flat_map(|words| buffer.parts.iter().map(|part| part.of(words))).collect()
}

fn write<T: npyz::Serialize + npyz::AutoSerialize>(
    out: &mut Vec<u8>,
    shape: &[u64],
    values: Vec<T>,
) -> std::io::Result<()> {
    let mut writer = npyz::WriteOptions::new().default_dtype().shape(shape).writer(out).begin_nd()?;
    writer.extend(values)?;
    writer.finish()
}

/// The same as a table: a line an element, with its row and column in front.
pub fn csv(buffer: &Buffer, bytes: &[u8]) -> Result<Vec<u8>, Diagnostic> {
    let refuse = |error: csv::Error| Diagnostic::run(format!("`{}` is no table: {error}", buffer.name));
    let channels: Vec<_> =
        channels(buffer).into_iter().filter(|c| c.kind != Kind::Colour && !c.name.ends_with("as f32")).collect();
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
    let columns = match buffer.dims[..] {
        [_, columns] => NonZeroUsize::new(columns as usize),
        _ => None,
    };
    let mut table = csv::Writer::from_writer(Vec::new());
    let place = if columns.is_some() { vec!["row", "column"] } else { vec!["number"] };
    let header = place.into_iter().map(String::from).chain(channels.iter().map(|channel| channel.name.clone()));
    table.write_record(header).map_err(refuse)?;
    for (at, words) in words.chunks_exact(buffer.elem.components() as usize).enumerate() {
        let place = columns.map_or(vec![at], |columns| vec![at / columns, at % columns]);
        let place = place.into_iter().map(|number| number.to_string());
        table.write_record(place.chain(channels.iter().map(|channel| channel.text(words)))).map_err(refuse)?;
    }
    table.into_inner().map_err(|error| Diagnostic::run(format!("`{}` is no table: {error}", buffer.name)))
}

/// What a buffer's numbers are.
pub fn about(buffer: &Buffer) -> Value {
    let over = match buffer.spread {
        Spread::Numbers => "numbers",
        Spread::Pixels => "pixels, row 0 at the top",
        Spread::Tiles(_) => "tiles of pixels, row 0 at the top",
        Spread::Samples => "samples of the ground, row 0 in the north",
        Spread::Nodes(_) => "nodes of a pyramid, level by level",
        Spread::GridPoints => "points of the grid",
        Spread::GridCells => "cells of the grid",
        Spread::UnitSquare => "equal parts of the square that the grid is over",
        Spread::Rows => "rows of numbers",
        Spread::UnitSquareCorners => "corners of equal parts of the square that the grid is over",
    };
    let parts: Vec<&str> = buffer.parts.iter().map(|part| part.name).collect();
    json!({
        "name": buffer.name,
        "meaning": buffer.meaning,
        "unit": buffer.unit,
        "elements": format!("{:?}", buffer.elem),
        "dims": buffer.dims,
        "over": over,
        "levels": buffer.spread.levels(buffer.top_level),
        "columns": parts,
    })
}

/// Eye and view of each frame, and the samples of the ground: world metres are x east, y north, z up.
pub fn cameras(data: &SceneData) -> Value {
    let lattice = data.ground.lattice();
    let frames: Vec<Value> = data
        .cameras()
        .iter()
        .map(|camera| {
            let [right, up, forward] =
                [camera.world_from_view.x_axis, camera.world_from_view.y_axis, camera.world_from_view.z_axis];
            json!({
                "eye_m": camera.eye_m.to_array(),
                "right": right.to_array(),
                "up": up.to_array(),
                "forward": forward.to_array(),
                "half_tan": camera.half_tan.to_array(),
                "viewport": [camera.viewport.0, camera.viewport.1],
            })
        })
        .collect();
    json!({
        "samples": lattice.size.to_array(),
        "cell_m": lattice.cell_m.to_array(),
        "frames": frames,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::spread::Part;

    #[test]
    fn what_is_packed_is_unpacked() {
        const PARTS: &[Part] = &[Part::new("column", 0, 0, 16), Part::new("row", 0, 16, 16)];
        let buffer = Buffer { parts: PARTS, ..Buffer::new("made", Elem::U32, &[2], "", "") };
        let bytes: Vec<u8> = [0x0002_0001_u32, 0x0004_0003].iter().flat_map(|word| word.to_le_bytes()).collect();
        let file = npy(&buffer, &bytes).unwrap();
        let npy = npyz::NpyFile::new(&file[..]).unwrap();
        assert_eq!(npy.shape(), [2, 2]);
        assert_eq!(npy.into_vec::<u32>().unwrap(), [1, 2, 3, 4]);
        let table = String::from_utf8(csv(&buffer, &bytes).unwrap()).unwrap();
        assert_eq!(table, "number,column,row\n0,1,2\n1,3,4\n");
    }
}
