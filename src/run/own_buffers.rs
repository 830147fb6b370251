//! What kernels of one's own have left in their new buffers: nothing else would say that a kernel made no numbers, or wrote only a part.

use std::sync::Arc;

use super::{Job, Prepared};
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::{Executor, Gpu};
use crate::plan::{BufferId, Capacities, Demand, Plan};
use crate::stages;

/// What elements hold that nobody has written: the bits of no number that a kernel would make.
const UNWRITTEN: u32 = 0x7fc0_dead;

/// A line about a buffer, and whether it is a warning.
pub struct Line {
    pub text: String,
    pub is_warning: bool,
}

/// A line for each new buffer of a user's kernels, after the first frame of the path. The chain runs for it once more, in memory of its own;
/// a chain without such kernels costs nothing, and one that does not fit twice is not looked at.
pub fn look(gpu: &Arc<Gpu>, job: &Job) -> Result<Vec<Line>, Diagnostic> {
    let prepared = &job.prepared;
    let names = own_names(prepared);
    if names.is_empty() {
        return Ok(Vec::new());
    }
    let Some((plan, ids)) = plan(gpu, prepared, &names)? else { return Ok(Vec::new()) };
    let plan = Arc::new(plan);
    let mut executor = Executor::new(gpu, &plan, &prepared.data)?;
    for &id in &ids {
        let words = plan.buffer(id).bytes() as usize / 4;
        executor.replace(id, bytemuck::cast_slice(&vec![UNWRITTEN; words]))?;
    }
    executor.setup()?;
    executor.frame(0)?;
    ids.iter().map(|&id| Ok(line(&plan, id, &executor.read(id)?))).collect()
}

/// Names of the buffers that kernels of one's own make.
fn own_names(prepared: &Prepared) -> Vec<String> {
    let stages = prepared.cell.stages.iter().zip(&prepared.stages);
    let own = stages.filter(|(call, _)| call.name == stages::own::kernel::INFO.name);
    own.flat_map(|(call, stage)| stages::makes(call, stage.as_ref())).collect()
}

/// The plan of everything, each buffer in memory of its own, or of these buffers alone where that is too much.
fn plan(gpu: &Gpu, prepared: &Prepared, names: &[String]) -> Result<Option<(Plan, Vec<BufferId>)>, Diagnostic> {
    for whole in [true, false] {
        let chain = prepared.chain(&Capacities::new())?;
        let ids: Vec<BufferId> = names.iter().filter_map(|name| chain.find(name)).collect();
        let outputs = if whole { chain.made() } else { ids.clone() };
        let plan = Plan::finish(chain, &Demand { outputs, keep_everything: whole, reuse: false });
        if gpu.check_plan(&plan).is_ok() && (!whole || plan.bytes() < MOST_BYTES) {
            return Ok(Some((plan, ids)));
        }
    }
    Ok(None)
}

/// Memory that this may take in all, in bytes.
const MOST_BYTES: u64 = 1 << 30;

fn line(plan: &Plan, id: BufferId, bytes: &[u8]) -> Line {
    let buffer = plan.buffer(id);
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
    let is_unwritten = |words: &&[u32]| words.iter().all(|word| *word == UNWRITTEN);
    let components = buffer.elem.components() as usize;
    let elements = words.len() / components;
    let unwritten = words.chunks_exact(components).filter(is_unwritten).count();
    let values = buffer.values(bytes);
    let per_element = values.len() / elements.max(1);
    let written = values.chunks_exact(per_element.max(1)).zip(words.chunks_exact(components));
    let written: Vec<f64> =
        written.filter(|(_, words)| !is_unwritten(words)).flat_map(|(values, _)| values).copied().collect();
    let nan = if buffer.missing.is_some() { 0 } else { written.iter().filter(|value| value.is_nan()).count() };
    let infinite = written.iter().filter(|value| value.is_infinite()).count();
    let finite = || written.iter().copied().filter(|value| value.is_finite());
    let range = match finite().count() {
        0 => "no finite number".to_string(),
        _ => {
            let (low, high) = finite().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
            format!("{low:.6} to {high:.6}")
        }
    };
    let counts = [(nan, "NaN"), (infinite, "infinite"), (unwritten, "never written")];
    let told: Vec<String> =
        counts.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect();
    let is_warning = !told.is_empty();
    let told = if is_warning { format!("; of {elements} elements {}", told.join(", ")) } else { String::new() };
    Line { text: format!("`{}` after the first frame: {range}{told}", buffer.name), is_warning }
}
