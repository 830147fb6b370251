use super::{Compact, MOST_GROUPS, VISITORS};
use crate::plan::product::Listing;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};

impl Reference for Compact {
    fn reference(&self, _frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let of = buffers.find(&self.of).ok_or_else(|| Absent(format!("the buffer `{}`", self.of)))?;
        let source = buffers.values(of);
        let above = f64::from(self.above as f32);
        let width = if self.rows == 1 { source.value.len() } else { source.dims[1] as usize };
        // numbers of the values that make an element
        let values_of = |element: usize| {
            let first = element / width * width * self.rows as usize + element % width;
            (first..source.value.len()).step_by(width).take(self.rows as usize)
        };
        let length = if self.rows == 1 { width } else { width * source.dims[0].div_ceil(self.rows) as usize };
        let is_above = |&element: &usize| values_of(element).any(|at| source.value[at] > above);
        let listed: Vec<f64> =
            (0..length).filter(is_above).filter_map(|at| values_of(at).next()).map(|at| at as f64).collect();
        // an element whose bound reaches across the value may be listed or not, and moves all after it
        let reaches = |at: usize| {
            let (value, bound) = (source.value[at], source.bound[at]);
            // the smallest of all bounds says that a value is what it is
            bound > f64::MIN_POSITIVE && (value.is_nan() || (value - above).abs() <= bound)
        };
        let open = (0..source.value.len()).any(reaches);
        let bound = if open { f64::INFINITY } else { 0.0 };
        let mut list = Values::missing(&[length as u32], 1);
        listed.iter().enumerate().for_each(|(at, &number)| list.set(at, number, bound));
        let groups = (listed.len() as u32).div_ceil(VISITORS);
        let wide = groups.min(MOST_GROUPS);
        let counts = [wide, groups.div_ceil(wide.max(1)), groups.min(1), listed.len() as u32];
        let mut count = Values::missing(&[4], 1);
        counts.iter().enumerate().for_each(|(at, &value)| count.set(at, value.into(), bound));
        let numbers = buffers.put(&self.to, list);
        let count = buffers.put(&format!("{}_count", self.to), count);
        buffers.offer(Listing { numbers, count, of, above: self.above, rows: self.rows });
        Ok(())
    }
}
