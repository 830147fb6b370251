//! What runs once, from one plan to the next: results that a plan need not make again, since another has made the same.

use std::collections::{BTreeMap, BTreeSet};

use super::fingerprint::Digest;
use super::{BufferId, Often, Plan, Run, Step, Work};
use crate::frame::FrameInput;
use crate::kernel::BindingKind;
use crate::scene::SceneData;

/// Results of an old plan that do for a new one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Shared {
    /// Buffers of the new plan, each with the one of the old plan that holds the same.
    pub buffers: BTreeMap<BufferId, BufferId>,
    /// Steps of the new plan that have nothing left to make.
    pub steps: BTreeSet<usize>,
}

/// How a buffer came to what it holds: a hash of the steps that wrote to it, and of all that went into them.
type Recipe = [u8; 32];

/// Finds what two plans have in common of what runs once: inputs of the scene, and what steps make of them. No step of every frame writes
/// any of it.
pub fn shared((old, old_data): (&Plan, &SceneData), (new, new_data): (&Plan, &SceneData)) -> Shared {
    let known = recipes(old, old_data);
    let mut held: BTreeMap<Recipe, BufferId> = known.into_iter().map(|(id, recipe)| (recipe, id)).collect();
    let wanted = recipes(new, new_data).into_iter();
    // two buffers that hold the same still are two
    let mut buffers: BTreeMap<BufferId, BufferId> =
        wanted.filter_map(|(id, recipe)| Some((id, held.remove(&recipe)?))).collect();
    // a step that runs again must find what it reads as it was then, and must not write into what is shared
    while let Some(id) = buffers.keys().copied().find(|id| is_disturbed(new, *id, &buffers)) {
        buffers.remove(&id);
    }
    let steps = once(new).filter(|(_, step)| is_done(step, &buffers)).map(|(at, _)| at).collect();
    Shared { buffers, steps }
}

fn once(plan: &Plan) -> impl Iterator<Item = (usize, &Step)> {
    plan.steps.iter().enumerate().filter(|(_, step)| step.often == Often::Once)
}

fn is_done(step: &Step, buffers: &BTreeMap<BufferId, BufferId>) -> bool {
    !step.writes.is_empty() && step.writes.iter().all(|id| buffers.contains_key(id))
}

/// Some step that has to run writes the buffer, or reads it before its last contents.
fn is_disturbed(plan: &Plan, id: BufferId, buffers: &BTreeMap<BufferId, BufferId>) -> bool {
    let last_written = once(plan).filter(|(_, step)| step.writes.contains(&id)).map(|(at, _)| at).max();
    once(plan).filter(|(_, step)| !is_done(step, buffers)).any(|(at, step)| {
        step.writes.contains(&id) || step.reads.contains(&id) && last_written.is_some_and(|last| at < last)
    })
}

/// Run again over what it has left, a step leaves the same. A kernel of one's own that reads what it writes may add to it.
pub fn is_repeatable(step: &Step) -> bool {
    let reads_back = |run: &Run| {
        let bindings = run.kernel.entry(&run.entry).map_or(&[][..], |entry| &entry.bindings);
        bindings.iter().any(|binding| matches!(binding.kind, BindingKind::Storage { read: true, written: true, .. }))
    };
    step.run().is_none_or(|run| run.kernel.trusted || !reads_back(run))
}

/// The recipes of all buffers that only steps write that run once, and of which it matters not how often they have run.
fn recipes(plan: &Plan, data: &SceneData) -> BTreeMap<BufferId, Recipe> {
    let mut recipes: BTreeMap<BufferId, Recipe> = BTreeMap::new();
    let mut unknown: BTreeSet<BufferId> = BTreeSet::new();
    for (_, step) in once(plan) {
        if !is_repeatable(step) || step.reads.iter().chain(&step.writes).any(|id| unknown.contains(id)) {
            unknown.extend(&step.writes);
            continue;
        }
        let mut digest = Digest::default();
        digest.step(plan, step);
        let touched = digest.buffers();
        for id in &touched {
            digest.bytes(recipes.get(id).map_or(&[], |recipe| &recipe[..]));
        }
        match &step.work {
            Work::Upload(id) => {
                // both scenes are in memory: the same place in it holds the same
                let bytes = data.input(&plan.buffer(*id).name).map_or(&[][..], |input| input.bytes());
                digest.number(bytes.as_ptr() as u64);
                digest.number(bytes.len() as u64);
            }
            Work::Run(run) => {
                let scene = FrameInput::of_scene(data);
                run.blocks.iter().flat_map(|(_, block)| block.values(&scene)).for_each(|value| digest.value(&value));
            }
            Work::Copy { .. } => {}
        }
        let whole = digest.finish();
        for id in &step.writes {
            let mut own = Digest::default();
            own.bytes(&whole);
            own.number(touched.iter().position(|known| known == id).unwrap_or(touched.len()) as u64);
            recipes.insert(*id, own.finish());
        }
    }
    recipes.retain(|id, _| !unknown.contains(id) && plan.buffer(*id).often == Often::Once && plan.lives(*id));
    recipes
}
