//! Looking at buffers in the middle of a frame: a copy of what a buffer holds after a step.

use super::{Buffer, BufferId, Chain, Life, Often, Step, Storage, Work};

impl Chain<'_> {
    /// The buffers that this stage has written so far; of several with one name, the last.
    pub fn written(&self) -> Vec<BufferId> {
        let own = self.steps.iter().filter(|step| step.stage_index == self.stage_index && !step.is_tap());
        let mut written: Vec<BufferId> =
            own.flat_map(|step| step.writes.iter().copied().chain(step.optional())).collect();
        written.sort();
        written.dedup();
        let name = |id: BufferId| self.buffer(id).name.as_str();
        let is_last = |at: usize| written[at + 1..].iter().all(|&later| name(later) != name(written[at]));
        (0..written.len()).filter(|&at| is_last(at)).map(|at| written[at]).collect()
    }

    /// Keeps what a buffer holds after a step, as a buffer of another name. What is asked for later is put behind what was asked for
    /// before. A render target is drawn once, and is looked at as it is.
    pub fn tap(&mut self, buffer: BufferId, after: usize, name: &str) -> BufferId {
        let source = self.buffer(buffer).clone();
        if source.storage == Storage::Target {
            return buffer;
        }
        let meaning = format!("{}, as it is after a step", source.meaning);
        let copy = Buffer { name: name.into(), storage: Storage::Buffer, life: Life::Frame, meaning, ..source };
        self.buffers.push(copy);
        let to = BufferId(self.buffers.len() - 1);
        let Step { stage, stage_index, .. } = self.steps[after].clone();
        let step = Step {
            stage,
            stage_index,
            label: format!("keep {name}"),
            work: Work::Copy { from: buffer, to },
            often: Often::EveryFrame,
            reads: vec![buffer],
            writes: vec![to],
        };
        self.steps.insert(after + 1, step);
        to
    }

    /// Keeps what a buffer holds after the last step that is called so: a stage, a step's label, or `STAGE/LABEL`; with `#2` behind it, after
    /// the second one. `None` if there is no such step, or no such buffer by then.
    pub fn tap_named(&mut self, name: &str, buffer: &str, step: &str) -> Option<BufferId> {
        let after = find_step(&self.steps, step)?;
        let is_there = |id: &BufferId| {
            let touches =
                |step: &Step| step.writes.contains(id) || step.reads.contains(id) || step.optional().any(|o| o == *id);
            self.buffer(*id).name == buffer && self.steps[..=after].iter().any(touches)
        };
        let id = (0..self.buffers.len()).map(BufferId).rfind(is_there)?;
        // a render target is looked at as it is, under its own name
        (self.buffer(id).storage != Storage::Target).then(|| self.tap(id, after, name))
    }
}

/// The steps of a chain that are called so, in order.
fn called<'a>(steps: &'a [Step], name: &'a str) -> impl Iterator<Item = usize> + 'a {
    let is_called = move |known: &Step| {
        let own = [known.stage.as_str(), known.label.as_str()];
        !known.is_tap() && (own.contains(&name) || name.split_once('/').is_some_and(|named| named == (own[0], own[1])))
    };
    (0..steps.len()).filter(move |&at| is_called(&steps[at]))
}

/// The last step of a name, or the one of several that its number says.
fn find_step(steps: &[Step], name: &str) -> Option<usize> {
    let numbered = || {
        let (name, number) = name.rsplit_once('#')?;
        called(steps, name).nth(number.parse::<usize>().ok()?.checked_sub(1)?)
    };
    called(steps, name).last().or_else(numbered)
}

/// A name for each step that no other one has, and that finds it again: `STAGE/LABEL`, numbered where there are several of it.
pub fn step_names(steps: &[Step]) -> Vec<String> {
    let plain = |step: &Step| format!("{}/{}", step.stage, step.label);
    let name = |(at, step): (usize, &Step)| {
        let name = plain(step);
        let same: Vec<usize> = called(steps, &name).collect();
        match same.iter().position(|&other| other == at) {
            Some(number) if same.len() > 1 => format!("{name}#{}", number + 1),
            _ => name,
        }
    };
    steps.iter().enumerate().map(name).collect()
}
