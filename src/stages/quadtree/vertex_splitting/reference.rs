use super::blocks::Quadtree;
use super::lists::GROUP;
use super::{Start, VertexSplitting};
use crate::plan::product::{Blocks, Roughness};
use crate::reference::{Absent, Buffers, Frame, Reference, Values};

impl Reference for VertexSplitting {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let layout = frame.lattice().cells();
        let (low, high) = (buffers.get("height_min")?, buffers.get("height_max")?);
        let known: Roughness<_> = buffers.latest()?;
        let (roughness, proven) = (buffers.values(known.roughness), known.is_bound);
        let blocks = Quadtree { frame, layout, low: &low, high: &high, roughness: &roughness, stage: self, proven };
        let found = blocks.split_all();
        let bound = if found.is_sure { 0.0 } else { f64::INFINITY };
        let words = layout.dims().iter().product::<u32>().div_ceil(32).next_multiple_of(4);
        let mut split = Values::exact(&[words], 1, vec![0.0; words as usize]);
        let mut bits = vec![0u32; words as usize];
        found.split.iter().for_each(|&index| bits[index / 32] |= 1 << (index % 32));
        bits.iter().enumerate().for_each(|(at, &word)| split.set(at, word.into(), bound));
        let mut leaf = Values::missing(&[self.capacity.next_multiple_of(GROUP)], 2);
        for (number, &(level, at)) in found.leaves.iter().enumerate() {
            let centre = (at * 2 + 1) << level;
            leaf.set(2 * number, (centre.x | centre.y << 16).into(), bound);
            leaf.set(2 * number + 1, (level << 1).into(), bound);
        }
        // four threads a leaf
        let groups = (4 * found.leaves.len() as u32).div_ceil(GROUP);
        let mut count = Values::missing(&[4], 1);
        let any = groups.min(1);
        let work = [groups, any, any, found.leaves.len() as u32];
        work.iter().enumerate().for_each(|(at, &value)| count.set(at, value.into(), bound));
        // from the tree of the frame before, leaves come in the order in which they were split
        leaf.in_any_order = self.start == Start::LastFrame;
        let promise = self.promise(proven);
        let (leaf, count) = (buffers.put("leaf", leaf), buffers.put("leaf_count", count));
        let split = buffers.put("split", split);
        buffers.offer(Blocks { leaf, count, split, promise });
        Ok(())
    }
}
