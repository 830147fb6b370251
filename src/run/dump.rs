//! Buffers as `.npy`: C order, `[rows, cols(, components)]`, what is missing as NaN.

use npyz::WriterBuilder;

use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::Elem;
use crate::plan::Buffer;

pub fn npy(buffer: &Buffer, bytes: &[u8]) -> Result<Vec<u8>, Diagnostic> {
    let mut shape: Vec<u64> = buffer.dims.iter().map(|&side| side.into()).collect();
    // of a list there may be less than its buffer holds
    let row = shape[1..].iter().product::<u64>() * buffer.elem.bytes();
    shape[0] = bytes.len() as u64 / row.max(1);
    if buffer.elem.components() > 1 {
        shape.push(buffer.elem.components().into());
    }
    let mut out = Vec::new();
    let written = match buffer.elem {
        _ if buffer.elem.is_float() => {
            let mut values: Vec<f32> = bytemuck::pod_collect_to_vec(bytes);
            if buffer.missing.is_some() {
                values.iter_mut().filter(|value| **value < 0.0).for_each(|value| *value = f32::NAN);
            }
            write(&mut out, &shape, values)
        }
        Elem::I32 => write(&mut out, &shape, bytemuck::pod_collect_to_vec::<u8, i32>(bytes)),
        _ => write(&mut out, &shape, bytemuck::pod_collect_to_vec::<u8, u32>(bytes)),
    };
    written.map_err(|error| Diagnostic::run(format!("`{}` cannot be dumped: {error}", buffer.name)))?;
    Ok(out)
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
