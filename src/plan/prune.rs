//! Demand flows back from what is wanted; what it does not reach is left out, with the reason.

use std::collections::BTreeSet;

use super::product::Drawn;
use super::{BufferId, LeftOut, Life, Often, Plan, Step, Work};

/// A step runs once if nothing in it changes from frame to frame: neither its parameters, nor what it reads, nor what others write where it
/// writes, nor anything that the frame before has left. What others do makes the answer a fixed point.
pub fn classify(plan: &mut Plan) {
    let often = |life: Life| if life.is_history() { Often::EveryFrame } else { Often::Once };
    plan.buffers.iter_mut().for_each(|buffer| buffer.often = often(buffer.life));
    plan.steps.iter_mut().for_each(|step| step.often = Often::Once);
    loop {
        let mut changed = false;
        // buffers that a step of every frame has read by then: what changes them comes after it, in every frame
        let mut read: Vec<BufferId> = Vec::new();
        for step in &mut plan.steps {
            let written: Vec<BufferId> = step.writes.iter().copied().chain(step.optional()).collect();
            let every_frame = |id: &BufferId| plan.buffers[id.0].often == Often::EveryFrame;
            let moves = step.is_per_frame()
                || step.reads.iter().chain(&written).any(every_frame)
                || written.iter().any(|id| read.contains(id));
            if step.often == Often::Once && moves {
                step.often = Often::EveryFrame;
                written.iter().for_each(|id| plan.buffers[id.0].often = Often::EveryFrame);
                changed = true;
            }
            if step.often == Often::EveryFrame {
                read.extend(&step.reads);
            }
        }
        if !changed {
            return;
        }
    }
}

/// What a frame has to leave for these buffers to be made in every frame: they, and what lasts that they depend on.
fn with_history(plan: &Plan, mut wanted: Vec<BufferId>) -> Vec<BufferId> {
    // a buffer that lasts is an output of this frame for the next one
    while let Some(id) = remembered(plan, &wanted) {
        wanted.push(id);
    }
    wanted
}

/// Finds the steps of every frame that the surface as it was drawn last does not depend on. A chain that draws none is a method as a whole.
pub fn find_after_surface(plan: &Plan) -> BTreeSet<usize> {
    let Some(drawn) = plan.products.find(|drawn: &Drawn<BufferId>| plan.lives(drawn.distance)) else {
        return BTreeSet::new();
    };
    let error = drawn.error.filter(|error| plan.lives(*error));
    let mut wanted = with_history(plan, std::iter::once(drawn.distance).chain(error).collect());
    let mut after = BTreeSet::new();
    for (at, step) in plan.steps.iter().enumerate().rev() {
        if is_needed(step, &wanted) {
            wanted.extend(&step.reads);
        } else if step.often == Often::EveryFrame && !step.is_tap() {
            after.insert(at);
        }
    }
    after
}

/// Drops the steps that nothing wanted depends on.
pub fn prune(plan: &mut Plan) {
    let mut wanted = with_history(plan, plan.outputs.clone());
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

fn is_needed(step: &Step, wanted: &[BufferId]) -> bool {
    step.writes.iter().copied().chain(step.optional()).any(|id| wanted.contains(&id))
}

/// A buffer that this frame has to leave for the next one, since something wanted touches it, but that is not wanted yet.
fn remembered(plan: &Plan, wanted: &[BufferId]) -> Option<BufferId> {
    let mut reached = wanted.to_vec();
    for step in plan.steps.iter().rev() {
        if is_needed(step, &reached) {
            reached.extend(step.run().into_iter().flat_map(|run| run.bindings.iter().map(|(_, id)| *id)));
            reached.extend(&step.reads);
        }
    }
    let left = |id: BufferId| match plan.buffers[id.0].life {
        Life::LastOf(next) => Some(next),
        Life::Kept | Life::Host => Some(id),
        Life::Next | Life::Frame => None,
    };
    reached.into_iter().filter_map(left).find(|id| !wanted.contains(id))
}

/// Switches off the optional outputs that nobody wants; the others become ordinary bindings.
pub fn resolve_optional(plan: &mut Plan, keep_everything: bool) {
    // what a step reads only to write it again is no reason to have it
    let others = plan.steps.iter().flat_map(|step| step.reads.iter().filter(|id| !step.writes.contains(id)));
    // who reads the old half of a pair wants the new one for the next frame
    let next = |id: BufferId| match plan.buffers[id.0].life {
        Life::LastOf(next) => Some(next),
        _ => None,
    };
    let wanted = others.copied().chain(plan.outputs.iter().copied());
    let wanted: Vec<BufferId> = wanted.flat_map(|id| [Some(id), next(id)]).flatten().collect();
    let mut dropped: Vec<BufferId> = Vec::new();
    for step in &mut plan.steps {
        let Work::Run(run) = &mut step.work else { continue };
        for (variable, id, constant) in std::mem::take(&mut run.optional) {
            let keep = keep_everything || wanted.contains(&id);
            run.constants.push((constant.clone(), f64::from(keep)));
            if keep {
                run.bindings.push((variable, id));
                continue;
            }
            step.writes.retain(|written| *written != id);
            step.reads.retain(|read| *read != id);
            run.optional.push((variable, id, constant));
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
        for (_, id) in step.run().into_iter().flat_map(|run| &run.bindings) {
            extend(&mut lifetimes[id.0], index);
        }
        for id in step.reads.iter().chain(&step.writes) {
            extend(&mut lifetimes[id.0], index);
        }
    }
    for id in &plan.outputs {
        extend(&mut lifetimes[id.0], plan.steps.len());
    }
    // both halves of a pair have memory as soon as one is touched
    for at in 0..plan.buffers.len() {
        let Life::LastOf(next) = plan.buffers[at].life else { continue };
        for (half, other) in [(at, next.0), (next.0, at)] {
            lifetimes[half] = lifetimes[half].or(lifetimes[other]);
        }
    }
    lifetimes
}

fn extend(lifetime: &mut Option<(usize, usize)>, index: usize) {
    *lifetime = Some(lifetime.map_or((index, index), |(first, last)| (first.min(index), last.max(index))));
}
