use glam::UVec2;
use serde::Deserialize;

use super::{Info, Stage};
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Kernel};
use crate::plan::Chain;
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "Scan",
    summary: "prefix sums of a buffer of u32: each element's sum of all before it",
    formula: "sums(i) = sum over j < i of source(j), modulo 2^32",
    source: "reduce-then-scan; Merrill, Garland 2016 compare the family",
    reads: &[],
    writes: &["sums", "sums_total"],
    kernels: &["scan.wgsl"],
    params: &[("of", "\"counts\"", "the buffer to sum"), ("to", "\"sums\"", "the buffer to make")],
    read: |node, _| super::read_params::<Scan>(node),
};

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scan {
    of: String,
    to: String,
}

impl Default for Scan {
    fn default() -> Self {
        Self { of: "counts".into(), to: "sums".into() }
    }
}

/// Elements of a tile: what one workgroup of `scan.wgsl` and `compact.wgsl` takes.
pub(super) const TILE: u32 = 64 * 8 * 4;

impl Stage for Scan {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let source = chain.read(&self.of)?;
        let dims = chain.buffer(source).dims.clone();
        let source = chain.read_as(&self.of, Elem::U32, &dims)?;
        let length = super::elements(chain, source)?;
        let tiles = length.div_ceil(TILE);
        let sums = chain.make(&self.to, Elem::U32, &dims, "", "sum of all elements before");
        let total = chain.make(&format!("{}_total", self.to), Elem::U32, &[1], "", "sum of all elements");
        let tile_sum = chain.make(&format!("{}_tiles", self.to), Elem::U32, &[tiles], "", "sum of each tile");
        let tile_start =
            chain.make(&format!("{}_tile_starts", self.to), Elem::U32, &[tiles], "", "sum before each tile");
        let kernel = Kernel::built_in("scan.wgsl")?;
        for entry in ["reduce", "scan_tiles", "scan"] {
            let step = chain.step(entry, &kernel, entry).set("length", length).set("tiles", tiles);
            let (step, threads) = match entry {
                "reduce" => (step.bind("source", source).bind("tile_sum", tile_sum), 64 * tiles),
                "scan_tiles" => {
                    (step.bind("summed", tile_sum).bind("before", tile_start).bind("total", total), 64)
                }
                _ => (step.bind("source", source).bind("tile_start", tile_start).bind("sums", sums), 64 * tiles),
            };
            step.over(UVec2::new(threads, 1))?;
        }
        Ok(())
    }

    fn makes(&self) -> Vec<String> {
        vec![self.to.clone(), format!("{}_total", self.to)]
    }

    fn reference(&self, _frame: &Frame, buffers: &mut Buffers) {
        let source = buffers.get(&self.of);
        let mut sums = Values::missing(&source.dims, 1);
        let mut sum = 0u32;
        for (at, &value) in source.value.iter().enumerate() {
            sums.set(at, sum.into(), 0.0);
            sum = sum.wrapping_add(value as u32);
        }
        buffers.put(&self.to, sums);
        buffers.put(&format!("{}_total", self.to), Values::exact(&[1], 1, vec![sum.into()]));
    }
}
