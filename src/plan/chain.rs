//! Where a stage states what it does: the buffers it makes and the steps it takes.

use std::sync::Arc;

use glam::UVec2;

use super::history::Awaited;
use super::product::{Product, Products};
use super::{
    Buffer, BufferId, Capacities, Guard, How, LeftOut, Life, Often, Plan, Run, Spread, Step, StepBuilder, Storage, Work,
};
use crate::experiment::diagnostic::{Diagnostic, Origin};
use crate::kernel::{Elem, Kernel, Packing};
use crate::scene::{HEIGHT, SceneData};

/// What is known of the stages besides what they have stated so far, for messages.
#[derive(Clone, Default)]
pub struct Announced {
    /// Stages after the one whose turn it is, and the buffers they make.
    pub later: Vec<(String, Vec<String>)>,
    /// The stages that make a buffer of a name or offer a product.
    pub makers: Option<fn(&str) -> Vec<&'static str>>,
}

const THIS_STAGE: &str = "this stage";

/// A chain while its stages are asked for their steps, in order.
pub struct Chain<'a> {
    pub data: &'a SceneData,
    name: String,
    pub(super) buffers: Vec<Buffer>,
    pub(super) steps: Vec<Step>,
    left_out: Vec<LeftOut>,
    products: Products<BufferId>,
    guards: Vec<Guard>,
    capacities: Capacities,
    /// The samples that the ground is made of, from here on.
    pub(super) ground: BufferId,
    /// Buffers of the frame before, by name, that a later stage has yet to make.
    pub(super) awaited: Vec<Awaited>,
    pub(super) stage: String,
    pub(super) stage_index: usize,
    pub(super) origin: Origin,
    /// What stands at the origin: a stage, or a measure.
    whose: &'static str,
    announced: Announced,
}

impl<'a> Chain<'a> {
    pub fn new(name: &str, data: &'a SceneData, origin: &Origin) -> Self {
        let input = |input: &crate::scene::Input| Buffer {
            storage: Storage::Input,
            packing: input.packing,
            spread: if input.is_of_samples() { Spread::Samples } else { Spread::Numbers },
            ..Buffer::new(input.name, input.elem, &[input.size.y, input.size.x], input.unit, input.meaning)
        };
        let buffers: Vec<Buffer> = data.inputs.iter().map(input).collect();
        let ground = BufferId(buffers.iter().position(|buffer| buffer.name == HEIGHT).unwrap_or(0));
        Self {
            data,
            name: name.into(),
            buffers,
            steps: Vec::new(),
            left_out: Vec::new(),
            products: Products::default(),
            guards: Vec::new(),
            capacities: Capacities::new(),
            ground,
            awaited: Vec::new(),
            stage: String::new(),
            stage_index: 0,
            origin: origin.clone(),
            whose: THIS_STAGE,
            announced: Announced::default(),
        }
    }

    /// Says whose turn it is; mistakes from now on are this stage's.
    pub fn begin_stage(&mut self, name: &str, index: usize, origin: &Origin) {
        self.stage = name.into();
        self.stage_index = index;
        self.origin = origin.clone();
        self.whose = THIS_STAGE;
    }

    /// Says that the stages are done and a measure looks at what they made; mistakes from now on are the measure's.
    pub fn begin_measure(&mut self, name: &str, origin: &Origin) {
        self.stage = name.into();
        self.origin = origin.clone();
        self.whose = "this measure";
        self.announced.later.clear();
    }

    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// Says what else there is, for the message to somebody who has the order wrong or a stage too few.
    pub fn announce(&mut self, announced: Announced) {
        self.announced = announced;
    }

    /// The names that `find` answers to: a frame before this one is not there until the chain is closed.
    fn findable(&self) -> impl Iterator<Item = &str> {
        let ids = (0..self.buffers.len()).map(BufferId).filter(|id| !self.is_awaited(*id));
        ids.map(|id| self.buffers[id.0].name.as_str())
    }

    /// The newest buffer of a name.
    pub fn find(&self, name: &str) -> Option<BufferId> {
        let is_there = |at: &usize| self.buffers[*at].name == name && !self.is_awaited(BufferId(*at));
        (0..self.buffers.len()).rfind(is_there).map(BufferId)
    }

    /// An input of the scene, whatever kernels make under its name.
    pub fn input(&self, name: &str) -> Option<BufferId> {
        let is_input = |buffer: &Buffer| buffer.storage == Storage::Input && buffer.name == name;
        self.buffers.iter().position(is_input).map(BufferId)
    }

    /// A buffer that a stage before this one made, or an input of the scene.
    pub fn read(&self, name: &str) -> Result<BufferId, Diagnostic> {
        self.find(name).ok_or_else(|| {
            let message = format!("`{}` needs the buffer `{name}`, which no stage before it makes", self.stage);
            let message = Diagnostic::input(message).at(&self.origin, self.whose);
            match self.whose_turn_comes(name) {
                Some(help) => message.help(help),
                None => message.suggest(name, self.findable()),
            }
        })
    }

    /// The latest product of a kind that a stage before this one offered.
    pub fn latest<P: Product<BufferId>>(&self) -> Result<P, Diagnostic> {
        self.products.latest().ok_or_else(|| self.missing::<P>())
    }

    /// A message about this stage: "`Stage` .."
    pub(super) fn refusal(&self, what: &str) -> Diagnostic {
        Diagnostic::input(format!("`{}` {what}", self.stage)).at(&self.origin, self.whose)
    }

    /// The message for a product that nobody offered.
    pub fn missing<P: Product<BufferId>>(&self) -> Diagnostic {
        let message = format!("`{}` needs {}, which no stage before it makes", self.stage, P::WHAT);
        let message = Diagnostic::input(message).at(&self.origin, self.whose);
        match self.whose_turn_comes(P::WHAT) {
            Some(help) => message.help(help),
            None => message,
        }
    }

    /// Who makes a buffer or a product: a stage further down, or stages that are not in the chain.
    pub(super) fn whose_turn_comes(&self, what: &str) -> Option<String> {
        let makers = self.announced.makers.map(|makers| makers(what)).unwrap_or_default();
        let is_maker = |(stage, makes): &&(String, Vec<String>)| {
            makes.iter().any(|made| made == what) || makers.contains(&stage.as_str())
        };
        if let Some((stage, _)) = self.announced.later.iter().find(is_maker) {
            return Some(format!(
                "`{stage}` makes it further down, but a chain runs in order: move `{stage}` up; if it needs this stage in turn, the two are a cycle"
            ));
        }
        let named: Vec<String> = makers.iter().map(|maker| format!("`{maker}`")).collect();
        (!named.is_empty()).then(|| format!("{} makes it", named.join(" or ")))
    }

    /// The samples that the ground is made of by now.
    pub fn ground(&self) -> BufferId {
        self.ground
    }

    pub fn buffers(&self) -> &[Buffer] {
        &self.buffers
    }

    pub fn products(&self) -> &Products<BufferId> {
        &self.products
    }

    /// Hands something on to the stages after this one and to the measures.
    pub fn offer<P: Product<BufferId>>(&mut self, product: P) {
        self.products.offer(product);
    }

    /// Like [`Chain::read`], for a buffer that has to be of one kind: any stage can make a buffer of that name.
    /// Kernels that run without bounds checks rely on it.
    pub fn read_as(&self, name: &str, elem: Elem, dims: &[u32]) -> Result<BufferId, Diagnostic> {
        let id = self.read(name)?;
        self.check_kind(id, elem, dims)?;
        Ok(id)
    }

    /// Refuses a buffer that a user's kernel writes: kernels that run without bounds checks rely on what is in it.
    pub fn check_own(&self, id: BufferId) -> Result<(), Diagnostic> {
        self.check_own_for(id, &self.stage, &self.origin)
    }

    /// The same for a stage that has had its turn.
    pub(super) fn check_own_for(&self, id: BufferId, stage: &str, origin: &Origin) -> Result<(), Diagnostic> {
        let mut runs = self.steps.iter().filter_map(|step| step.run().map(|run| (step, run)));
        let is_foreign = |(step, run): &(&Step, &Run)| !run.kernel.trusted && step.writes.contains(&id);
        match runs.find(is_foreign) {
            None => Ok(()),
            Some((_, step)) => Err(Diagnostic::input(format!(
                "`{stage}` relies on what is in `{}`, which `{}` writes",
                self.buffer(id).name,
                step.kernel.name
            ))
            .at(origin, self.whose)
            .help("give what your kernel makes another name")),
        }
    }

    /// Refuses a buffer that is not of one kind.
    pub fn check_kind(&self, id: BufferId, elem: Elem, dims: &[u32]) -> Result<(), Diagnostic> {
        let buffer = self.buffer(id);
        if buffer.elem == elem && buffer.dims == dims {
            return Ok(());
        }
        let message = format!(
            "`{}` needs `{}` as {elem:?} {dims:?}, but here it is {:?} {:?}",
            self.stage, buffer.name, buffer.elem, buffer.dims
        );
        Err(Diagnostic::input(message).at(&self.origin, self.whose))
    }

    /// Columns and rows of a grid of any size with at least two of either.
    pub fn grid_size(&self, id: BufferId, elem: Elem) -> Result<UVec2, Diagnostic> {
        let buffer = self.buffer(id);
        match buffer.dims[..] {
            [rows, columns] if rows >= 2 && columns >= 2 && buffer.elem == elem => Ok(UVec2::new(columns, rows)),
            _ => Err(Diagnostic::input(format!("`{}` needs `{}` as a grid of {elem:?}", self.stage, buffer.name))
                .at(&self.origin, self.whose)
                .help("at least two rows and two columns")),
        }
    }

    pub fn buffer(&self, id: BufferId) -> &Buffer {
        &self.buffers[id.0]
    }

    pub fn make(&mut self, name: &str, elem: Elem, dims: &[u32], unit: &'static str, meaning: &str) -> BufferId {
        self.buffers.push(Buffer::new(name, elem, dims, unit, meaning));
        BufferId(self.buffers.len() - 1)
    }

    /// Lists that overflowed before this plan was made.
    pub fn with_capacities(mut self, capacities: Capacities) -> Self {
        self.capacities = capacities;
        self
    }

    /// How long a list is made: as long as asked for, or as it turned out to need.
    pub fn capacity(&self, list: &str, asked_for: u32) -> u32 {
        self.capacities.get(list).copied().unwrap_or(asked_for)
    }

    /// Says where the GPU leaves how long a list of `capacity` elements had to be.
    pub fn guard(&mut self, list: &str, capacity: u32, needed: BufferId, at: usize) {
        self.guards.push(Guard { list: list.into(), capacity, needed, at });
    }

    /// Negative numbers in a buffer mean "no surface here"; dumped as NaN.
    pub fn set_missing_below_zero(&mut self, buffer: BufferId) {
        self.buffers[buffer.0].missing = Some(-1.0);
    }

    /// Says that each element holds several values.
    pub fn set_packing(&mut self, buffer: BufferId, packing: Packing) {
        self.buffers[buffer.0].packing = packing;
    }

    pub fn set_top_level(&mut self, pyramid: BufferId, level: u32) {
        self.buffers[pyramid.0].top_level = Some(level);
    }

    /// A render target of one or two u32 a pixel, cleared to 0.
    pub fn make_target(&mut self, name: &str, elem: Elem, meaning: &str) -> BufferId {
        let (width, height) = self.data.scene.viewport;
        let id = self.make(name, elem, &[height, width], "", meaning);
        self.buffers[id.0].storage = Storage::Target;
        self.set_spread(id, Spread::Pixels);
        id
    }

    /// How many steps so far write a buffer.
    pub fn steps_writing(&self, buffer: BufferId) -> usize {
        self.steps.iter().filter(|step| step.writes.contains(&buffer)).count()
    }

    /// Something this stage found out it need not do.
    pub fn leave_out(&mut self, what: &str, reason: &str, saved_bytes: u64, saved_threads: u64) {
        let what = format!("{}: {what}", self.stage);
        self.left_out.push(LeftOut { what, reason: reason.into(), saved_bytes, saved_threads });
    }

    /// A compute step of this stage, to be finished with [`StepBuilder::over`] or [`StepBuilder::draw_strip`].
    pub fn step(&mut self, label: &str, kernel: &Arc<Kernel>, entry: &str) -> StepBuilder<'_, 'a> {
        let step = Step {
            stage: self.stage.clone(),
            stage_index: self.stage_index,
            label: label.into(),
            work: Work::Copy { from: BufferId(0), to: BufferId(0) },
            often: Often::EveryFrame,
            writes: Vec::new(),
            reads: Vec::new(),
        };
        let run = Run {
            kernel: kernel.clone(),
            entry: entry.into(),
            bindings: Vec::new(),
            optional: Vec::new(),
            unused: Vec::new(),
            params: Vec::new(),
            blocks: Vec::new(),
            constants: Vec::new(),
            how: How::Groups([1; 3]),
        };
        StepBuilder::new(self, step, run)
    }

    /// The buffers that stages make, in order; of several with one name, the last.
    pub fn made(&self) -> Vec<BufferId> {
        let is_made = |id: &BufferId| {
            let buffer = self.buffer(*id);
            let is_new = buffer.storage != Storage::Input && !matches!(buffer.life, Life::LastOf(_));
            is_new && self.find(&buffer.name) == Some(*id)
        };
        (0..self.buffers.len()).map(BufferId).filter(is_made).collect()
    }

    /// The steps so far.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The buffers that the last step writes: what the chain is for.
    pub fn last_made(&self) -> Vec<BufferId> {
        self.steps.last().map_or(Vec::new(), |step| step.writes.clone())
    }

    pub(super) fn into_draft(self) -> Plan {
        let sees_underside = self.sees_underside();
        Plan {
            chain: self.name,
            buffers: self.buffers,
            steps: self.steps,
            left_out: self.left_out,
            slots: Vec::new(),
            outputs: Vec::new(),
            frames: self.data.cameras().len(),
            sees_underside,
            reused: Default::default(),
            products: self.products,
            guards: self.guards,
            after_surface: Default::default(),
        }
    }
}
