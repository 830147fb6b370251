//! Where a stage states what it does: the buffers it makes and the steps it takes.

use std::sync::Arc;

use glam::UVec2;

use super::{Buffer, BufferId, Capacities, Guard, LeftOut, Often, Plan, SceneData, Step, StepBuilder, Storage, Work};
use crate::experiment::diagnostic::{Diagnostic, Origin};
use crate::kernel::{Elem, Kernel};

/// What a method says of its picture: nothing that the mesh shows, or fails to show, is further off than this.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Promise {
    pub bound_px: f64,
    /// The mesh is nowhere under the surface and its cells' errors are bounds; otherwise they are estimates.
    pub proven: bool,
}

/// What a list of numbers was made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Listing {
    /// Elements above `above` in there.
    pub of: BufferId,
    pub above: f64,
    /// So many rows make one element, which has the number of the first.
    pub rows: u32,
}

/// A chain while its stages are asked for their steps, in order.
pub struct Chain<'a> {
    pub data: &'a SceneData,
    name: String,
    pub(super) buffers: Vec<Buffer>,
    pub(super) steps: Vec<Step>,
    left_out: Vec<LeftOut>,
    /// What was promised of which buffers: vertices, and what was drawn of them.
    promises: Vec<(Promise, BufferId)>,
    /// What lists have the numbers of.
    listings: Vec<(Listing, BufferId)>,
    guards: Vec<Guard>,
    capacities: Capacities,
    stage: String,
    stage_index: usize,
    pub(super) origin: Origin,
    /// Stages after this one and what they make.
    later: Vec<(String, Vec<String>)>,
}

impl<'a> Chain<'a> {
    pub fn new(name: &str, data: &'a SceneData, origin: &Origin) -> Self {
        let size = data.terrain.size;
        let height = Buffer {
            name: "height".into(),
            elem: Elem::F32,
            dims: vec![size.y, size.x],
            unit: "m",
            meaning: "height samples, row 0 is north".into(),
            storage: Storage::Input,
            missing: None,
            top_level: None,
            often: Often::Once,
            lifetime: None,
            slot: None,
            kept: false,
        };
        Self {
            data,
            name: name.into(),
            buffers: vec![height],
            steps: Vec::new(),
            left_out: Vec::new(),
            promises: Vec::new(),
            listings: Vec::new(),
            guards: Vec::new(),
            capacities: Capacities::new(),
            stage: String::new(),
            stage_index: 0,
            origin: origin.clone(),
            later: Vec::new(),
        }
    }

    /// Says whose turn it is; mistakes from now on are this stage's.
    pub fn begin_stage(&mut self, name: &str, index: usize, origin: &Origin) {
        self.stage = name.into();
        self.stage_index = index;
        self.origin = origin.clone();
    }

    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// Says what the stages after this one make, for the message to somebody who has the order wrong.
    pub fn announce(&mut self, later: Vec<(String, Vec<String>)>) {
        self.later = later;
    }

    pub fn has(&self, name: &str) -> bool {
        self.buffers.iter().any(|buffer| buffer.name == name)
    }

    /// A buffer that a stage before this one made, or the terrain's `height`.
    pub fn read(&self, name: &str) -> Result<BufferId, Diagnostic> {
        if let Some(at) = self.buffers.iter().rposition(|buffer| buffer.name == name) {
            return Ok(BufferId(at));
        }
        let later = self.later.iter().find(|(_, makes)| makes.iter().any(|made| made == name));
        let message = format!("`{}` needs the buffer `{name}`, which no stage before it makes", self.stage);
        let message = Diagnostic::input(message).at(&self.origin, "this stage");
        Err(match later {
            Some((stage, _)) => message.help(format!(
                "`{stage}` makes it further down, but a chain runs in order: move `{stage}` up; if it needs this stage in turn, the two are a cycle"
            )),
            None => message.suggest(name, self.buffers.iter().map(|buffer| buffer.name.as_str())),
        })
    }

    /// Like [`Chain::read`], for a buffer that has to be of one kind: any stage can make a buffer of that name.
    /// Kernels that run without bounds checks rely on it.
    pub fn read_as(&self, name: &str, elem: Elem, dims: &[u32]) -> Result<BufferId, Diagnostic> {
        let id = self.read(name)?;
        let buffer = self.buffer(id);
        if buffer.elem == elem && buffer.dims == dims {
            return Ok(id);
        }
        let message = format!(
            "`{}` needs `{name}` as {elem:?} {dims:?}, but here it is {:?} {:?}",
            self.stage, buffer.elem, buffer.dims
        );
        Err(Diagnostic::input(message).at(&self.origin, "this stage"))
    }

    /// Like [`Chain::read_as`], for a buffer whose contents kernels of this crate rely on: it may not be a user's.
    pub fn read_own(&self, name: &str, elem: Elem, dims: &[u32]) -> Result<BufferId, Diagnostic> {
        let id = self.read_as(name, elem, dims)?;
        let is_foreign = |step: &&Step| !step.kernel.trusted && step.writes.contains(&id);
        match self.steps.iter().find(is_foreign) {
            None => Ok(id),
            Some(step) => Err(Diagnostic::input(format!(
                "`{}` relies on what is in `{name}`, which `{}` writes",
                self.stage, step.kernel.name
            ))
            .at(&self.origin, "this stage")
            .help("give what your kernel makes another name")),
        }
    }

    /// Like [`Chain::read_as`], for a grid of any size with at least two rows and columns; returns both.
    pub fn read_grid(&self, name: &str, elem: Elem) -> Result<(BufferId, UVec2), Diagnostic> {
        let id = self.read(name)?;
        let buffer = self.buffer(id);
        match buffer.dims[..] {
            [rows, columns] if rows >= 2 && columns >= 2 && buffer.elem == elem => Ok((id, UVec2::new(columns, rows))),
            _ => Err(Diagnostic::input(format!("`{}` needs `{name}` as a grid of {elem:?}", self.stage))
                .at(&self.origin, "this stage")
                .help("at least two rows and two columns")),
        }
    }

    pub fn buffer(&self, id: BufferId) -> &Buffer {
        &self.buffers[id.0]
    }

    pub fn make(&mut self, name: &str, elem: Elem, dims: &[u32], unit: &'static str, meaning: &str) -> BufferId {
        self.buffers.push(Buffer {
            name: name.into(),
            elem,
            dims: dims.to_vec(),
            unit,
            meaning: meaning.into(),
            storage: Storage::Buffer,
            missing: None,
            top_level: None,
            often: Often::EveryFrame,
            lifetime: None,
            slot: None,
            kept: false,
        });
        BufferId(self.buffers.len() - 1)
    }

    /// A buffer in which the next frame finds what this one left; zeros in the first.
    pub fn make_kept(&mut self, name: &str, elem: Elem, dims: &[u32], unit: &'static str, meaning: &str) -> BufferId {
        let id = self.make(name, elem, dims, unit, meaning);
        self.buffers[id.0].kept = true;
        id
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

    /// Distances along the pixel's ray in metres, negative where there is no surface.
    pub fn make_distance(&mut self) -> BufferId {
        let (width, height) = self.data.scene.viewport;
        let id = self.make("distance", Elem::F32, &[height, width], "m", "distance along the pixel's ray");
        self.buffers[id.0].missing = Some(-1.0);
        id
    }

    pub fn set_top_level(&mut self, pyramid: BufferId, level: u32) {
        self.buffers[pyramid.0].top_level = Some(level);
    }

    /// A render target of one or two u32 a pixel, cleared to 0.
    pub fn make_target(&mut self, name: &str, elem: Elem, meaning: &str) -> BufferId {
        let (width, height) = self.data.scene.viewport;
        let id = self.make(name, elem, &[height, width], "", meaning);
        self.buffers[id.0].storage = Storage::Target;
        id
    }

    /// Says how far off a picture of these vertices, or this picture, may be.
    pub fn promise(&mut self, promise: Promise, buffer: BufferId) {
        self.promises.push((promise, buffer));
    }

    /// What was said of a buffer; another one of the same name has its own.
    pub fn promise_of(&self, buffer: BufferId) -> Option<Promise> {
        self.promises.iter().find(|(_, of)| *of == buffer).map(|(promise, _)| *promise)
    }

    /// Says what a list has the numbers of.
    pub fn list(&mut self, list: BufferId, listing: Listing) {
        self.listings.push((listing, list));
    }

    /// What was said of a list; nothing, if a kernel of the user's made it.
    pub fn listing_of(&self, list: BufferId) -> Option<Listing> {
        self.listings.iter().find(|(_, of)| *of == list).map(|(listing, _)| *listing)
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
            kernel: kernel.clone(),
            entry: entry.into(),
            bindings: Vec::new(),
            optional: Vec::new(),
            spare: Vec::new(),
            params: Vec::new(),
            constants: Vec::new(),
            work: Work::Groups([1; 3]),
            often: Often::EveryFrame,
            writes: Vec::new(),
            reads: Vec::new(),
        };
        StepBuilder::new(self, step)
    }

    /// Names of the buffers that stages make, in order.
    pub fn made(&self) -> Vec<String> {
        self.buffers
            .iter()
            .filter(|buffer| buffer.storage != Storage::Input)
            .map(|buffer| buffer.name.clone())
            .collect()
    }

    /// Names of the buffers that the last step writes: what the chain is for.
    pub fn last_made(&self) -> Vec<String> {
        let last = self.steps.last().map_or(&[][..], |step| &step.writes);
        last.iter().map(|id| self.buffers[id.0].name.clone()).collect()
    }

    pub(super) fn into_draft(self) -> Result<Plan, Diagnostic> {
        let promise = self.read("distance").ok().and_then(|distance| self.promise_of(distance));
        Ok(Plan {
            chain: self.name,
            buffers: self.buffers,
            steps: self.steps,
            left_out: self.left_out,
            slots: Vec::new(),
            outputs: Vec::new(),
            frames: self.data.cameras.len(),
            promise,
            guards: self.guards,
        })
    }
}
