//! Pieces of chains that a file names once and uses in several chains: `pieces: {"start": [HeightPyramid, ViewGrid]}`, and in a chain
//! `Piece("start")` in the place of its stages.

use std::collections::BTreeMap;

use super::diagnostic::Diagnostic;
use super::tree::{Field, Kind, Node};

const PIECE: &str = "Piece";

/// Puts the stages of each piece into the chains that name it. What a mistake points at is still the piece, where the stage was written.
pub fn expand(root: &mut Node) -> Result<(), Diagnostic> {
    let pieces = root.field("pieces").map_or(Ok(BTreeMap::new()), read)?;
    let Kind::Struct { fields, .. } = &mut root.kind else { return Ok(()) };
    fields.retain(|field| field.name != "pieces");
    let chains = fields.iter_mut().find(|field| field.name == "chains");
    let Some(Field { value: Node { kind: Kind::Map(chains), .. }, .. }) = chains else { return Ok(()) };
    for (_, stages) in chains {
        if let Kind::List(items) = &mut stages.kind {
            *items = expanded(items, &pieces)?;
        }
    }
    Ok(())
}

fn read(node: &Node) -> Result<BTreeMap<String, Vec<Node>>, Diagnostic> {
    let Kind::Map(entries) = &node.kind else {
        return Err(Diagnostic::input("`pieces` is a map from names to lists of stages")
            .at(&node.origin, "expected `{ \"name\": [Stage(...), ...] }`"));
    };
    let mut pieces = BTreeMap::new();
    for (key, stages) in entries {
        let name: String = key.parse()?;
        let Kind::List(items) = &stages.kind else {
            return Err(Diagnostic::input(format!("the piece `{name}` is not a list of stages"))
                .at(&stages.head(), "expected `[Stage(...), ...]`"));
        };
        if let Some(inner) = items.iter().find(|item| item.name() == Some(PIECE)) {
            return Err(Diagnostic::input("a piece has no other piece in it").at(&inner.origin, "in this piece"));
        }
        if pieces.insert(name.clone(), items.clone()).is_some() {
            return Err(Diagnostic::input(format!("there are two pieces called `{name}`")).at(&key.origin, "again"));
        }
    }
    Ok(pieces)
}

fn expanded(items: &[Node], pieces: &BTreeMap<String, Vec<Node>>) -> Result<Vec<Node>, Diagnostic> {
    let mut stages = Vec::new();
    for item in items {
        if item.name() != Some(PIECE) {
            stages.push(item.clone());
            continue;
        }
        let name: String = match &item.kind {
            Kind::Tuple { items, .. } if items.len() == 1 => items[0].parse()?,
            _ => return Err(Diagnostic::input("a piece is named").at(&item.origin, "expected `Piece(\"name\")`")),
        };
        let Some(piece) = pieces.get(&name) else {
            return Err(Diagnostic::input(format!("there is no piece `{name}`"))
                .at(&item.origin, "in this chain")
                .suggest(&name, pieces.keys().map(String::as_str)));
        };
        stages.extend(piece.iter().cloned());
    }
    Ok(stages)
}
