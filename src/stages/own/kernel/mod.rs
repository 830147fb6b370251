mod offer;
mod read;
mod reference;

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::{Diagnostic, Origin};
use crate::experiment::parameters::schema;
use crate::experiment::tree::{Kind, Node};
use crate::kernel::{BindingKind, Elem, FieldKind, Kernel as Wgsl, Value};
use crate::plan::{Buffer, BufferId, Chain};
use crate::stages::{Example, Info, Stage};
use offer::Offered;
use read::structures;

pub const INFO: Info = Info {
    name: "Kernel",
    summary: "a WGSL kernel of your own, with no Rust",
    formula: "yours",
    source: "bindings by variable name; parameters by field name; `size`, `cell_m` and the structures of `kernels/lib` (`Camera`, `View`, `Terrain`, `Projector`, ..) are filled in if the kernel has them",
    parameters: schema::<Fields>,
    read: read::read,
    examples: &[
        Example::new(
            "[Kernel(file: \"curvature.wgsl\", bind: {\"src\": \"height\", \"dst\": New(name: \"curvature\", of: F32, like: \"height\")}, \
             params: (scale: 2.5), over: \"curvature\")]",
        )
        .with_files(&[("curvature.wgsl", CURVATURE)]),
        Example::new(
            "[Kernel(file: \"smooth.wgsl\", bind: {\"src\": \"height\", \"dst\": New(name: \"smooth\", of: F32, like: \"height\")}, \
             over: \"smooth\", repeat: 3, ping_pong: (\"src\", \"dst\"))]",
        )
        .with_files(&[("smooth.wgsl", SMOOTH)]),
        Example::new(
            "[HeightPyramid, RayCast, Kernel(file: \"change.wgsl\", bind: {\"now\": \"distance\", \"before\": Last(\"distance\"), \
             \"change\": New(name: \"change\", of: F32, like: \"distance\")}, over: \"change\")]",
        )
        .with_files(&[("change.wgsl", CHANGE)]),
    ],
    ..Info::EMPTY
};

/// The kernels that ship as examples; their formulas are known to the reference.
const CURVATURE: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/experiments/kernels/curvature.wgsl"));
const SMOOTH: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/experiments/kernels/smooth.wgsl"));
const CHANGE: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/experiments/kernels/change.wgsl"));

/// The fields as they are documented; `read` takes them one by one, to say where a mistake is.
#[derive(Serialize, JsonSchema)]
struct Fields {
    /// WGSL file, relative to the experiment
    file: String,
    /// entry point
    #[serde(default = "main_entry")]
    entry: String,
    /// map from WGSL variables to buffers: "name", Last("name") as the frame before left it, or New(name: .., of: F32, like: "name" or size: (columns, rows)); with `as: Distance`,
    /// `Colour`, `Error` or `Grid` the new buffer is offered to the stages and measures that need such; one that is called `height` is the ground of the stages after it
    bind: BTreeMap<String, String>,
    /// fields of the kernel's uniform structure
    #[serde(default)]
    params: (),
    /// the elements to run over: "buffer", (columns, rows), or Indirect("buffer of three u32")
    over: String,
    /// how often it runs a frame
    #[serde(default = "once")]
    #[schemars(range(min = 1, max = 10000))]
    repeat: u32,
    /// (read, written): variables whose buffers swap between repetitions
    #[serde(default)]
    ping_pong: Option<(String, String)>,
}

/// Elements of a buffer: kernels have 32 bits for the number of one.
const MOST_ELEMENTS: u64 = u32::MAX as u64;

fn main_entry() -> String {
    "main".into()
}

fn once() -> u32 {
    1
}

/// A user's kernel as a stage.
#[derive(Debug)]
pub struct Kernel {
    kernel: Arc<Wgsl>,
    entry: String,
    bind: Vec<(String, Attached, Origin)>,
    params: Vec<(String, Node, Origin)>,
    over: Over,
    over_origin: Origin,
    repeat: u32,
    ping_pong: Option<(String, String, Origin)>,
}

/// What a WGSL variable is attached to.
#[derive(Clone, Debug)]
enum Attached {
    Existing(String),
    /// What the chain left in a buffer in the frame before.
    Last(String),
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
    #[serde(default, rename = "as")]
    offered_as: Option<Offered>,
}

/// The elements a kernel runs over.
#[derive(Clone, Debug)]
enum Over {
    Buffer(String),
    Size(u32, u32),
    /// The number of workgroups stands in a buffer of three u32 on the GPU; zero of them run nothing.
    Indirect(String),
}

impl Kernel {
    fn value(&self, name: &str, node: &Node) -> Result<Value, Diagnostic> {
        let field = structures(&self.kernel).flat_map(|structure| &structure.fields).find(|field| field.name == name);
        // `read` has refused parameters that the kernel does not have
        let Some(field) = field else { return Ok(Value::from(0)) };
        let items: Vec<Node> = match &node.kind {
            Kind::Tuple { items, .. } | Kind::List(items) => items.clone(),
            _ => vec![node.clone()],
        };
        let components = field.kind.components();
        if items.len() != components as usize {
            return Err(Diagnostic::input(format!("`{name}` has {components} component(s), {} given", items.len()))
                .at(&node.origin, "this value")
                .at(&field.origin, "declared here"));
        }
        fn numbers<T: serde::de::DeserializeOwned>(items: &[Node]) -> Result<Vec<T>, Diagnostic> {
            items.iter().map(Node::parse).collect()
        }
        Ok(match field.kind {
            FieldKind::F32(_) => Value::from(numbers::<f32>(&items)?.as_slice()),
            FieldKind::U32(_) => Value::from(numbers::<u32>(&items)?.as_slice()),
            FieldKind::I32(_) => Value::from(numbers::<i32>(&items)?.as_slice()),
        })
    }

    fn size(&self, chain: &Chain, new: &New, origin: &Origin) -> Result<Vec<u32>, Diagnostic> {
        match (&new.like, new.size) {
            (Some(like), None) => chain
                .read(like)
                .map(|id| chain.buffer(id).dims.clone())
                .map_err(|error| error.at(origin, "sized like it here")),
            (None, Some((columns, rows))) => match u64::from(columns) * u64::from(rows) {
                1..=MOST_ELEMENTS => Ok(vec![rows, columns]),
                0 => Err(Diagnostic::input(format!("a buffer of {columns} x {rows} elements holds nothing"))
                    .at(origin, "this size")),
                _ => Err(Diagnostic::input(format!("no adapter has a buffer of {columns} x {rows} elements"))
                    .at(origin, format!("expected at most {MOST_ELEMENTS} elements in all"))
                    .help("kernels number elements with 32 bits")),
            },
            _ => Err(Diagnostic::input("a new buffer needs `like` or `size`, one of them").at(origin, "this buffer")),
        }
    }

    /// What a variable is an array of; one that is none is refused when the step is stated.
    fn element(&self, variable: &str) -> Elem {
        match self.kernel.binding(variable) {
            Some(BindingKind::Storage { elem, .. }) => *elem,
            _ => Elem::F32,
        }
    }

    /// The buffers of each variable for every repetition.
    fn buffers(&self, chain: &mut Chain) -> Result<Vec<Vec<(String, BufferId)>>, Diagnostic> {
        let mut attached = Vec::new();
        for (variable, what, origin) in &self.bind {
            let id = match what {
                Attached::Existing(name) => chain.read(name).map_err(|error| error.at(origin, "asked for here"))?,
                Attached::Last(name) => chain.last_frame(name, self.element(variable), origin),
                Attached::New(new) => {
                    let dims = self.size(chain, new, origin)?;
                    let id = chain.make(&new.name, new.of, &dims, "", &format!("made by `{}`", self.kernel.name));
                    if let Some(like) = new.like.as_ref().and_then(|like| chain.find(like)) {
                        chain.set_spread(id, chain.buffer(like).spread);
                    }
                    new.check(chain, id).map_err(|error| error.at(origin, "this buffer"))?;
                    id
                }
            };
            attached.push((variable.clone(), id));
        }
        let Some((read, written, origin)) = &self.ping_pong else { return Ok(vec![attached; self.repeat as usize]) };
        let find = |name: &String| attached.iter().find(|(variable, _)| variable == name).map(|(_, id)| *id);
        let bound = |name: &String| {
            find(name).ok_or_else(|| {
                Diagnostic::input(format!("`ping_pong` names `{name}`, to which nothing is bound"))
                    .at(origin, "expected two variables of `bind`, the one that is read and the one that is written")
                    .suggest(name, attached.iter().map(|(variable, _)| variable.as_str()))
            })
        };
        let (first, last) = (bound(read)?, bound(written)?);
        let (source, target) = (chain.buffer(first).clone(), chain.buffer(last).clone());
        if (source.elem, &source.dims) != (target.elem, &target.dims) {
            let shape = |buffer: &Buffer| format!("{:?} {:?}", buffer.elem, buffer.dims);
            return Err(Diagnostic::input("`ping_pong` swaps two buffers that are not alike")
                .at(origin, format!("`{}` is {}, `{}` is {}", source.name, shape(&source), target.name, shape(&target)))
                .help(format!("make the new one like the other: New(name: .., of: .., like: \"{}\")", source.name)));
        }
        let other = chain.make(
            &format!("{}.other", target.name),
            target.elem,
            &target.dims,
            "",
            "the other half of the ping-pong",
        );
        chain.set_spread(other, target.spread);
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
                attached.iter().map(swap).collect()
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
        let kernel = chain.kernel("own/kernel_limit_groups.wgsl")?;
        let step = chain.step("limit groups", &kernel, "limit");
        step.bind("groups", id).bind("limited", limited).over(UVec2::ONE)?;
        Ok(limited)
    }
}

impl Stage for Kernel {
    fn makes(&self) -> Option<Vec<String>> {
        let new = |(_, attached, _): &(String, Attached, Origin)| match attached {
            Attached::New(new) => Some(new.name.clone()),
            Attached::Existing(_) | Attached::Last(_) => None,
        };
        Some(self.bind.iter().filter_map(new).collect())
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
        let kernel = self.kernel.with_ground(chain.ground_form())?;
        let workgroup = kernel.entry(&self.entry)?.workgroup_size;
        let groups = UVec2::new(size.x.div_ceil(workgroup[0]), size.y.div_ceil(workgroup[1]));
        if size.min_element() == 0 || groups.max_element() > 65_535 {
            return Err(Diagnostic::input(format!("a kernel over {} x {} elements", size.x, size.y))
                .at(&self.over_origin, "expected 1 to 65535 workgroups a side"));
        }
        let groups_in = match &self.over {
            Over::Indirect(name) => Some(self.indirect(chain, name)?),
            _ => None,
        };
        for (turn, attached) in turns.into_iter().enumerate() {
            let label =
                if self.repeat == 1 { self.kernel.name.clone() } else { format!("{} #{}", self.kernel.name, turn + 1) };
            let values: Vec<(String, Value)> = self
                .params
                .iter()
                .map(|(name, node, _)| Ok((name.clone(), self.value(name, node)?)))
                .collect::<Result<_, Diagnostic>>()?;
            let mut step = chain.step(&label, &kernel, &self.entry);
            for (name, value) in values {
                step = step.set(&name, value);
            }
            for (variable, id) in &attached {
                step = step.bind(variable, *id);
            }
            let step = step.set("size", size.to_array());
            match groups_in {
                Some(buffer) => step.over_indirect(buffer)?,
                None => step.over(size)?,
            }
        }
        self.offer(chain)
    }
}
