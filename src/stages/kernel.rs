use std::path::Path;
use std::sync::Arc;

use glam::UVec2;
use serde::Deserialize;

use super::{Info, Stage};
use crate::experiment::diagnostic::{Diagnostic, Origin, Source};
use crate::experiment::tree::{Kind, Node};
use crate::kernel::{BindingKind, Elem, FieldKind, Kernel as Wgsl};
use crate::plan::{BufferId, Chain, Value};
use crate::reference::{Buffers, Frame};

pub const INFO: Info = Info {
    name: "Kernel",
    summary: "a WGSL kernel of your own, with no Rust",
    formula: "yours",
    source: "bindings by variable name; parameters by field name; `camera`, `terrain` and `size` are filled in if the kernel has them",
    reads: &[],
    writes: &[],
    kernels: &["limit_groups.wgsl"],
    params: &[
        ("file", "required", "WGSL file, relative to the experiment"),
        ("entry", "\"main\"", "entry point"),
        (
            "bind",
            "required",
            "map from WGSL variables to buffers: \"name\", or New(name: .., of: F32, like: \"name\" or size: (columns, rows))",
        ),
        ("params", "()", "fields of the kernel's uniform structure"),
        (
            "over",
            "required",
            "the elements to run over: \"buffer\", (columns, rows), or Indirect(\"buffer of three u32\")",
        ),
        ("repeat", "1", "how often it runs a frame"),
        ("ping_pong", "None", "(read, written): variables whose buffers swap between repetitions"),
    ],
    read,
};

/// A user's kernel as a stage.
#[derive(Debug)]
pub struct Kernel {
    kernel: Arc<Wgsl>,
    entry: String,
    bind: Vec<(String, Bound, Origin)>,
    params: Vec<(String, Node, Origin)>,
    over: Over,
    over_origin: Origin,
    repeat: u32,
    ping_pong: Option<(String, String)>,
}

#[derive(Clone, Debug)]
enum Bound {
    Existing(String),
    New(New),
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename = "New")]
struct New {
    name: String,
    of: Elem,
    #[serde(default)]
    like: Option<String>,
    #[serde(default)]
    size: Option<(u32, u32)>,
}

/// The elements a kernel runs over.
#[derive(Clone, Debug)]
enum Over {
    Buffer(String),
    Size(u32, u32),
    /// The number of workgroups stands in a buffer of three u32 on the GPU; zero of them run nothing.
    Indirect(String),
}

fn read_over(node: &Node) -> Result<Over, Diagnostic> {
    match (&node.kind, node.name()) {
        (Kind::Tuple { items, .. }, Some("Indirect")) if items.len() == 1 => items[0].parse().map(Over::Indirect),
        (Kind::Tuple { name: None, .. }, _) => node.parse().map(|(columns, rows)| Over::Size(columns, rows)),
        (Kind::Leaf, None) => node.parse().map(Over::Buffer),
        _ => Err(Diagnostic::input("a kernel runs over the elements of something")
            .at(&node.head(), "expected \"buffer\", (columns, rows) or Indirect(\"buffer\")")),
    }
}

const FIELDS: [&str; 7] = ["file", "entry", "bind", "params", "over", "repeat", "ping_pong"];
const MOST_REPEATS: u32 = 10_000;

fn read(node: &Node, folder: &Path) -> Result<Box<dyn Stage>, Diagnostic> {
    let Kind::Struct { fields, .. } = &node.kind else {
        return Err(
            Diagnostic::input("`Kernel` needs at least `file`, `bind` and `over`").at(&node.origin, "this stage")
        );
    };
    if let Some(unknown) = fields.iter().find(|field| !FIELDS.contains(&field.name.as_str())) {
        return Err(Diagnostic::input(format!("`Kernel` has no field `{}`", unknown.name))
            .at(&unknown.origin, "unknown field")
            .suggest(&unknown.name, FIELDS));
    }
    let need = |name: &str| {
        node.field(name)
            .ok_or_else(|| Diagnostic::input(format!("`Kernel` needs `{name}`")).at(&first_word(node), "this stage"))
    };
    let file_node = need("file")?;
    let path = folder.join(file_node.parse::<String>()?);
    let text = std::fs::read_to_string(&path).map_err(|error| {
        Diagnostic::input(format!("cannot read the kernel `{}`: {error}", path.display()))
            .at(&file_node.origin, "this file")
    })?;
    let kernel = Wgsl::from_source(Source::new(path.display().to_string(), text), false)?;
    let entry: String = node.field("entry").map_or(Ok("main".into()), Node::parse)?;
    if kernel.entry(&entry)?.stage != naga::ShaderStage::Compute {
        return Err(Diagnostic::input(format!("`{entry}` is no compute entry point"))
            .at(&kernel.assembled.main.everywhere(), "in this kernel"));
    }
    let repeat: u32 = node.field("repeat").map_or(Ok(1), Node::parse)?;
    if !(1..=MOST_REPEATS).contains(&repeat) {
        let origin = node.field("repeat").map_or(&node.origin, |node| &node.origin);
        return Err(Diagnostic::input(format!("a kernel repeated {repeat} times"))
            .at(origin, format!("expected 1 to {MOST_REPEATS}")));
    }
    let over = need("over")?;
    Ok(Box::new(Kernel {
        entry,
        bind: read_bind(need("bind")?)?,
        params: read_params(node.field("params"), &kernel)?,
        over: read_over(over)?,
        over_origin: over.origin.clone(),
        repeat,
        ping_pong: node.field("ping_pong").map(Node::parse).transpose()?,
        kernel,
    }))
}

fn first_word(node: &Node) -> Origin {
    let length = node.name().map_or(1, str::len);
    Origin { source: node.origin.source.clone(), range: node.origin.range.start..node.origin.range.start + length }
}

fn read_bind(node: &Node) -> Result<Vec<(String, Bound, Origin)>, Diagnostic> {
    let Kind::Map(entries) = &node.kind else {
        return Err(Diagnostic::input("`bind` is a map from WGSL variables to buffers")
            .at(&node.origin, "expected `{ \"variable\": \"buffer\" }`"));
    };
    let bound = |value: &Node| match value.name() {
        Some(_) => value.parse().map(Bound::New),
        None => value.parse().map(Bound::Existing),
    };
    entries.iter().map(|(key, value)| Ok((key.parse()?, bound(value)?, value.origin.clone()))).collect()
}

fn read_params(node: Option<&Node>, kernel: &Wgsl) -> Result<Vec<(String, Node, Origin)>, Diagnostic> {
    let fields = match node.map(|node| (&node.kind, &node.origin)) {
        None => return Ok(Vec::new()),
        Some((Kind::Tuple { items, .. }, _)) if items.is_empty() => return Ok(Vec::new()),
        Some((Kind::Struct { fields, .. }, _)) => fields,
        Some((_, origin)) => {
            return Err(Diagnostic::input("`params` is a structure").at(origin, "expected `(name: value)`"));
        }
    };
    let known: Vec<&str> =
        structures(kernel).flat_map(|structure| &structure.fields).map(|field| field.name.as_str()).collect();
    if let Some(unknown) = fields.iter().find(|field| !known.contains(&field.name.as_str())) {
        return Err(Diagnostic::input(format!("`{}` has no parameter `{}`", kernel.name, unknown.name))
            .at(&unknown.origin, "unknown parameter")
            .suggest(&unknown.name, known));
    }
    Ok(fields.iter().map(|field| (field.name.clone(), field.value.clone(), field.origin.clone())).collect())
}

fn structures(kernel: &Wgsl) -> impl Iterator<Item = &crate::kernel::Structure> {
    kernel.entries.iter().flat_map(|entry| &entry.bindings).filter_map(|binding| match &binding.kind {
        BindingKind::Params(structure) => Some(structure),
        _ => None,
    })
}

impl Kernel {
    fn value(&self, name: &str, node: &Node) -> Result<Value, Diagnostic> {
        let field = structures(&self.kernel).flat_map(|structure| &structure.fields).find(|field| field.name == name);
        let Some(field) = field else { return Ok(Value::U32(Vec::new())) };
        let items: Vec<Node> = match &node.kind {
            Kind::Tuple { items, .. } | Kind::List(items) => items.clone(),
            _ => vec![node.clone()],
        };
        let (FieldKind::F32(components) | FieldKind::U32(components) | FieldKind::I32(components)) = field.kind;
        if items.len() != components as usize {
            return Err(Diagnostic::input(format!("`{name}` has {components} component(s), {} given", items.len()))
                .at(&node.origin, "this value")
                .at(&field.origin, "declared here"));
        }
        match field.kind {
            FieldKind::F32(_) => items.iter().map(Node::parse).collect::<Result<_, _>>().map(Value::F32),
            FieldKind::U32(_) => items.iter().map(Node::parse).collect::<Result<_, _>>().map(Value::U32),
            FieldKind::I32(_) => items.iter().map(Node::parse).collect::<Result<_, _>>().map(Value::I32),
        }
    }

    fn size(&self, chain: &Chain, new: &New, origin: &Origin) -> Result<Vec<u32>, Diagnostic> {
        match (&new.like, new.size) {
            (Some(like), None) => chain
                .read(like)
                .map(|id| chain.buffer(id).dims.clone())
                .map_err(|error| error.at(origin, "sized like it here")),
            (None, Some((columns, rows))) if columns > 0 && rows > 0 => Ok(vec![rows, columns]),
            (None, Some(size)) => {
                Err(Diagnostic::input(format!("a buffer of {} x {} elements holds nothing", size.0, size.1))
                    .at(origin, "this size"))
            }
            _ => Err(Diagnostic::input("a new buffer needs `like` or `size`, one of them").at(origin, "this buffer")),
        }
    }

    /// The buffers of each variable for every repetition.
    fn buffers(&self, chain: &mut Chain) -> Result<Vec<Vec<(String, BufferId)>>, Diagnostic> {
        let mut bound = Vec::new();
        for (variable, what, origin) in &self.bind {
            let id = match what {
                Bound::Existing(name) => chain.read(name).map_err(|error| error.at(origin, "asked for here"))?,
                Bound::New(new) => {
                    let dims = self.size(chain, new, origin)?;
                    chain.make(&new.name, new.of, &dims, "", &format!("made by `{}`", self.kernel.name))
                }
            };
            bound.push((variable.clone(), id));
        }
        let Some((read, written)) = &self.ping_pong else { return Ok(vec![bound; self.repeat as usize]) };
        let find = |name: &String| bound.iter().find(|(variable, _)| variable == name).map(|(_, id)| *id);
        let (Some(first), Some(last)) = (find(read), find(written)) else {
            return Err(Diagnostic::input("`ping_pong` names two bound variables").at(chain.origin(), "this stage"));
        };
        let target = chain.buffer(last).clone();
        let other = chain.make(
            &format!("{}.other", target.name),
            target.elem,
            &target.dims,
            "",
            "the other half of the ping-pong",
        );
        // counted back from the last repetition, which writes the buffer that has the name
        let at = |back: u32| if back.is_multiple_of(2) { last } else { other };
        Ok((0..self.repeat)
            .map(|turn| {
                let back = self.repeat - 1 - turn;
                let source = if turn == 0 { first } else { at(back + 1) };
                let swap = |(variable, id): &(String, BufferId)| match variable {
                    name if name == read => (name.clone(), source),
                    name if name == written => (name.clone(), at(back)),
                    name => (name.clone(), *id),
                };
                bound.iter().map(swap).collect()
            })
            .collect())
    }
}

impl Kernel {
    fn indirect(&self, chain: &mut Chain, name: &str) -> Result<BufferId, Diagnostic> {
        let id = chain.read(name).map_err(|error| error.at(&self.over_origin, "asked for here"))?;
        let buffer = chain.buffer(id);
        if buffer.elem != Elem::U32 || buffer.elements() < 3 {
            return Err(Diagnostic::input(format!("`{name}` does not hold numbers of workgroups"))
                .at(&self.over_origin, "expected a buffer of three U32"));
        }
        let limited = chain.make(&format!("{name}_limited"), Elem::U32, &[3], "", "workgroups along x, y, z");
        let kernel = Wgsl::built_in("limit_groups.wgsl")?;
        let step = chain.step("limit groups", &kernel, "limit");
        step.bind("groups", id).bind("limited", limited).over(UVec2::ONE)?;
        Ok(limited)
    }
}

impl Stage for Kernel {
    fn makes(&self) -> Vec<String> {
        let new = |(_, bound, _): &(String, Bound, Origin)| match bound {
            Bound::New(new) => Some(new.name.clone()),
            Bound::Existing(_) => None,
        };
        self.bind.iter().filter_map(new).collect()
    }

    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let turns = self.buffers(chain)?;
        let size = match &self.over {
            Over::Size(columns, rows) => UVec2::new(*columns, *rows),
            Over::Indirect(_) => UVec2::ONE,
            Over::Buffer(name) => {
                let id = chain.read(name).map_err(|error| error.at(&self.over_origin, "run over it here"))?;
                match chain.buffer(id).dims[..] {
                    [rows, columns] => UVec2::new(columns, rows),
                    _ => UVec2::new(chain.buffer(id).elements() as u32, 1),
                }
            }
        };
        let workgroup = self.kernel.entry(&self.entry)?.workgroup_size;
        let groups = UVec2::new(size.x.div_ceil(workgroup[0]), size.y.div_ceil(workgroup[1]));
        if size.min_element() == 0 || groups.max_element() > 65_535 {
            return Err(Diagnostic::input(format!("a kernel over {} x {} elements", size.x, size.y))
                .at(&self.over_origin, "expected 1 to 65535 workgroups a side"));
        }
        let groups_in = match &self.over {
            Over::Indirect(name) => Some(self.indirect(chain, name)?),
            _ => None,
        };
        for (turn, bound) in turns.into_iter().enumerate() {
            let label =
                if self.repeat == 1 { self.kernel.name.clone() } else { format!("{} #{}", self.kernel.name, turn + 1) };
            let values: Vec<(String, Value)> = self
                .params
                .iter()
                .map(|(name, node, _)| Ok((name.clone(), self.value(name, node)?)))
                .collect::<Result<_, Diagnostic>>()?;
            let mut step = chain.step(&label, &self.kernel, &self.entry);
            for (name, value) in values {
                step = step.set(&name, value);
            }
            for (variable, id) in &bound {
                step = step.bind(variable, *id);
            }
            let step = step.set("size", size.to_array()).set_terrain().set_camera();
            match groups_in {
                Some(buffer) => step.over_indirect(buffer)?,
                None => step.over(size)?,
            }
        }
        Ok(())
    }

    /// A user's formula is not known here: what it makes is not checked, and nothing that reads it is either.
    fn reference(&self, _frame: &Frame, _buffers: &mut Buffers) {}
}
