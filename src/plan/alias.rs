//! Memory: buffers made every frame share blocks where their lifetimes allow it.

use std::collections::BTreeSet;

use super::{BufferId, LeftOut, Life, Often, Plan, Storage, prune};

/// Gives every buffer that is touched its lifetime, and transient ones a slot. First fit in order of birth;
/// a slot is as large as its largest tenant.
pub fn assign(plan: &mut Plan, keep_everything: bool) {
    let lifetimes = prune::touched(plan);
    let reused: BTreeSet<usize> = plan.reused.values().flat_map(|steps| steps.iter().copied()).collect();
    let outlives = |id: BufferId| reused.iter().any(|&step| plan.steps[step].writes.contains(&id));
    // a frame that leaves a step out finds what an earlier one left
    let outlives: Vec<bool> = (0..plan.buffers.len()).map(|at| outlives(BufferId(at))).collect();
    let mut order: Vec<usize> = Vec::new();
    for (index, lifetime) in lifetimes.into_iter().enumerate() {
        let buffer = &mut plan.buffers[index];
        buffer.lifetime = lifetime;
        let is_transient = buffer.often == Often::EveryFrame && buffer.life == Life::Frame && !outlives[index];
        let shares = is_transient && buffer.storage == Storage::Buffer;
        if lifetime.is_some() && shares {
            order.push(index);
        }
    }
    if keep_everything {
        return;
    }
    order.sort_by_key(|&index| plan.buffers[index].lifetime);
    // last step at which each slot is in use
    let mut busy: Vec<usize> = Vec::new();
    let mut alone = 0;
    for index in order {
        let bytes = plan.buffers[index].bytes();
        let Some((first, last)) = plan.buffers[index].lifetime else { continue };
        let slot = match busy.iter().position(|&end| end < first) {
            Some(slot) => slot,
            None => {
                busy.push(0);
                plan.slots.push(0);
                busy.len() - 1
            }
        };
        busy[slot] = last;
        plan.slots[slot] = plan.slots[slot].max(bytes);
        plan.buffers[index].slot = Some(slot);
        alone += bytes;
    }
    let saved_bytes = alone - plan.slots.iter().sum::<u64>();
    if saved_bytes > 0 {
        plan.left_out.push(LeftOut {
            what: "memory of its own for every transient buffer".into(),
            reason: "buffers that are never alive together share a block".into(),
            saved_bytes,
            saved_threads: 0,
        });
    }
}
