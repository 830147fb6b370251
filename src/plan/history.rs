//! What outlives a frame: pairs of buffers that the planner swaps, buffers that the next frame changes in place, and what a stage asks for of
//! the frame before.

use super::{Buffer, BufferId, Chain, History, Life, Storage};
use crate::experiment::diagnostic::{Diagnostic, Origin};
use crate::kernel::Elem;

/// A buffer that some stage further down makes, and that was asked for as it was in the frame before.
pub(super) struct Awaited {
    name: String,
    last: BufferId,
    /// What it has to be for who asked.
    elem: Elem,
    /// Only a stage may make it: who asked relies on what is in it.
    is_own: bool,
    stage: String,
    origin: Origin,
}

impl Chain<'_> {
    /// A buffer that the host looks at between frames. Zeros at first.
    pub fn make_for_host(
        &mut self,
        name: &str,
        elem: Elem,
        dims: &[u32],
        unit: &'static str,
        meaning: &str,
    ) -> BufferId {
        self.make_with_life(Life::Host, Buffer::new(name, elem, dims, unit, meaning))
    }

    /// A buffer that the next frame finds as this one leaves it, and changes in place. Zeros after a reset.
    pub fn make_kept(&mut self, name: &str, elem: Elem, dims: &[u32], unit: &'static str, meaning: &str) -> BufferId {
        self.make_with_life(Life::Kept, Buffer::new(name, elem, dims, unit, meaning))
    }

    /// A buffer that a frame writes, and what the frame before wrote there: zeros after a reset.
    pub fn make_history(&mut self, name: &str, elem: Elem, dims: &[u32], unit: &'static str, meaning: &str) -> History {
        let new = Buffer::new(name, elem, dims, unit, meaning);
        let old = Buffer::new(&format!("{name}.last"), elem, dims, unit, "the same of the frame before");
        let next = self.make_with_life(Life::Next, new);
        History { last: self.make_with_life(Life::LastOf(next), old), next }
    }

    fn make_with_life(&mut self, life: Life, buffer: Buffer) -> BufferId {
        self.buffers.push(Buffer { life, ..buffer });
        BufferId(self.buffers.len() - 1)
    }

    /// What the chain leaves in a buffer, as it was in the frame before: a stage that has not had its turn may make it. `elem` is what it has
    /// to be.
    pub fn last_frame(&mut self, name: &str, elem: Elem, origin: &Origin) -> BufferId {
        self.wait_for(name, elem, false, origin)
    }

    /// The same of what a stage of lodlab makes: a kernel that asks for it relies on what is in it.
    pub fn last_frame_of_own(&mut self, name: &str, elem: Elem) -> BufferId {
        let origin = self.origin.clone();
        self.wait_for(name, elem, true, &origin)
    }

    fn wait_for(&mut self, name: &str, elem: Elem, is_own: bool, origin: &Origin) -> BufferId {
        let known = self.awaited.iter().find(|awaited| awaited.name == name).map(|awaited| awaited.last);
        let last = known.unwrap_or_else(|| {
            let old = Buffer::new(&format!("{name}.last"), elem, &[], "", "what the frame before left");
            self.make_with_life(Life::Kept, old)
        });
        let (name, stage, origin) = (name.to_string(), self.stage.clone(), origin.clone());
        self.awaited.push(Awaited { name, last, elem, is_own, stage, origin });
        last
    }

    /// Says that all stages have had their turn: what was asked for of the frame before is there now, or is a mistake.
    pub fn close(&mut self) -> Result<(), Diagnostic> {
        for Awaited { name, last, elem, is_own, stage, origin } in std::mem::take(&mut self.awaited) {
            let Some(next) = self.find(&name) else {
                let message = format!("`{stage}` needs what the frame before left in `{name}`, which no stage makes");
                let message = Diagnostic::input(message).at(&origin, "asked for here");
                let made = self.buffers.iter().filter(|buffer| buffer.life == Life::Frame);
                return Err(match self.whose_turn_comes(&name) {
                    Some(help) => message.help(help),
                    None => message.suggest(&name, made.map(|buffer| buffer.name.as_str())),
                });
            };
            if is_own {
                self.check_own_for(next, &stage, &origin)?;
            }
            let made = self.buffer(next).clone();
            let is_known = self.buffer(last).life == Life::LastOf(next);
            let refuse =
                |what: String| Err(Diagnostic::input(format!("`{name}` {what}")).at(&origin, "asked for here"));
            match (made.storage, made.life) {
                (Storage::Buffer, _) if !made.elem.binds_as(elem) => {
                    return refuse(format!("holds {:?}, and here it is {elem:?}", made.elem));
                }
                (Storage::Buffer, Life::Frame) => {}
                (Storage::Buffer, Life::Next) if is_known => continue,
                (Storage::Input, _) => return refuse("is the same in every frame: bind it as it is".into()),
                (Storage::Target, _) => return refuse("is a render target, of which nothing is kept".into()),
                _ => return refuse("is kept from frame to frame already".into()),
            }
            let Buffer { elem, dims, unit, missing, packing, .. } = made;
            let old = &mut self.buffers[last.0];
            *old = Buffer { elem, dims, unit, missing, packing, life: Life::LastOf(next), ..old.clone() };
            self.buffers[next.0].life = Life::Next;
        }
        Ok(())
    }

    /// A later stage has yet to make it: only what the frame before left there can be bound.
    pub(super) fn is_awaited(&self, id: BufferId) -> bool {
        self.awaited.iter().any(|awaited| awaited.last == id)
    }
}
