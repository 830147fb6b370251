//! What the values of a buffer are like, found on the device: only sums come back.

use super::memory::make_buffer;
use super::paint::{Part, Tones, constants, format_params, tones_params};
use super::tool::Tool;
use super::{Gpu, GpuError, Held, readback};
use crate::kernel::Value;
use crate::look::Channel;

/// Threads that walk over a buffer, each over its own part: so many, or as many as it takes for none to go over more values than
/// any adapter lets the loops of a thread turn.
const THREADS: u32 = 4096;
const MOST_VALUES: u32 = 16_384;
/// Words that each leaves.
const WORDS: usize = 8;
/// Parts of a range in which values are counted.
pub const BINS: u32 = 128;
/// Bits of a key that one pass over the buffer finds out.
const KEY_BITS: u32 = 11;

/// Which values are looked at.
pub struct Looked<'a> {
    pub held: &'a Held,
    pub channel: &'a Channel,
    pub minus: Option<(&'a Held, &'a Channel)>,
    pub part: Part,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Of the numbers; `None` if there is none.
    pub lowest: Option<f32>,
    pub highest: Option<f32>,
    pub mean: Option<f64>,
    pub numbers: u64,
    pub missing: u64,
    pub nan: u64,
    pub infinite: u64,
    pub minus_infinite: u64,
}

impl Gpu {
    pub fn statistics(&self, looked: &Looked) -> Result<Statistics, GpuError> {
        let words = self.run(looked, "sum", None, (0, 0, 0), threads(looked.part) as usize * WORDS)?;
        let mut all = Statistics::default();
        let mut sum = 0.0;
        for thread in words.chunks_exact(WORDS) {
            let [low, high, total] = [0, 1, 2].map(|at| f32::from_bits(thread[at]));
            let counts = [3, 4, 5, 6, 7].map(|at| u64::from(thread[at]));
            if counts[0] > 0 {
                all.lowest = Some(all.lowest.map_or(low, |known| known.min(low)));
                all.highest = Some(all.highest.map_or(high, |known| known.max(high)));
                sum += f64::from(total);
            }
            all.numbers += counts[0];
            all.missing += counts[1];
            all.nan += counts[2];
            all.infinite += counts[3];
            all.minus_infinite += counts[4];
        }
        all.mean = (all.numbers > 0).then(|| sum / all.numbers as f64);
        Ok(all)
    }

    /// How many values fall into each of equal parts of a range.
    pub fn histogram(&self, looked: &Looked, tones: Tones) -> Result<Vec<u32>, GpuError> {
        self.run(looked, "count", Some(tones), (0, 0, BINS), BINS as usize)
    }

    /// The value that so many of the others are not above (the nearest rank), exact.
    pub fn percentile(&self, looked: &Looked, numbers: u64, share: f64) -> Result<Option<f32>, GpuError> {
        let mut rank = ((share * numbers as f64).ceil() as u64).clamp(1, numbers.max(1));
        let (mut first, mut shift) = (0u32, 32 - KEY_BITS);
        loop {
            let bins = 1u32 << KEY_BITS.min(32 - shift);
            let counts = self.run(looked, "count", None, (first, shift, bins), bins as usize)?;
            let mut below = 0;
            let found = counts.iter().position(|&count| {
                below += u64::from(count);
                below >= rank
            });
            let Some(bin) = found else { return Ok(None) };
            rank -= below - u64::from(counts[bin]);
            first += (bin as u32) << shift;
            if shift == 0 {
                return Ok(Some(value_of_key(first)));
            }
            shift = shift.saturating_sub(KEY_BITS);
        }
    }

    fn run(
        &self,
        looked: &Looked,
        entry: &'static str,
        tones: Option<Tones>,
        (first_key, key_shift, bins): (u32, u32, u32),
        words: usize,
    ) -> Result<Vec<u32>, GpuError> {
        let Looked { held, channel, minus, part } = looked;
        let (other, other_channel) = minus.unwrap_or((held, channel));
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let found = make_buffer(self, "statistics", 4 * words as u64, usage)?;
        let mut params = tones_params(tones.unwrap_or(NO_TONES));
        params.extend(format_params("format", channel));
        params.extend(format_params("minus", other_channel));
        params.extend([
            ("first", Value::from(part.row * held.stride)),
            ("stride", held.stride.into()),
            ("minus_first", (part.row * other.stride).into()),
            ("minus_stride", other.stride.into()),
            ("extent", [part.columns, part.rows].into()),
            ("threads", threads(*part).into()),
            ("first_key", first_key.into()),
            ("key_shift", key_shift.into()),
            ("bins", bins.into()),
            ("by_key", u32::from(tones.is_none()).into()),
        ]);
        let tool = Tool {
            kernel: "looks/statistics.wgsl",
            entry,
            draw: None,
            constants: &constants(
                channel,
                minus.map(|(_, channel)| channel),
                tones.map_or(crate::look::Scale::Linear, |tones| tones.scaled.scale),
            ),
            buffers: &[("data", &held.buffer), ("other", &other.buffer), ("found", &found), ("bins", &found)],
            images: &[],
            params: &params,
        };
        let staging_usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging = make_buffer(self, "statistics", 4 * words as u64, staging_usage)?;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.encode_compute(&mut encoder, &tool, [threads(*part), 1])?;
        encoder.copy_buffer_to_buffer(&found, 0, &staging, 0, 4 * words as u64);
        let copied = self.queue.submit([encoder.finish()]);
        let mut read: Vec<u32> = bytemuck::pod_collect_to_vec(&readback::map(self, &staging, &copied)?);
        read.truncate(words);
        Ok(read)
    }
}

fn threads(part: Part) -> u32 {
    part.columns.saturating_mul(part.rows).div_ceil(MOST_VALUES).max(THREADS)
}

const NO_TONES: Tones = Tones {
    colours: crate::look::Colours::Grey,
    scaled: crate::look::scale::Scaled { low: 0.0, high: 1.0, scale: crate::look::Scale::Linear },
    mark_above: None,
};

/// The inverse of `key_of` in `kernels/looks/statistics.wgsl`.
fn value_of_key(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 { key & 0x7fff_ffff } else { !key })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_thread_goes_over_more_values_than_loops_may_turn() {
        for (columns, rows) in [(1, 1), (640, 480), (16_384, 16_384), (32_768, 32_768), (u32::MAX, 1)] {
            let threads = threads(Part { row: 0, columns, rows });
            assert!((columns * rows).div_ceil(threads) <= MOST_VALUES);
            assert!(threads >= THREADS);
        }
    }
}
