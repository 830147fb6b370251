//! A step while a stage says what it binds, sets and runs over; checked against the kernel's own declarations.

use glam::{DVec3, UVec2};

use super::chain::Chain;
use super::{BufferId, SceneData, Series, Step, Storage, Value, Vertices, Work};
use crate::camera::Camera;
use crate::experiment::diagnostic::{Diagnostic, Origin};
use crate::kernel::{Binding, BindingKind, FieldKind};

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
}

impl<'c, 'a> StepBuilder<'c, 'a> {
    pub(super) fn new(chain: &'c mut Chain<'a>, step: Step) -> Self {
        Self { chain, step }
    }

    pub fn data(&self) -> &'a SceneData {
        self.chain.data
    }

    pub fn bind(mut self, variable: &str, buffer: BufferId) -> Self {
        self.step.bindings.push((variable.into(), buffer));
        self
    }

    /// Binds a buffer to one of two variables of different types, of which the kernel uses the right one by an `override`.
    pub fn bind_either(self, floats: &str, numbers: &str, buffer: BufferId, is_numbers: bool) -> Self {
        let (used, unused) = if is_numbers { (numbers, floats) } else { (floats, numbers) };
        self.bind(used, buffer).leave_unbound(unused)
    }

    /// A variable that the kernel, with these constants and this entry point, never touches.
    pub fn leave_unbound(mut self, variable: &str) -> Self {
        self.step.unused.push(variable.into());
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
    pub fn draw_strip(self, strip: Vertices, target: BufferId, fragment: &str) -> Result<(), Diagnostic> {
        self.draw(strip, target, fragment)
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
        let kernel = self.step.kernel.clone();
        let mut entries = vec![kernel.entry(&self.step.entry)?];
        if let Work::Draw { fragment, .. } = &self.step.work {
            entries.push(kernel.entry(fragment)?);
        }
        let bindings: Vec<&Binding> = entries.iter().flat_map(|entry| &entry.bindings).collect();
        let mut touched = Touched::default();
        for binding in &bindings {
            self.check_binding(binding, &mut touched)?;
        }
        self.check_writes(&touched)?;
        let known = || bindings.iter().map(|binding| binding.name.as_str());
        if let Some((name, _)) = self.step.bindings.iter().find(|(name, _)| known().all(|other| other != name)) {
            return Err(Diagnostic::input(format!("the kernel `{}` uses no binding `{name}`", kernel.name))
                .at(&self.chain.origin, "bound here")
                .suggest(name, known()));
        }
        let fields = bindings.iter().filter_map(|binding| match &binding.kind {
            BindingKind::Params(structure) => Some(&structure.fields),
            _ => None,
        });
        let used: Vec<&str> = fields.flatten().map(|field| field.name.as_str()).collect();
        self.step.params.retain(|(name, _)| used.contains(&name.as_str()));
        self.step.reads.extend(touched.reads);
        self.step.reads.extend(touched.in_place);
        self.step.writes.extend(touched.writes);
        self.chain.steps.push(self.step);
        Ok(())
    }

    /// The buffer that is attached to a variable, wanted or not.
    fn attached(&self, variable: &str) -> Option<BufferId> {
        let always = self.step.bindings.iter().map(|(name, id)| (name, *id));
        let optional = self.step.optional.iter().map(|(name, id, _)| (name, *id));
        always.chain(optional).find(|(name, _)| *name == variable).map(|(_, id)| id)
    }

    /// Refuses a buffer that is not what the variable declares, and notes how the kernel uses it.
    fn check_binding(&self, binding: &Binding, touched: &mut Touched) -> Result<(), Diagnostic> {
        let Binding { name, kind, origin, .. } = binding;
        match (kind, self.attached(name)) {
            (BindingKind::Params(structure), _) => self.check_params(structure),
            (BindingKind::Sampler, _) => Ok(()),
            (_, None) if self.step.unused.contains(name) => Ok(()),
            (_, None) => Err(self.mistake(format!("`{name}` is not bound to a buffer"), origin)),
            (BindingKind::Storage { elem, read, written }, Some(id)) => {
                let buffer = self.chain.buffer(id);
                if buffer.storage == Storage::Target {
                    let message = format!("`{}` is a render target; bind it as `texture_2d<u32>`", buffer.name);
                    return Err(self.mistake(message, origin));
                }
                if !buffer.elem.binds_as(*elem) {
                    let (held, buffer) = (buffer.elem, &buffer.name);
                    let message = format!("`{name}` is an array of {elem:?}, but the buffer `{buffer}` holds {held:?}");
                    return Err(self.mistake(message, origin));
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
                    if *float { (Storage::Input, "the terrain") } else { (Storage::Target, "a render target") };
                if buffer.storage != storage {
                    let message = format!("`{name}` is an image of {what}, which the buffer `{}` is not", buffer.name);
                    return Err(self.mistake(message, origin));
                }
                touched.reads.push(id);
                Ok(())
            }
        }
    }

    /// Refuses to write what the kernel reads under another name, or the terrain.
    fn check_writes(&self, touched: &Touched) -> Result<(), Diagnostic> {
        let is_read = |id: &BufferId| touched.reads.contains(id);
        let is_terrain = |id: &BufferId| self.chain.buffer(*id).storage == Storage::Input;
        let Some(id) = touched.writes.iter().find(|id| is_terrain(id) || is_read(id)) else { return Ok(()) };
        let what = match is_read(id) {
            true => "is read and written by the same kernel",
            false => "is the terrain and cannot be written",
        };
        Err(Diagnostic::input(format!("`{}` {what}", self.chain.buffer(*id).name))
            .at(&self.chain.origin, "this stage")
            .help("write a new buffer, or use `ping_pong`"))
    }

    fn check_params(&self, structure: &crate::kernel::Structure) -> Result<(), Diagnostic> {
        for field in &structure.fields {
            let Some((_, series)) = self.step.params.iter().find(|(name, _)| *name == field.name) else {
                let message = format!("the parameter `{}` has no value", field.name);
                let help = match self.step.kernel.trusted {
                    true => format!("`plan` of this stage gives it one with `.set(\"{}\", ..)`", field.name),
                    false => format!("give it one with `params: ({}: ..)`", field.name),
                };
                return Err(self.mistake(message, &field.origin).help(help));
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
