//! A step while a stage says what it binds, sets and runs over; checked against the kernel's own declarations.

use glam::UVec2;

use super::chain::Chain;
use super::{BufferId, How, Run, Step, Storage, Vertices, Work};
use crate::experiment::diagnostic::{Diagnostic, Origin};
use crate::frame::{self, Block};
use crate::kernel::{Binding, BindingKind, Field, GROUND_GROUP, Structure, Value};

/// Steps that a chain has at most. A frame of so many is no method any more, and to plan them takes seconds.
const MOST_STEPS: usize = 20_000;

/// Buffers that a step's kernel touches.
#[derive(Default)]
struct Touched {
    reads: Vec<BufferId>,
    /// Written buffers whose previous contents are read.
    in_place: Vec<BufferId>,
    writes: Vec<BufferId>,
}

/// Finished with [`StepBuilder::over`], [`StepBuilder::over_indirect`] or one of the draws.
pub struct StepBuilder<'c, 'a> {
    chain: &'c mut Chain<'a>,
    step: Step,
    run: Run,
}

impl<'c, 'a> StepBuilder<'c, 'a> {
    pub(super) fn new(chain: &'c mut Chain<'a>, step: Step, run: Run) -> Self {
        Self { chain, step, run }
    }

    pub fn bind(mut self, variable: &str, buffer: BufferId) -> Self {
        self.run.bindings.push((variable.into(), buffer));
        self
    }

    /// Binds a buffer to one of two variables of different types, of which the kernel uses the right one by an `override`.
    pub fn bind_either(self, floats: &str, numbers: &str, buffer: BufferId, is_numbers: bool) -> Self {
        let (used, unused) = if is_numbers { (numbers, floats) } else { (floats, numbers) };
        self.bind(used, buffer).leave_unbound(unused)
    }

    /// A variable that the kernel, with these constants and this entry point, never touches.
    pub fn leave_unbound(mut self, variable: &str) -> Self {
        self.run.unused.push(variable.into());
        self
    }

    /// Binds a buffer that is there only if the kernel, with these constants, looks at it.
    pub fn bind_or_leave(self, variable: &str, buffer: Option<BufferId>) -> Self {
        match buffer {
            Some(buffer) => self.bind(variable, buffer),
            None => self.leave_unbound(variable),
        }
    }

    /// An output that is written only if somebody wants it; `constant` is the override that says so.
    pub fn bind_if_wanted(mut self, variable: &str, buffer: BufferId, constant: &str) -> Self {
        self.run.optional.push((variable.into(), buffer, constant.into()));
        self
    }

    /// A parameter that is the same in all frames. What depends on the frame comes in blocks: see [`crate::frame`].
    pub fn set(mut self, field: &str, value: impl Into<Value>) -> Self {
        self.run.params.push((field.into(), value.into()));
        self
    }

    pub fn constant(mut self, name: &str, value: f64) -> Self {
        self.run.constants.push((name.into(), value));
        self
    }

    /// Runs one thread an element of a rectangle.
    pub fn over(mut self, size: UVec2) -> Result<(), Diagnostic> {
        let workgroup = self.run.kernel.entry(&self.run.entry)?.workgroup_size;
        self.run.how = How::Groups([size.x.div_ceil(workgroup[0]), size.y.div_ceil(workgroup[1]), 1]);
        self.push()
    }

    /// Runs as many workgroups as the three u32 in `buffer` say; zero of them is nothing at all.
    pub fn over_indirect(mut self, buffer: BufferId) -> Result<(), Diagnostic> {
        self.run.how = How::Indirect(buffer);
        self.step.reads.push(buffer);
        self.push()
    }

    /// Draws one strip of triangles and keeps the nearest fragments.
    pub fn draw_strip(self, strip: Vertices, target: BufferId, fragment: &str) -> Result<(), Diagnostic> {
        self.draw(strip, target, fragment)
    }

    /// Draws as many triangles as the buffer says (see [`Vertices::List`]).
    pub fn draw_list(mut self, count: BufferId, target: BufferId, fragment: &str) -> Result<(), Diagnostic> {
        self.step.reads.push(count);
        self.draw(Vertices::List(count), target, fragment)
    }

    fn draw(mut self, vertices: Vertices, target: BufferId, fragment: &str) -> Result<(), Diagnostic> {
        self.run.how = How::Draw { vertices, target, fragment: fragment.into() };
        self.step.writes.push(target);
        self.push()
    }

    /// Checks the step against its kernel's reflection and adds it to the chain.
    fn push(mut self) -> Result<(), Diagnostic> {
        if self.chain.steps.len() >= MOST_STEPS {
            return Err(Diagnostic::input(format!("this chain has more than {MOST_STEPS} steps"))
                .at(&self.chain.origin, "with this stage")
                .help("repeat kernels less often, or make several chains of it"));
        }
        let kernel = self.run.kernel.clone();
        let mut entries = vec![kernel.entry(&self.run.entry)?];
        if let How::Draw { fragment, .. } = &self.run.how {
            entries.push(kernel.entry(fragment)?);
        }
        let bindings: Vec<&Binding> = entries.iter().flat_map(|entry| &entry.bindings).collect();
        self.bind_ground(&bindings)?;
        self.run.constants.extend(self.chain.ground_constants(&kernel));
        let mut touched = Touched::default();
        for binding in &bindings {
            self.check_binding(binding, &mut touched)?;
        }
        self.check_writes(&touched)?;
        let known = || bindings.iter().map(|binding| binding.name.as_str());
        if let Some((name, _)) = self.run.bindings.iter().find(|(name, _)| known().all(|other| other != name)) {
            return Err(Diagnostic::input(format!("the kernel `{}` uses no binding `{name}`", kernel.name))
                .at(&self.chain.origin, "bound here")
                .suggest(name, known()));
        }
        let structures = bindings.iter().filter_map(|binding| match &binding.kind {
            BindingKind::Params(structure) => Some(structure),
            _ => None,
        });
        let used: Vec<&str> =
            structures.flat_map(|structure| &structure.fields).map(|field| field.name.as_str()).collect();
        self.run.params.retain(|(name, _)| used.contains(&name.as_str()));
        self.step.reads.extend(touched.reads);
        self.step.reads.extend(touched.in_place);
        self.step.writes.extend(touched.writes);
        self.step.work = Work::Run(Box::new(self.run));
        self.chain.steps.push(self.step);
        Ok(())
    }

    /// Attaches what stands behind the functions of the ground.
    fn bind_ground(&mut self, bindings: &[&Binding]) -> Result<(), Diagnostic> {
        for Binding { name, group, kind, origin, .. } in bindings {
            let is_buffer = matches!(kind, BindingKind::Storage { .. } | BindingKind::Image { .. });
            let is_open = self.attached(name).is_none() && !self.run.unused.contains(name);
            if *group == GROUND_GROUP && is_buffer && is_open {
                let id = self.chain.ground_buffer(name, origin)?;
                self.run.bindings.push((name.clone(), id));
            }
        }
        Ok(())
    }

    /// The buffer that is attached to a variable, wanted or not.
    fn attached(&self, variable: &str) -> Option<BufferId> {
        let always = self.run.bindings.iter().map(|(name, id)| (name, *id));
        let optional = self.run.optional.iter().map(|(name, id, _)| (name, *id));
        always.chain(optional).find(|(name, _)| *name == variable).map(|(_, id)| id)
    }

    /// Refuses a buffer that is not what the variable declares, and notes how the kernel uses it.
    fn check_binding(&mut self, binding: &Binding, touched: &mut Touched) -> Result<(), Diagnostic> {
        let Binding { name, kind, origin, .. } = binding;
        match (kind, self.attached(name)) {
            (BindingKind::Params(structure), _) => self.check_params(structure),
            (BindingKind::Sampler, _) => Ok(()),
            (_, None) if self.run.unused.contains(name) => Ok(()),
            (_, None) => Err(self.mistake(format!("`{name}` is not bound to a buffer"), origin)),
            (BindingKind::Storage { elem, length, read, written }, Some(id)) => {
                let buffer = self.chain.buffer(id);
                if buffer.storage == Storage::Target {
                    let message = format!("`{}` is a render target; bind it as `texture_2d<u32>`", buffer.name);
                    return Err(self.mistake(message, origin));
                }
                // of what a later stage makes nothing is known yet
                if !buffer.elem.binds_as(*elem) && !self.chain.is_awaited(id) {
                    let (held, buffer) = (buffer.elem, &buffer.name);
                    let message = format!("`{name}` is an array of {elem:?}, but the buffer `{buffer}` holds {held:?}");
                    return Err(self.mistake(message, origin));
                }
                let needed = length.map_or(0, |length| u64::from(length) * elem.bytes());
                if needed > buffer.bytes() && !self.chain.is_awaited(id) {
                    let (bytes, buffer) = (buffer.bytes(), &buffer.name);
                    let message = format!("`{name}` takes {needed} bytes, but the buffer `{buffer}` has {bytes}");
                    let help = "an array without a length has as many elements as its buffer";
                    return Err(self.mistake(message, origin).help(help));
                }
                // an update in place: the previous contents are an input
                let updates = *read && self.chain.steps.iter().any(|step| step.writes.contains(&id));
                match *written {
                    false => touched.reads.push(id),
                    true => touched.writes.push(id),
                }
                if *written && updates {
                    touched.in_place.push(id);
                }
                Ok(())
            }
            (BindingKind::Image { float }, Some(id)) => {
                let buffer = self.chain.buffer(id);
                let (storage, what) =
                    if *float { (Storage::Input, "an input") } else { (Storage::Target, "a render target") };
                if buffer.storage != storage {
                    let message = format!("`{name}` is an image of {what}, which the buffer `{}` is not", buffer.name);
                    return Err(self.mistake(message, origin));
                }
                touched.reads.push(id);
                Ok(())
            }
        }
    }

    /// Refuses to write what the kernel reads under another name, or an input.
    fn check_writes(&self, touched: &Touched) -> Result<(), Diagnostic> {
        let is_read = |id: &BufferId| touched.reads.contains(id);
        let is_input = |id: &BufferId| self.chain.buffer(*id).storage == Storage::Input;
        let is_ground = |id: &BufferId| *id == self.chain.ground;
        let Some(id) = touched.writes.iter().find(|id| is_input(id) || is_ground(id) || is_read(id)) else {
            return Ok(());
        };
        let what = match (is_read(id), is_input(id)) {
            (true, _) => "is read and written by the same kernel",
            (false, true) => "is an input of the scene and cannot be written",
            (false, false) => "is the ground of the stages before this one and cannot be changed in place",
        };
        Err(Diagnostic::input(format!("`{}` {what}", self.chain.buffer(*id).name))
            .at(&self.chain.origin, "this stage")
            .help("write a new buffer, or use `ping_pong`"))
    }

    /// Fills the blocks of a structure, and checks the fields that are left.
    fn check_params(&mut self, structure: &Structure) -> Result<(), Diagnostic> {
        // the outermost structure that is a block is one block, with what is in it
        let mut blocks: Vec<(String, &'static Block)> = Vec::new();
        for nested in &structure.nested {
            if let Some(block) = frame::block(&nested.name)
                && blocks.iter().all(|(outer, _)| !nested.prefix.starts_with(outer.as_str()))
            {
                blocks.push((nested.prefix.clone(), block));
            }
        }
        for field in &structure.fields {
            let block = blocks.iter().find(|(prefix, _)| field.name.starts_with(prefix.as_str()));
            match block {
                Some((prefix, block)) => self.check_in_block(field, &field.name[prefix.len()..], block)?,
                None => self.check_param(field)?,
            }
        }
        let is_new = |block: &(String, &'static Block)| !self.run.blocks.contains(block);
        let new: Vec<_> = blocks.into_iter().filter(is_new).collect();
        self.run.blocks.extend(new);
        Ok(())
    }

    /// A field of a block has to be one that the block fills.
    fn check_in_block(&self, field: &Field, name: &str, block: &Block) -> Result<(), Diagnostic> {
        match block.fields.iter().find(|(known, _)| *known == name) {
            Some((_, kind)) if *kind == field.kind => Ok(()),
            Some((_, kind)) => {
                let message = format!("`{}` of a `{}` is {kind:?}, not {:?}", name, block.name, field.kind);
                Err(self.mistake(message, &field.origin))
            }
            None => Err(self
                .mistake(format!("a `{}` is filled in, and has no field `{name}`", block.name), &field.origin)
                .help(format!("give your structure another name than `{}`, or leave the field out", block.name))),
        }
    }

    fn check_param(&mut self, field: &Field) -> Result<(), Diagnostic> {
        let value = self.run.params.iter().find(|(name, _)| *name == field.name).map(|(_, value)| *value);
        let value = value.or_else(|| self.usual(field));
        let Some(value) = value else {
            let message = format!("the parameter `{}` has no value", field.name);
            let help = match self.run.kernel.trusted {
                true => format!("`plan` of this stage gives it one with `.set(\"{}\", ..)`", field.name),
                false => format!("give it one with `params: ({}: ..)`", field.name),
            };
            return Err(self.mistake(message, &field.origin).help(help));
        };
        if value.kind != field.kind {
            let message = format!("the parameter `{}` is {:?}, but got {value:?}", field.name, field.kind);
            return Err(self.mistake(message, &field.origin));
        }
        self.run.params.push((field.name.clone(), value));
        Ok(())
    }

    /// A parameter that nobody gave a value and that can mean one thing only.
    fn usual(&self, field: &Field) -> Option<Value> {
        let cell_m = Value::from(self.chain.lattice().cell_m.as_vec2().to_array());
        (field.name == "cell_m" && field.kind == cell_m.kind).then_some(cell_m)
    }

    fn mistake(&self, message: String, kernel: &Origin) -> Diagnostic {
        Diagnostic::input(message).at(kernel, "declared here").at(&self.chain.origin, "used by this stage")
    }
}
