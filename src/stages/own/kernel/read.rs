//! Reading a user's kernel: its fields, its WGSL file, and what of the two has to agree.

use std::path::Path;

use super::{Attached, Fields, Kernel, Over};
use crate::experiment::diagnostic::{Diagnostic, Origin, Source};
use crate::experiment::parameters::{check_ranges, describe, schema};
use crate::experiment::regular;
use crate::experiment::tree::{Kind, Node};
use crate::kernel::{BindingKind, Kernel as Wgsl, Structure};
use crate::stages::Stage;

fn read_over(node: &Node) -> Result<Over, Diagnostic> {
    match (&node.kind, node.name()) {
        (Kind::Tuple { items, .. }, Some("Indirect")) if items.len() == 1 => items[0].parse().map(Over::Indirect),
        (Kind::Tuple { name: None, .. }, _) => node.parse().map(|(columns, rows)| Over::Size(columns, rows)),
        (Kind::Leaf, None) => node.parse().map(Over::Buffer),
        _ => Err(Diagnostic::input("a kernel runs over the elements of something")
            .at(&node.head(), "expected \"buffer\", (columns, rows) or Indirect(\"buffer\")")),
    }
}

pub(super) fn read(node: &Node, folder: &Path) -> Result<Box<dyn Stage>, Diagnostic> {
    let Kind::Struct { fields, .. } = &node.kind else {
        return Err(
            Diagnostic::input("`Kernel` needs at least `file`, `bind` and `over`").at(&node.origin, "this stage")
        );
    };
    let schema = schema::<Fields>();
    let known: Vec<String> = describe(&schema).into_iter().map(|field| field.name).collect();
    if let Some(unknown) = fields.iter().find(|field| !known.contains(&field.name)) {
        return Err(Diagnostic::input(format!("`Kernel` has no field `{}`", unknown.name))
            .at(&unknown.origin, "unknown field")
            .suggest(&unknown.name, known.iter().map(String::as_str)));
    }
    let need = |name: &str| {
        node.field(name)
            .ok_or_else(|| Diagnostic::input(format!("`Kernel` needs `{name}`")).at(&first_word(node), "this stage"))
    };
    let file_node = need("file")?;
    let path = folder.join(file_node.parse::<String>()?);
    let text = regular::read_to_string(&path).map_err(|error| {
        Diagnostic::input(format!("cannot read the kernel `{}`: {error}", path.display()))
            .at(&file_node.origin, "this file")
    })?;
    let kernel = Wgsl::from_source(Source::new(path.display().to_string(), text), false, None)?;
    let entry: String = node.field("entry").map_or(Ok("main".into()), Node::parse)?;
    if kernel.entry(&entry)?.stage != naga::ShaderStage::Compute {
        return Err(Diagnostic::input(format!("`{entry}` is no compute entry point"))
            .at(&kernel.assembled.main.everywhere(), "in this kernel"));
    }
    let repeat: u32 = node.field("repeat").map_or(Ok(1), Node::parse)?;
    check_ranges(&serde_json::json!({ "repeat": repeat }), &schema, node)?;
    let over = need("over")?;
    Ok(Box::new(Kernel {
        entry,
        bind: read_bind(need("bind")?)?,
        params: read_params(node.field("params"), &kernel)?,
        over: read_over(over)?,
        over_origin: over.origin.clone(),
        repeat,
        ping_pong: node.field("ping_pong").map(read_ping_pong).transpose()?.flatten(),
        kernel,
    }))
}

fn read_ping_pong(node: &Node) -> Result<Option<(String, String, Origin)>, Diagnostic> {
    let names: Option<(String, String)> = node.parse()?;
    Ok(names.map(|(read, written)| (read, written, node.origin.clone())))
}

/// Fields that are filled in, whatever somebody writes.
const FILLED_IN: [&str; 2] = ["size", "cell_m"];

fn first_word(node: &Node) -> Origin {
    let length = node.name().map_or(1, str::len);
    Origin { source: node.origin.source.clone(), range: node.origin.range.start..node.origin.range.start + length }
}

fn read_bind(node: &Node) -> Result<Vec<(String, Attached, Origin)>, Diagnostic> {
    let Kind::Map(entries) = &node.kind else {
        return Err(Diagnostic::input("`bind` is a map from WGSL variables to buffers")
            .at(&node.origin, "expected `{ \"variable\": \"buffer\" }`"));
    };
    let attached = |value: &Node| match (&value.kind, value.name()) {
        (Kind::Tuple { items, .. }, Some("Last")) if items.len() == 1 => items[0].parse().map(Attached::Last),
        (_, Some(_)) => value.parse().map(Attached::New),
        (_, None) => value.parse().map(Attached::Existing),
    };
    entries.iter().map(|(key, value)| Ok((key.parse()?, attached(value)?, value.origin.clone()))).collect()
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
    if let Some(filled) = fields.iter().find(|field| FILLED_IN.contains(&field.name.as_str())) {
        return Err(Diagnostic::input(format!("`{}` is filled in and cannot be set", filled.name))
            .at(&filled.origin, "not a parameter")
            .help("`size` is what the kernel runs over (`over`), `cell_m` the spacing of the heights; call yours another name"));
    }
    Ok(fields.iter().map(|field| (field.name.clone(), field.value.clone(), field.origin.clone())).collect())
}

pub(super) fn structures(kernel: &Wgsl) -> impl Iterator<Item = &Structure> {
    kernel.entries.iter().flat_map(|entry| &entry.bindings).filter_map(|binding| match &binding.kind {
        BindingKind::Params(structure) => Some(structure),
        _ => None,
    })
}
