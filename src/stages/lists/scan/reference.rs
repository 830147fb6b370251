use super::Scan;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};

impl Reference for Scan {
    fn reference(&self, _frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let source = buffers.get(&self.of)?;
        let mut sums = Values::missing(&source.dims, 1);
        let (mut sum, mut is_open) = (0u32, false);
        for (at, &value) in source.value.iter().enumerate() {
            sums.set(at, sum.into(), if is_open { f64::INFINITY } else { 0.0 });
            sum = sum.wrapping_add(value as u32);
            // nothing is said of a sum of what nothing is said of
            is_open |= source.bound[at] > 0.0;
        }
        let mut total = Values::missing(&[1], 1);
        total.set(0, sum.into(), if is_open { f64::INFINITY } else { 0.0 });
        buffers.put(&self.to, sums);
        buffers.put(&format!("{}_total", self.to), total);
        Ok(())
    }
}
