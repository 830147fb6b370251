//! Demand flows back from what is wanted; what it does not reach is left out, with the reason.

use super::{BufferId, LeftOut, Often, Plan, Storage};

/// A step runs once if nothing in it changes with the camera: neither its parameters, nor what it reads, nor
/// what others write where it writes. The last two depend on other steps, so the answer is a fixed point.
pub fn classify(plan: &mut Plan) {
    plan.buffers.iter_mut().for_each(|buffer| buffer.often = Often::Once);
    plan.steps.iter_mut().for_each(|step| step.often = Often::Once);
    loop {
        let mut changed = false;
        for step in &mut plan.steps {
            let written = step.writes.iter().chain(step.optional.iter().map(|(_, id, _)| id));
            let every_frame = |id: &BufferId| plan.buffers[id.0].often == Often::EveryFrame;
            let moves = step.is_per_frame() || step.reads.iter().any(every_frame) || written.clone().any(every_frame);
            if step.often == Often::Once && moves {
                step.often = Often::EveryFrame;
                written.for_each(|id| plan.buffers[id.0].often = Often::EveryFrame);
                changed = true;
            }
        }
        if !changed {
            return;
        }
    }
}

/// Drops the steps that nothing wanted depends on.
pub fn prune(plan: &mut Plan) {
    let mut wanted = plan.outputs.clone();
    // a buffer that lasts is an output of this frame for the next one
    while let Some(id) = remembered(plan, &wanted) {
        wanted.push(id);
    }
    let mut needed = Vec::new();
    for step in std::mem::take(&mut plan.steps).into_iter().rev() {
        if is_needed(&step, &wanted) {
            wanted.extend(&step.reads);
            needed.push(step);
            continue;
        }
        let names: Vec<String> = step.writes.iter().map(|id| format!("`{}`", plan.buffers[id.0].name)).collect();
        let saved_bytes = step.writes.iter().map(|id| plan.buffers[id.0].bytes()).sum();
        let what = format!("{}: {}", step.stage, step.label);
        let reason = match names.is_empty() {
            true => "nobody reads or measures what it makes".to_string(),
            false => format!("nobody reads or measures {}", names.join(", ")),
        };
        let saved_threads = step.threads();
        match plan.left_out.iter_mut().find(|left| left.what == what && left.reason == reason) {
            Some(same) => same.saved_threads += saved_threads,
            None => plan.left_out.push(LeftOut { what, reason, saved_bytes, saved_threads }),
        }
    }
    needed.reverse();
    plan.steps = needed;
}

fn is_needed(step: &super::Step, wanted: &[BufferId]) -> bool {
    step.writes.iter().chain(step.optional.iter().map(|(_, id, _)| id)).any(|id| wanted.contains(id))
}

/// A buffer that lasts from frame to frame, which something wanted touches, but that is not wanted yet.
fn remembered(plan: &Plan, wanted: &[BufferId]) -> Option<BufferId> {
    let mut reached = wanted.to_vec();
    for step in plan.steps.iter().rev() {
        if is_needed(step, &reached) {
            reached.extend(step.bindings.iter().map(|(_, id)| *id));
        }
    }
    reached.into_iter().find(|id| plan.buffers[id.0].lasts && !wanted.contains(id))
}

/// Switches off the optional outputs that nobody wants; the others become ordinary bindings.
pub fn resolve_optional(plan: &mut Plan, keep_everything: bool) {
    // what a step reads only to write it again is no reason to have it
    let others = plan.steps.iter().flat_map(|step| step.reads.iter().filter(|id| !step.writes.contains(id)));
    let wanted: Vec<BufferId> = others.copied().chain(plan.outputs.iter().copied()).collect();
    let mut dropped: Vec<BufferId> = Vec::new();
    for step in &mut plan.steps {
        for (variable, id, constant) in std::mem::take(&mut step.optional) {
            let keep = keep_everything || wanted.contains(&id);
            step.constants.push((constant.clone(), f64::from(keep)));
            if keep {
                step.bindings.push((variable, id));
                continue;
            }
            step.writes.retain(|written| *written != id);
            step.reads.retain(|read| *read != id);
            step.optional.push((variable, id, constant));
            if !dropped.contains(&id) {
                dropped.push(id);
                let buffer = &plan.buffers[id.0];
                plan.left_out.push(LeftOut {
                    what: format!("{}: the buffer `{}`", step.stage, buffer.name),
                    reason: "nobody reads or measures it".into(),
                    saved_bytes: buffer.bytes(),
                    saved_threads: 0,
                });
            }
        }
    }
}

/// Buffers that only hold memory because something wants them.
pub fn touched(plan: &Plan) -> Vec<Option<(usize, usize)>> {
    let mut lifetimes: Vec<Option<(usize, usize)>> = vec![None; plan.buffers.len()];
    for (index, step) in plan.steps.iter().enumerate() {
        for (_, id) in &step.bindings {
            extend(&mut lifetimes[id.0], index);
        }
        for id in step.reads.iter().chain(&step.writes) {
            extend(&mut lifetimes[id.0], index);
        }
    }
    for id in &plan.outputs {
        if plan.buffers[id.0].storage != Storage::Input || lifetimes[id.0].is_some() {
            extend(&mut lifetimes[id.0], plan.steps.len());
        } else {
            lifetimes[id.0] = Some((0, plan.steps.len()));
        }
    }
    lifetimes
}

fn extend(lifetime: &mut Option<(usize, usize)>, index: usize) {
    *lifetime = Some(lifetime.map_or((index, index), |(first, last)| (first.min(index), last.max(index))));
}
