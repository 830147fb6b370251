//! Frames that leave out what they would compute again.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Often, Plan, Step};
use crate::frame::{Block, FrameInput};
use crate::kernel::Value;
use crate::scene::SceneData;

/// Finds, for each frame of the path, the steps whose inputs are those of the frame before. A step is one of them if its parameters are the
/// same, if no history comes into it, and if everything that writes what it reads or writes is one of them, too.
pub fn find(plan: &mut Plan, data: &SceneData) {
    let blocks: Vec<&'static Block> = plan.blocks().into_iter().filter(|block| block.changes).collect();
    let values = |frame: &FrameInput| -> Vec<Vec<Value>> { blocks.iter().map(|block| block.values(frame)).collect() };
    // by which of the blocks are the same: in many frames it is the same ones
    let mut known: BTreeMap<Vec<bool>, Arc<[usize]>> = BTreeMap::new();
    let mut before: Option<(FrameInput, Vec<Vec<Value>>)> = None;
    for number in 0..plan.frames {
        let Some(now) = FrameInput::of_path(data, number) else { return };
        let Some((earlier, old)) = before.take() else {
            before = Some((now, values(&now)));
            continue;
        };
        let stands =
            now.camera == earlier.camera && now.travelled_m == earlier.travelled_m && now.turned == earlier.turned;
        let new = if stands { old.clone() } else { values(&now) };
        let same: Vec<bool> = old.iter().zip(&new).map(|(old, new)| old == new).collect();
        let steps = known.entry(same).or_insert_with_key(|same| unchanged(plan, &blocks, same).into());
        if !steps.is_empty() {
            plan.reused.insert(number, steps.clone());
        }
        before = Some((now, new));
    }
}

/// The steps to leave out where these of the blocks are as before.
fn unchanged(plan: &Plan, blocks: &[&'static Block], same: &[bool]) -> Vec<usize> {
    let is_every_frame = |step: &Step| step.often == Often::EveryFrame;
    let touches_history =
        |step: &Step| step.reads.iter().chain(&step.writes).any(|id| plan.buffer(*id).life.is_history());
    let is_same = |block: &Block| blocks.iter().zip(same).any(|(known, same)| *known == block && *same);
    let may = |step: &Step| {
        let same = step.run().is_none_or(|run| run.blocks.iter().all(|(_, block)| !block.changes || is_same(block)));
        is_every_frame(step) && same && !touches_history(step)
    };
    let mut left_out: Vec<bool> = plan.steps.iter().map(may).collect();
    loop {
        let runs_again = |at: &usize| {
            let step = &plan.steps[*at];
            let writes = |other: &Step| step.reads.iter().chain(&step.writes).any(|id| other.writes.contains(id));
            // what runs before it must not find what it has left in the frame before
            let reads = |other: &Step| step.writes.iter().any(|id| other.reads.contains(id));
            let others = plan.steps.iter().enumerate().filter(|(at, other)| is_every_frame(other) && !left_out[*at]);
            others.into_iter().any(|(number, other)| writes(other) || number < *at && reads(other))
        };
        let Some(at) = (0..left_out.len()).find(|at| left_out[*at] && runs_again(at)) else { break };
        left_out[at] = false;
    }
    (0..left_out.len()).filter(|&at| left_out[at]).collect()
}
