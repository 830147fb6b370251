//! Where a stage states what it does: the buffers it makes and the steps it takes.

use std::sync::Arc;

use glam::{DVec3, UVec2};

use super::{Buffer, BufferId, Capacities, Guard, LeftOut, Often, Plan, Series, Step, Storage, Value, Vertices, Work};
use crate::camera::Camera;
use crate::experiment::diagnostic::{Diagnostic, Origin};
use crate::experiment::scene::Scene;
use crate::kernel::{BindingKind, Elem, FieldKind, Kernel};
use crate::terrain::HeightField;

/// A scene with its terrain in memory and the cameras of all frames.
#[derive(Clone, Debug)]
pub struct SceneData {
    pub scene: Scene,
    pub terrain: Arc<HeightField>,
    pub cameras: Vec<Camera>,
    /// Lowest and highest height of the terrain in metres.
    pub range_m: (f64, f64),
    /// The terrain in at most 16 x 16 parts, each with its own lowest and highest height.
    pub tiles: Vec<Tile>,
    /// A frame's eye is under the surface or outside the terrain, so that rays can run under the surface.
    pub sees_underside: bool,
}

/// Samples `columns.0..=columns.1`, `rows.0..=rows.1` and their height range in metres.
#[derive(Clone, Copy, Debug)]
pub struct Tile {
    pub columns: (u32, u32),
    pub rows: (u32, u32),
    pub low_m: f32,
    pub high_m: f32,
}

/// Tiles a side.
const TILES: u32 = 16;

fn tiles(terrain: &HeightField) -> Vec<Tile> {
    let last = terrain.size - UVec2::ONE;
    let count = last.min(UVec2::splat(TILES));
    let part = |at: u32, last: u32, count: u32| (last * at / count, last * (at + 1) / count);
    let mut tiles = Vec::new();
    for y in 0..count.y {
        for x in 0..count.x {
            let (columns, rows) = (part(x, last.x, count.x), part(y, last.y, count.y));
            let heights = (rows.0..=rows.1).flat_map(|row| {
                let start = (row * terrain.size.x) as usize;
                &terrain.heights_m[start + columns.0 as usize..=start + columns.1 as usize]
            });
            let (low_m, high_m) = heights.fold((f32::MAX, f32::MIN), |(low, high), &h| (low.min(h), high.max(h)));
            tiles.push(Tile { columns, rows, low_m, high_m });
        }
    }
    tiles
}

impl SceneData {
    pub fn new(scene: Scene, terrain: Arc<HeightField>) -> Self {
        let cameras = crate::camera::path(&scene, &terrain);
        let extent_m = terrain.extent_m();
        let sees_underside = cameras.iter().any(|camera| {
            let ground = camera.eye_m.truncate();
            ground.cmplt(glam::DVec2::ZERO).any()
                || ground.cmpgt(extent_m).any()
                || camera.eye_m.z < terrain.surface_m(ground, scene.surface)
        });
        Self { range_m: terrain.range_m(), tiles: tiles(&terrain), scene, terrain, cameras, sees_underside }
    }

    /// The steepest slope of the surface, as a tangent.
    pub fn steepest(&self) -> f64 {
        self.terrain.steepest(self.scene.surface)
    }

    /// Every height is the same.
    pub fn is_flat(&self) -> bool {
        self.range_m.0 == self.range_m.1
    }
}

/// What a method says of its picture: nothing that the mesh shows, or fails to show, is further off than this.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Promise {
    pub bound_px: f64,
    /// The mesh is nowhere under the surface and its cells' errors are bounds; otherwise they are estimates.
    pub proven: bool,
}

/// A chain while its stages are asked for their steps, in order.
pub struct Chain<'a> {
    pub data: &'a SceneData,
    name: String,
    buffers: Vec<Buffer>,
    steps: Vec<Step>,
    left_out: Vec<LeftOut>,
    /// What was promised of which buffers: vertices, and what was drawn of them.
    promises: Vec<(Promise, BufferId)>,
    /// Lists whose elements stand for several rows of pixels, and how many.
    rows: Vec<(u32, BufferId)>,
    guards: Vec<Guard>,
    capacities: Capacities,
    stage: String,
    stage_index: usize,
    origin: Origin,
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
            rows: Vec::new(),
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

    /// A list of elements' numbers, each of which stands for so many rows.
    pub fn make_list(&mut self, name: &str, length: u32, rows: u32, meaning: &str) -> BufferId {
        let list = self.make(name, Elem::U32, &[length], "", meaning);
        self.rows.push((rows, list));
        list
    }

    /// How many rows an element of a list stands for; one, if nobody said otherwise.
    pub fn rows_of(&self, list: BufferId) -> u32 {
        self.rows.iter().find(|(_, of)| *of == list).map_or(1, |(rows, _)| *rows)
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
        StepBuilder { chain: self, step }
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

pub struct StepBuilder<'c, 'a> {
    chain: &'c mut Chain<'a>,
    step: Step,
}

impl<'a> StepBuilder<'_, 'a> {
    pub fn data(&self) -> &'a SceneData {
        self.chain.data
    }

    pub fn bind(mut self, variable: &str, buffer: BufferId) -> Self {
        self.step.bindings.push((variable.into(), buffer));
        self
    }

    /// Binds a buffer to one of two variables of different types, of which the kernel uses the right one by an `override`.
    pub fn bind_either(self, floats: &str, numbers: &str, buffer: BufferId, is_numbers: bool) -> Self {
        let (used, spare) = if is_numbers { (numbers, floats) } else { (floats, numbers) };
        self.bind(used, buffer).leave_unbound(spare)
    }

    /// A variable that the kernel, with these constants and this entry point, never touches.
    pub fn leave_unbound(mut self, variable: &str) -> Self {
        self.step.spare.push(variable.into());
        self
    }

    /// An output that is written only if somebody wants it; `constant` is the override that says so.
    pub fn bind_if_wanted(mut self, variable: &str, buffer: BufferId, constant: &str) -> Self {
        self.step.optional.push((variable.into(), buffer, constant.into()));
        self
    }

    pub fn set(mut self, field: &str, value: impl Into<Value>) -> Self {
        self.step.params.push((field.into(), Series::Same(value.into())));
        self
    }

    /// One value a frame, in order.
    pub fn set_series<V: Into<Value>>(mut self, field: &str, values: impl Iterator<Item = V>) -> Self {
        self.step.params.push((field.into(), Series::PerFrame(values.map(Into::into).collect())));
        self
    }

    pub fn set_per_frame<V: Into<Value>>(self, field: &str, value: impl Fn(&Camera) -> V) -> Self {
        let data = self.chain.data;
        self.set_series(field, data.cameras.iter().map(value))
    }

    pub fn constant(mut self, name: &str, value: f64) -> Self {
        self.step.constants.push((name.into(), value));
        self
    }

    /// The fields of `Camera` in `kernels/lib/camera.wgsl`.
    pub fn set_camera(self) -> Self {
        let parts = |part: usize, hi: bool| {
            move |camera: &Camera| {
                let (high, low) = split(camera.pixel_basis()[part]);
                if hi { high } else { low }
            }
        };
        let (width, height) = self.chain.data.scene.viewport;
        self.set("camera.viewport", [width, height])
            .set_per_frame("camera.right_hi", parts(0, true))
            .set_per_frame("camera.right_lo", parts(0, false))
            .set_per_frame("camera.down_hi", parts(1, true))
            .set_per_frame("camera.down_lo", parts(1, false))
            .set_per_frame("camera.corner_hi", parts(2, true))
            .set_per_frame("camera.corner_lo", parts(2, false))
    }

    /// The fields of `Terrain` in `kernels/lib/terrain.wgsl`.
    pub fn set_terrain(self) -> Self {
        let terrain = self.chain.data.terrain.clone();
        let samples = move |camera: &Camera| terrain.sample_from_world(camera.eye_m.truncate());
        let fraction = samples.clone();
        let terrain = &self.chain.data.terrain;
        let (size, cell_m) = (terrain.size.to_array(), terrain.cell_m.as_vec2().to_array());
        self.set("terrain.size", size)
            .set("terrain.cell_m", cell_m)
            .set_per_frame("terrain.eye_cell", move |camera| samples(camera).floor().as_ivec2().to_array())
            .set_per_frame("terrain.eye_fraction", move |camera| {
                let sample = fraction(camera);
                (sample - sample.floor()).as_vec2().to_array()
            })
            .set_per_frame("terrain.eye_height_m", |camera| {
                let high = camera.eye_m.z as f32;
                [high, (camera.eye_m.z - f64::from(high)) as f32]
            })
    }

    /// Runs one thread an element of a rectangle.
    pub fn over(mut self, size: UVec2) -> Result<(), Diagnostic> {
        let workgroup = self.step.kernel.entry(&self.step.entry)?.workgroup_size;
        self.step.work = Work::Groups([size.x.div_ceil(workgroup[0]), size.y.div_ceil(workgroup[1]), 1]);
        self.push()
    }

    /// Runs as many workgroups as the three u32 in `buffer` say; zero of them is nothing at all.
    pub fn over_indirect(mut self, buffer: BufferId) -> Result<(), Diagnostic> {
        self.step.work = Work::Indirect(buffer);
        self.step.reads.push(buffer);
        self.push()
    }

    /// Draws one strip of triangles and keeps the nearest fragments.
    pub fn draw_strip(self, vertices: u32, target: BufferId, fragment: &str) -> Result<(), Diagnostic> {
        self.draw(Vertices::Strip(vertices), target, fragment)
    }

    /// Draws as many triangles as the buffer says (see [`Vertices::List`]).
    pub fn draw_list(mut self, count: BufferId, target: BufferId, fragment: &str) -> Result<(), Diagnostic> {
        self.step.reads.push(count);
        self.draw(Vertices::List(count), target, fragment)
    }

    fn draw(mut self, vertices: Vertices, target: BufferId, fragment: &str) -> Result<(), Diagnostic> {
        self.step.work = Work::Draw { vertices, target, fragment: fragment.into() };
        self.step.writes.push(target);
        self.push()
    }

    /// Checks the step against its kernel's reflection and adds it to the chain.
    fn push(mut self) -> Result<(), Diagnostic> {
        let mut entries = vec![self.step.kernel.entry(&self.step.entry)?];
        if let Work::Draw { fragment, .. } = &self.step.work {
            entries.push(self.step.kernel.entry(fragment)?);
        }
        let (mut reads, mut in_place, mut writes) = (Vec::new(), Vec::new(), Vec::new());
        for binding in entries.iter().flat_map(|entry| &entry.bindings) {
            let bound = self.step.bindings.iter().map(|(name, id)| (name, *id));
            let optional = self.step.optional.iter().map(|(name, id, _)| (name, *id));
            let buffer = bound.chain(optional).find(|(name, _)| **name == binding.name).map(|(_, id)| id);
            match (&binding.kind, buffer) {
                (BindingKind::Params(structure), _) => self.check_params(structure)?,
                (BindingKind::Sampler, _) => {}
                (_, None) if self.step.spare.contains(&binding.name) => {}
                (_, None) => {
                    return Err(self.mistake(format!("`{}` is not bound to a buffer", binding.name), &binding.origin));
                }
                (BindingKind::Storage { elem, read, written }, Some(id)) => {
                    let buffer = self.chain.buffer(id);
                    if buffer.storage == Storage::Target {
                        let message = format!("`{}` is a render target; bind it as `texture_2d<u32>`", buffer.name);
                        return Err(self.mistake(message, &binding.origin));
                    }
                    if !buffer.elem.binds_as(*elem) {
                        let message = format!(
                            "`{}` is an array of {elem:?}, but the buffer `{}` holds {:?}",
                            binding.name, buffer.name, buffer.elem
                        );
                        return Err(self.mistake(message, &binding.origin));
                    }
                    match (*read, *written) {
                        (_, false) => reads.push(id),
                        // what an earlier step left there goes into what this one leaves
                        (true, true) if self.chain.steps.iter().any(|step| step.writes.contains(&id)) => {
                            in_place.push(id);
                            writes.push(id);
                        }
                        _ => writes.push(id),
                    }
                }
                (BindingKind::Image { float }, Some(id)) => {
                    let buffer = self.chain.buffer(id);
                    let storage = if *float { Storage::Input } else { Storage::Target };
                    if buffer.storage != storage {
                        let what = if *float { "the terrain" } else { "a render target" };
                        let message = format!(
                            "`{}` is an image of {what}, which the buffer `{}` is not",
                            binding.name, buffer.name
                        );
                        return Err(self.mistake(message, &binding.origin));
                    }
                    reads.push(id);
                }
            }
        }
        if let Some(&id) =
            writes.iter().find(|&id| self.chain.buffer(*id).storage == Storage::Input || reads.contains(id))
        {
            let name = &self.chain.buffer(id).name;
            let what = if reads.contains(&id) {
                "is read and written by the same kernel"
            } else {
                "is the terrain and cannot be written"
            };
            return Err(Diagnostic::input(format!("`{name}` {what}"))
                .at(&self.chain.origin, "this stage")
                .help("write a new buffer, or use `ping_pong`"));
        }
        let known: Vec<&String> =
            entries.iter().flat_map(|entry| &entry.bindings).map(|binding| &binding.name).collect();
        if let Some((name, _)) = self.step.bindings.iter().find(|(name, _)| !known.contains(&name)) {
            return Err(Diagnostic::input(format!("the kernel `{}` uses no binding `{name}`", self.step.kernel.name))
                .at(&self.chain.origin, "bound here")
                .suggest(name, known.iter().map(|name| name.as_str())));
        }
        let used: Vec<String> = entries
            .iter()
            .flat_map(|entry| &entry.bindings)
            .flat_map(|binding| match &binding.kind {
                BindingKind::Params(structure) => structure.fields.iter().map(|field| field.name.clone()).collect(),
                _ => Vec::new(),
            })
            .collect();
        self.step.params.retain(|(name, _)| used.contains(name));
        self.step.reads.extend(reads);
        self.step.reads.extend(in_place);
        self.step.writes.extend(writes);
        self.chain.steps.push(self.step);
        Ok(())
    }

    fn check_params(&self, structure: &crate::kernel::Structure) -> Result<(), Diagnostic> {
        for field in &structure.fields {
            let Some((_, series)) = self.step.params.iter().find(|(name, _)| *name == field.name) else {
                return Err(self.mistake(format!("the parameter `{}` has no value", field.name), &field.origin));
            };
            let fits = match (series.at(0), field.kind) {
                (Value::F32(v), FieldKind::F32(n)) => v.len() == n as usize,
                (Value::U32(v), FieldKind::U32(n)) => v.len() == n as usize,
                (Value::I32(v), FieldKind::I32(n)) => v.len() == n as usize,
                _ => false,
            };
            if !fits {
                let message = format!("the parameter `{}` is {:?}, but got {:?}", field.name, field.kind, series.at(0));
                return Err(self.mistake(message, &field.origin));
            }
        }
        Ok(())
    }

    fn mistake(&self, message: String, kernel: &Origin) -> Diagnostic {
        Diagnostic::input(message).at(kernel, "declared here").at(&self.chain.origin, "used by this stage")
    }
}

/// Splits each component into a multiple of 2^-22 and what is missing; see `Camera` in `kernels/lib/camera.wgsl`.
fn split(vector: DVec3) -> ([f32; 3], [f32; 3]) {
    const QUANTUM: f64 = 1.0 / 4_194_304.0;
    let high = (vector / QUANTUM).round() * QUANTUM;
    (high.as_vec3().to_array(), (vector - high).as_vec3().to_array())
}

macro_rules! value_from {
    ($scalar:ty, $variant:ident) => {
        impl From<$scalar> for Value {
            fn from(value: $scalar) -> Self {
                Value::$variant(vec![value])
            }
        }
        impl<const N: usize> From<[$scalar; N]> for Value {
            fn from(value: [$scalar; N]) -> Self {
                Value::$variant(value.to_vec())
            }
        }
    };
}
value_from!(f32, F32);
value_from!(u32, U32);
value_from!(i32, I32);
