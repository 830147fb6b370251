//! Demand flows back from what is wanted; what it does not reach is left out, with the reason.

use super::{BufferId, LeftOut, Often, Plan, Storage};

/// A step runs once if nothing in it changes with the camera: neither its parameters nor what it reads.
pub fn classify(plan: &mut Plan) {
    for index in 0..plan.steps.len() {
        let step = &plan.steps[index];
        let fixed = |id: &BufferId| plan.buffers[id.0].often == Often::Once;
        let optional = step.optional.iter().map(|(_, id, _)| *id);
        let written: Vec<BufferId> = step.writes.iter().copied().chain(optional).collect();
        // a buffer that a later, per-frame step writes again has to be made again every frame
        let rewritten = |id: &BufferId| {
            plan.steps[index + 1..].iter().any(|later| later.writes.contains(id) && later.is_per_frame())
        };
        let own = |id: &BufferId| step.writes.contains(id);
        let once =
            !step.is_per_frame() && step.reads.iter().all(|id| own(id) || fixed(id)) && !written.iter().any(rewritten);
        let often = if once { Often::Once } else { Often::EveryFrame };
        plan.steps[index].often = often;
        for id in written {
            plan.buffers[id.0].often = often;
        }
    }
}

/// Drops the steps that nothing wanted depends on.
pub fn prune(plan: &mut Plan) {
    let mut wanted = plan.outputs.clone();
    let mut kept = Vec::new();
    for step in std::mem::take(&mut plan.steps).into_iter().rev() {
        let needed = step.writes.iter().chain(step.optional.iter().map(|(_, id, _)| id)).any(|id| wanted.contains(id));
        if needed {
            wanted.extend(&step.reads);
            kept.push(step);
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
    kept.reverse();
    plan.steps = kept;
}

/// Switches off the optional outputs that nobody wants; the others become ordinary bindings.
pub fn resolve_optional(plan: &mut Plan, keep_everything: bool) {
    let wanted: Vec<BufferId> =
        plan.steps.iter().flat_map(|step| step.reads.iter().copied()).chain(plan.outputs.iter().copied()).collect();
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
