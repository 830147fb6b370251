//! What naga knows of a kernel: bindings by variable name, parameters by field name and offset.

use naga::back::pipeline_constants::{PipelineConstantError, process_overrides};
use naga::front::wgsl;
use naga::valid::{Capabilities, GlobalUse, ModuleInfo, ValidationError, ValidationFlags, Validator};
use naga::{
    AddressSpace, ArraySize, GlobalVariable, Handle, Module, ScalarKind, Span, StorageAccess, TypeInner, WithSpan,
};

use super::{Assembled, limits};
use crate::experiment::diagnostic::{Diagnostic, Origin};

/// The group of a kernel's own bindings, and that of the ground's, which the plan fills.
pub const OWN_GROUP: u32 = 0;
pub const GROUND_GROUP: u32 = 1;

/// Element of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub enum Elem {
    F32,
    U32,
    I32,
    Vec2F32,
    Vec4F32,
    Vec2U32,
    Vec4U32,
}

impl Elem {
    pub fn components(self) -> u32 {
        match self {
            Elem::F32 | Elem::U32 | Elem::I32 => 1,
            Elem::Vec2F32 | Elem::Vec2U32 => 2,
            Elem::Vec4F32 | Elem::Vec4U32 => 4,
        }
    }

    pub fn bytes(self) -> u64 {
        u64::from(self.components()) * 4
    }

    /// Whether a buffer of these elements can be bound as an array of `bound`: the same, or four scalars at once.
    pub fn binds_as(self, bound: Elem) -> bool {
        self == bound || matches!((self, bound), (Elem::F32, Elem::Vec4F32) | (Elem::U32, Elem::Vec4U32))
    }

    /// The values in the bytes of elements, unpacked.
    pub fn values(self, packing: Packing, bytes: &[u8]) -> Vec<f64> {
        let numbers = || bytemuck::pod_collect_to_vec::<u8, u32>(bytes).into_iter();
        match (packing, self) {
            (Packing::Bytes, _) => bytes.iter().map(|&byte| byte.into()).collect(),
            (Packing::Halves, _) => bytemuck::pod_collect_to_vec::<u8, u16>(bytes)
                .into_iter()
                .map(|bits| half::f16::from_bits(bits).into())
                .collect(),
            (_, elem) if elem.is_float() => numbers().map(|bits| f64::from(f32::from_bits(bits))).collect(),
            (_, Elem::I32) => numbers().map(|bits| f64::from(bits as i32)).collect(),
            _ => numbers().map(f64::from).collect(),
        }
    }

    /// The bytes of values: the inverse of [`Elem::values`], each rounded to what holds it.
    pub fn bytes_of(self, packing: Packing, values: &[f64]) -> Vec<u8> {
        match (packing, self) {
            (Packing::Bytes, _) => values.iter().map(|&value| value as u8).collect(),
            (Packing::Halves, _) => {
                values.iter().flat_map(|&value| half::f16::from_f64(value).to_bits().to_le_bytes()).collect()
            }
            (_, elem) if elem.is_float() => values.iter().flat_map(|&value| (value as f32).to_le_bytes()).collect(),
            (_, Elem::I32) => values.iter().flat_map(|&value| (value as i32).to_le_bytes()).collect(),
            _ => values.iter().flat_map(|&value| (value as u32).to_le_bytes()).collect(),
        }
    }

    pub fn is_float(self) -> bool {
        matches!(self, Elem::F32 | Elem::Vec2F32 | Elem::Vec4F32)
    }

    fn from_type(inner: &TypeInner) -> Option<Self> {
        let (components, scalar) = match *inner {
            TypeInner::Scalar(scalar) | TypeInner::Atomic(scalar) => (1, scalar),
            TypeInner::Vector { size, scalar } => (size as u32, scalar),
            _ => return None,
        };
        match (scalar.kind, scalar.width, components) {
            (ScalarKind::Float, 4, 1) => Some(Elem::F32),
            (ScalarKind::Uint, 4, 1) => Some(Elem::U32),
            (ScalarKind::Sint, 4, 1) => Some(Elem::I32),
            (ScalarKind::Float, 4, 2) => Some(Elem::Vec2F32),
            (ScalarKind::Float, 4, 4) => Some(Elem::Vec4F32),
            (ScalarKind::Uint, 4, 2) => Some(Elem::Vec2U32),
            (ScalarKind::Uint, 4, 4) => Some(Elem::Vec4U32),
            _ => None,
        }
    }
}

/// Several values in one element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    /// As many values as the element has components.
    None,
    /// Four bytes in a u32, the lowest first.
    Bytes,
    /// Two f16 in a u32, the lower first.
    Halves,
}

impl Packing {
    /// Values in one element.
    pub fn components(self, elem: Elem) -> u32 {
        match self {
            Packing::None => elem.components(),
            Packing::Bytes => 4,
            Packing::Halves => 2,
        }
    }
}

#[derive(Clone, Debug)]
pub struct Entry {
    pub name: String,
    pub stage: naga::ShaderStage,
    pub workgroup_size: [u32; 3],
    /// Bytes of the workgroup's memory that it uses.
    pub workgroup_bytes: u32,
    /// How many variables it hands from the vertex shader to the fragment shader, or takes.
    pub varyings: u32,
    /// The bindings this entry point uses, in binding order.
    pub bindings: Vec<Binding>,
    /// Why no pipeline can be made of it; another entry point of the kernel may do.
    pub refused: Option<Diagnostic>,
}

impl Entry {
    /// How many storage buffers it binds, which adapters limit.
    pub fn storage_buffers(&self) -> usize {
        self.bindings.iter().filter(|binding| matches!(binding.kind, BindingKind::Storage { .. })).count()
    }
}

#[derive(Clone, Debug)]
pub struct Binding {
    /// The WGSL variable's name, which is how a stage binds it.
    pub name: String,
    /// 0 is the kernel's own; 1 is the ground's.
    pub group: u32,
    pub binding: u32,
    pub kind: BindingKind,
    pub origin: Origin,
}

#[derive(Clone, Debug)]
pub enum BindingKind {
    /// `var<uniform>`: the parameters.
    Params(Structure),
    /// `var<storage, read>` or `read_write` of an array; the elements that it has, if the kernel says how many.
    Storage { elem: Elem, length: Option<u32>, read: bool, written: bool },
    /// `texture_2d<f32>`: an input as an image, which many adapters read faster than an array.
    /// `texture_2d<u32>`: a render target.
    Image { float: bool },
    /// `sampler`: nearest, clamped to the edge; for `textureGather`.
    Sampler,
}

/// A uniform structure; nested ones and arrays are flattened to dotted names (`camera.corner_hi`, `table.0`).
#[derive(Clone, Debug)]
pub struct Structure {
    pub bytes: u32,
    pub fields: Vec<Field>,
    /// The structure itself and those in it, outermost first.
    pub nested: Vec<Nested>,
}

/// A structure in a structure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Nested {
    /// What the names of its fields begin with: empty, or a member and a dot.
    pub prefix: String,
    /// The structure's own name in WGSL.
    pub name: String,
}

#[derive(Clone, Debug)]
pub struct Field {
    pub name: String,
    pub offset: u32,
    pub kind: FieldKind,
    pub origin: Origin,
}

/// Scalar type and number of components of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldKind {
    F32(u32),
    U32(u32),
    I32(u32),
}

impl FieldKind {
    pub fn components(self) -> u32 {
        let (FieldKind::F32(components) | FieldKind::U32(components) | FieldKind::I32(components)) = self;
        components
    }
}

/// What kernels may use beyond WGSL without extensions: what every adapter has that WebGPU runs on. Devices are opened with no feature
/// that would add to it.
fn capabilities() -> Capabilities {
    Capabilities::SHADER_FLOAT16_IN_FLOAT32 | Capabilities::MULTISAMPLED_SHADING | Capabilities::CUBE_ARRAY_TEXTURES
}

/// Parses, validates and describes a kernel. One that is not `trusted` is held to what every adapter has.
pub fn reflect(assembled: &Assembled, trusted: bool) -> Result<(Vec<Entry>, Vec<String>, Module), Diagnostic> {
    let mut options = wgsl::Options::new();
    options.capabilities = capabilities();
    let module = wgsl::Frontend::new_with_options(options).parse(&assembled.text).map_err(|error| {
        let labels = error.labels().map(|(span, text)| (span, text.to_string())).collect();
        if error.notes().any(|note| note.contains("recursion limit")) {
            return Diagnostic::input(
                "brackets, operators or types are too deep in one another for the parser of kernels",
            )
            .at(&assembled.main.everywhere(), "in this kernel")
            .help("give names to parts with `let` or `alias`");
        }
        diagnose(assembled, error.message().to_string(), labels, error.notes().next().map(str::to_string))
    })?;
    let info = Validator::new(ValidationFlags::all(), capabilities())
        .validate(&module)
        .map_err(|error| invalid(assembled, &error))?;
    let mut entries = Vec::new();
    for (index, entry) in module.entry_points.iter().enumerate() {
        let function = info.get_entry_point(index);
        let used = module
            .global_variables
            .iter()
            .filter(|(handle, variable)| variable.binding.is_some() && !function[*handle].is_empty());
        let mut bindings = Vec::new();
        for (handle, variable) in used {
            let read = function[handle].contains(GlobalUse::READ);
            bindings.push(binding(assembled, &module, handle, variable, read)?);
        }
        let is_params =
            |binding: &&Binding| binding.group == OWN_GROUP && matches!(binding.kind, BindingKind::Params(_));
        if let Some(second) = bindings.iter().filter(is_params).nth(1) {
            return Err(Diagnostic::input(format!(
                "`{}` is a second uniform structure; a kernel has one",
                second.name
            ))
            .at(&second.origin, "put its fields into the other"));
        }
        bindings.sort_by_key(|binding| (binding.group, binding.binding));
        let resolved = match trusted {
            true => Ok(entry.workgroup_size),
            false => resolved_size(assembled, &module, &info, entry),
        };
        let (workgroup_size, refused) = resolved.map_or_else(|why| ([1; 3], Some(why)), |size| (size, None));
        let is_shared = |handle: Handle<GlobalVariable>, variable: &GlobalVariable| {
            variable.space == AddressSpace::WorkGroup && !function[handle].is_empty()
        };
        let shared = module.global_variables.iter().filter(|(handle, variable)| is_shared(*handle, variable));
        let size = |ty: Handle<naga::Type>| module.types[ty].inner.size(module.to_ctx());
        entries.push(Entry {
            name: entry.name.clone(),
            stage: entry.stage,
            workgroup_size,
            workgroup_bytes: shared.map(|(_, variable)| size(variable.ty)).fold(0, u32::saturating_add),
            varyings: varyings(&module, entry),
            bindings,
            refused,
        });
    }
    let overrides = module.overrides.iter().filter_map(|(_, constant)| constant.name.clone()).collect();
    Ok((entries, overrides, module))
}

fn invalid(assembled: &Assembled, error: &WithSpan<ValidationError>) -> Diagnostic {
    let labels = error.spans().map(|(span, text)| (*span, text.clone())).collect();
    let causes = std::iter::successors(std::error::Error::source(error.as_inner()), |cause| cause.source());
    diagnose(assembled, error.as_inner().to_string(), labels, causes.last().map(|cause| cause.to_string()))
}

/// The workgroup of an entry point with all `override` constants in place, of which the pipeline gives none of a user's another value.
fn resolved_size(
    assembled: &Assembled,
    module: &Module,
    info: &ModuleInfo,
    entry: &naga::EntryPoint,
) -> Result<[u32; 3], Diagnostic> {
    let resolved = process_overrides(module, info, Some((entry.stage, &entry.name)), &Default::default());
    let (module, info) = resolved.map_err(|error| unresolved(assembled, module, error))?;
    limits::check_entry(assembled, &module, &info, &entry.name)?;
    let resolved = module.entry_points.iter().find(|resolved| resolved.name == entry.name);
    Ok(resolved.map_or(entry.workgroup_size, |resolved| resolved.workgroup_size))
}

/// Says which constant has no value, or what is wrong with the kernel when all have theirs.
fn unresolved(assembled: &Assembled, module: &Module, error: PipelineConstantError) -> Diagnostic {
    let missing = match &error {
        PipelineConstantError::ValidationError(error) => return invalid(assembled, error),
        PipelineConstantError::MissingValue(name) => Some(name),
        _ => None,
    };
    let is_it = |constant: &naga::Override| {
        missing.is_some_and(|name| {
            constant.name.as_ref() == Some(name) || constant.id.map(|id| id.to_string()).as_ref() == Some(name)
        })
    };
    let Some((handle, constant)) = module.overrides.iter().find(|(_, constant)| is_it(constant)) else {
        return Diagnostic::input(error.to_string()).at(&assembled.main.everywhere(), "in this kernel");
    };
    let origin = assembled.origin(module.overrides.get_span(handle).to_range().unwrap_or_default());
    let name = constant.name.as_deref().unwrap_or_default();
    Diagnostic::input(format!("the constant `{name}` has no value"))
        .at(&origin, "declared here")
        .help(format!("write `override {name} = ..;`, or make it a field of the parameters"))
}

/// Variables with a location that go from the vertex shader to the fragment shader.
fn varyings(module: &Module, entry: &naga::EntryPoint) -> u32 {
    let is_location = |binding: &Option<naga::Binding>| matches!(binding, Some(naga::Binding::Location { .. }));
    let count = |ty: Handle<naga::Type>, binding: &Option<naga::Binding>| match &module.types[ty].inner {
        TypeInner::Struct { members, .. } => {
            members.iter().filter(|member| is_location(&member.binding)).count() as u32
        }
        _ => u32::from(is_location(binding)),
    };
    match entry.stage {
        naga::ShaderStage::Vertex => {
            entry.function.result.as_ref().map_or(0, |result| count(result.ty, &result.binding))
        }
        naga::ShaderStage::Fragment => {
            entry.function.arguments.iter().map(|argument| count(argument.ty, &argument.binding)).sum()
        }
        _ => 0,
    }
}

fn diagnose(assembled: &Assembled, message: String, labels: Vec<(Span, String)>, note: Option<String>) -> Diagnostic {
    let mut diagnostic = Diagnostic::input(message);
    for (span, text) in labels {
        if let Some(range) = span.to_range() {
            diagnostic = diagnostic.at(&assembled.origin(range), text);
        }
    }
    diagnostic.help = note;
    diagnostic.or_at(&assembled.main.everywhere(), "in this kernel")
}

fn binding(
    assembled: &Assembled,
    module: &Module,
    handle: Handle<GlobalVariable>,
    variable: &GlobalVariable,
    read: bool,
) -> Result<Binding, Diagnostic> {
    let name = variable.name.clone().unwrap_or_default();
    let span = module.global_variables.get_span(handle).to_range().unwrap_or_default();
    let origin = assembled.origin(span);
    let refuse = |what: &str| Err(Diagnostic::input(format!("`{name}` {what}")).at(&origin, "this binding"));
    let Some(place) = &variable.binding else { return refuse("has no binding") };
    let is_included = !std::sync::Arc::ptr_eq(&origin.source, &assembled.main);
    let is_of_ground = is_included && origin.source.name.starts_with("kernels/ground/");
    if place.group != if is_of_ground { GROUND_GROUP } else { OWN_GROUP } {
        return refuse("is in another group than 0; a kernel has one group");
    }
    if place.binding >= limits::BINDINGS {
        return refuse(&format!(
            "has the number {}; a kernel numbers its bindings below {}",
            place.binding,
            limits::BINDINGS
        ));
    }
    let inner = &module.types[variable.ty].inner;
    let kind = match (variable.space, inner) {
        (AddressSpace::Uniform, TypeInner::Struct { span, .. }) if *span > limits::PARAMETER_BYTES => {
            return refuse(&format!("takes {span} bytes; parameters have room for {}", limits::PARAMETER_BYTES));
        }
        (AddressSpace::Uniform, TypeInner::Struct { span, .. }) => {
            let mut structure = Structure { bytes: *span, fields: Vec::new(), nested: Vec::new() };
            flatten(module, variable.ty, "", 0, &origin, &mut structure)?;
            BindingKind::Params(structure)
        }
        (AddressSpace::Storage { access }, TypeInner::Array { base, size, .. }) => {
            let length = if let ArraySize::Constant(length) = size { Some(length.get()) } else { None };
            match Elem::from_type(&module.types[*base].inner) {
                Some(elem) => {
                    BindingKind::Storage { elem, length, read, written: access.contains(StorageAccess::STORE) }
                }
                None => {
                    return refuse("is an array of a type that no buffer has: f32, u32, i32, vec2 and vec4 of them");
                }
            }
        }
        (AddressSpace::Handle, TypeInner::Sampler { comparison: false }) => BindingKind::Sampler,
        (
            AddressSpace::Handle,
            TypeInner::Image {
                dim: naga::ImageDimension::D2,
                arrayed: false,
                class: naga::ImageClass::Sampled { kind, multi: false },
            },
        ) if matches!(kind, ScalarKind::Float | ScalarKind::Uint) => {
            BindingKind::Image { float: *kind == ScalarKind::Float }
        }
        _ => return refuse("is no storage array, no uniform structure and no texture_2d of f32 or u32"),
    };
    Ok(Binding { name, group: place.group, binding: place.binding, kind, origin })
}

fn flatten(
    module: &Module,
    ty: Handle<naga::Type>,
    prefix: &str,
    base: u32,
    origin: &Origin,
    structure: &mut Structure,
) -> Result<(), Diagnostic> {
    let TypeInner::Struct { members, .. } = &module.types[ty].inner else { return Ok(()) };
    let name = module.types[ty].name.clone().unwrap_or_default();
    structure.nested.push(Nested { prefix: prefix.into(), name });
    let mut parts: Vec<(String, u32, naga::Handle<naga::Type>)> = Vec::new();
    for member in members {
        let (name, offset) = (format!("{prefix}{}", member.name.as_deref().unwrap_or_default()), base + member.offset);
        match module.types[member.ty].inner {
            TypeInner::Array { base, size: naga::ArraySize::Constant(count), stride } => {
                parts.extend((0..count.get()).map(|at| (format!("{name}.{at}"), offset + at * stride, base)));
            }
            _ => parts.push((name, offset, member.ty)),
        }
    }
    for (name, offset, ty) in parts {
        let (components, scalar) = match module.types[ty].inner {
            TypeInner::Struct { .. } => {
                flatten(module, ty, &format!("{name}."), offset, origin, structure)?;
                continue;
            }
            TypeInner::Scalar(scalar) => (1, scalar),
            TypeInner::Vector { size, scalar } => (size as u32, scalar),
            _ => {
                return Err(Diagnostic::input(format!("the parameter `{name}` has a type that cannot be set"))
                    .at(origin, "a parameter is f32, u32, i32 or a vector of them"));
            }
        };
        let kind = match (scalar.kind, scalar.width) {
            (ScalarKind::Float, 4) => FieldKind::F32(components),
            (ScalarKind::Uint, 4) => FieldKind::U32(components),
            (ScalarKind::Sint, 4) => FieldKind::I32(components),
            _ => {
                return Err(Diagnostic::input(format!("the parameter `{name}` is not of 32 bits"))
                    .at(origin, "a parameter is f32, u32, i32 or a vector of them"));
            }
        };
        structure.fields.push(Field { name, offset, kind, origin: origin.clone() });
    }
    Ok(())
}
