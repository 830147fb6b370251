//! A frame stage by stage, on the device and in f64: what each stage's kernels have made beside what its reference makes of the same
//! input, and stages whose f64 result goes to the kernels after them.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::Prepared;
use crate::camera::Camera;
use crate::experiment::Cell;
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::Executor;
use crate::plan::{Buffer, BufferId, Life, Plan};
use crate::reference::{Buffers, Frame, Values};
use crate::stages;

/// Frames in a row; a reference finds what the frame before left.
pub struct Walk {
    on_cpu: Vec<usize>,
    previous: Option<Buffers>,
}

/// A buffer after a stage that makes it.
pub struct Walked<'a> {
    pub stage_index: usize,
    pub buffer: BufferId,
    /// What the kernels have made.
    pub on_gpu: &'a Values,
    /// What the reference makes of what the kernels were given.
    pub in_f64: &'a Arc<Values>,
}

impl Walk {
    /// `on_cpu` are the places of stages in the chain whose reference takes the place of their kernels.
    pub fn new(on_cpu: Vec<usize>) -> Self {
        Self { on_cpu, previous: None }
    }

    /// Walks through the frame that the executor has begun, in which once-steps run as well. `look` sees every buffer that has a reference
    /// and may end the walk in f64; the kernels run to the end of the chain anyway.
    pub fn frame(
        &mut self,
        prepared: &Prepared,
        executor: &mut Executor,
        camera: &Camera,
        look: &mut dyn FnMut(&Walked) -> ControlFlow<()>,
    ) -> Result<(), Diagnostic> {
        let plan = executor.plan().clone();
        let mut buffers = Buffers::of_scene(&prepared.data);
        let mut goes_on = true;
        for (index, (stage, call)) in prepared.stages.iter().zip(&prepared.cell.stages).enumerate() {
            executor.submit_stage(index)?;
            if !goes_on {
                continue;
            }
            let ground = buffers.ground();
            let frame = Frame {
                data: &prepared.data,
                camera,
                ground: ground.as_ref(),
                is_scene_ground: buffers.is_scene_ground(),
                previous: self.previous.as_ref(),
            };
            let is_on_cpu = self.on_cpu.contains(&index);
            if let Err(absent) = stage.reference(&frame, &mut buffers) {
                if self.on_cpu.iter().any(|wanted| *wanted >= index) {
                    return Err(Diagnostic::input(format!("`{}` cannot be computed on the CPU: {absent}", call.name))
                        .at(&call.node.head(), "this stage"));
                }
                goes_on = false;
                continue;
            }
            let unchecked = stages::find(&call.name).map_or(&[][..], |entry| entry.info.unchecked);
            for name in stages::makes(call, stage.as_ref()) {
                let is_checked = unchecked.iter().all(|(other, _)| *other != name);
                let (Some(id), Some(local)) = (made(&plan, index, &name), buffers.find(&name)) else { continue };
                if !is_checked {
                    if is_on_cpu {
                        let what = format!("`{}` has no reference for `{name}`", call.name);
                        return Err(Diagnostic::input(what).at(&call.node.head(), "this stage"));
                    }
                    continue;
                }
                let by_reference = buffers.values(local);
                let mut on_gpu = read(executor, &plan, id)?;
                let seen = Walked { stage_index: index, buffer: id, on_gpu: &on_gpu, in_f64: &by_reference };
                goes_on &= look(&seen).is_continue();
                if is_on_cpu {
                    let bytes = replaced(plan.buffer(id), &on_gpu, &by_reference);
                    executor.replace(id, &bytes)?;
                    on_gpu = read(executor, &plan, id)?;
                }
                buffers.replace(local, without_gaps(on_gpu, &by_reference));
            }
            if is_on_cpu {
                executor.submit_taps(index)?;
            }
            let last = self.on_cpu.iter().max();
            goes_on |= last.is_some_and(|last| *last > index);
        }
        // the walk in f64 may have ended before a stage that leaves something to the next frame
        for id in (0..plan.buffers.len()).map(BufferId) {
            if plan.buffer(id).life == Life::Next && plan.lives(id) {
                buffers.put(&plan.buffer(id).name, read(executor, &plan, id)?);
            }
        }
        self.previous = Some(buffers);
        Ok(())
    }
}

/// The places of stages in a chain, by their names or, where there are several of one, by `Stage#2`.
pub fn find_stages(cell: &Cell, names: &[String]) -> Vec<usize> {
    let numbered = |at: usize| {
        let name = &cell.stages[at].name;
        let number = cell.stages[..=at].iter().filter(|call| call.name == *name).count();
        (name.clone(), format!("{name}#{number}"))
    };
    let is_named = |at: &usize| {
        let (name, with_number) = numbered(*at);
        names.iter().any(|wanted| *wanted == name || *wanted == with_number)
    };
    (0..cell.stages.len()).filter(is_named).collect()
}

/// The buffer of a name that a stage writes and that has memory.
fn made(plan: &Plan, stage_index: usize, name: &str) -> Option<BufferId> {
    let own = plan.steps.iter().filter(|step| step.stage_index == stage_index && !step.is_tap());
    let mut written = own.flat_map(|step| step.writes.iter().copied());
    written.rfind(|id| plan.buffer(*id).name == name && plan.lives(*id))
}

/// What is written to the device in the place of what is there: what the reference has, and else what is there.
fn replaced(buffer: &Buffer, on_gpu: &Values, reference: &Values) -> Vec<u8> {
    let missing = f64::from(buffer.missing.unwrap_or(f32::NAN));
    let is_missing = |value: f64| if value.is_nan() { missing } else { value };
    let value = |at: usize| match at < reference.value.len() && !reference.is_gap(at) {
        true => is_missing(reference.value[at]),
        false => is_missing(on_gpu.value[at]),
    };
    let values: Vec<f64> = (0..on_gpu.value.len()).map(value).collect();
    buffer.elem.bytes_of(buffer.packing, &values)
}

/// GPU values, with nothing where the reference has a gap (a level that is not made): the memory there holds anything.
pub fn without_gaps(mut values: Values, reference: &Values) -> Values {
    let gaps = (0..reference.value.len()).map(|at| reference.is_gap(at));
    values.value.iter_mut().zip(gaps).filter(|(_, gap)| *gap).for_each(|(value, _)| *value = f64::NAN);
    values
}

/// A GPU buffer in f64, unpacked, NaN where there is no surface.
pub fn read(executor: &Executor, plan: &Plan, id: BufferId) -> Result<Values, Diagnostic> {
    let buffer: &Buffer = plan.buffer(id);
    Ok(Values::exact(&buffer.dims, buffer.components(), buffer.values(&executor.read(id)?)))
}
