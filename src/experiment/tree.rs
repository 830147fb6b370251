//! RON text as a tree whose every node knows where it was written.
//!
//! The `ron` crate decides what a value means; it keeps no positions. This tree keeps them, so that a sweep
//! can put a value written on one line into a field written on another, and a mistake in it is still
//! reported where the user wrote it. [`Node::parse`] hands a node back to `ron` for the typed reading.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use serde::de::DeserializeOwned;

use super::diagnostic::{Diagnostic, Origin, Source};

#[derive(Clone, Debug)]
pub struct Node {
    pub origin: Origin,
    pub kind: Kind,
}

#[derive(Clone, Debug)]
pub enum Kind {
    /// A number, string, character, boolean or a bare identifier.
    Leaf,
    /// `Name(a: 1)` or `(a: 1)`.
    Struct { name: Option<Origin>, fields: Vec<Field> },
    /// `Name(1, 2)`, `Name()` or `(1, 2)`.
    Tuple { name: Option<Origin>, items: Vec<Node> },
    /// `[1, 2]`
    List(Vec<Node>),
    /// `{"a": 1}`
    Map(Vec<(Node, Node)>),
}

#[derive(Clone, Debug)]
pub struct Field {
    pub name: String,
    /// Where the name was written: in the struct itself, or in the path that put it there.
    pub origin: Origin,
    pub value: Node,
}

impl Node {
    pub fn read(source: &Arc<Source>) -> Result<Node, Diagnostic> {
        Self::read_from(source, 0)
    }

    /// Reads what stands after the first `start` bytes of a source.
    pub fn read_from(source: &Arc<Source>, start: usize) -> Result<Node, Diagnostic> {
        let mut reader = Reader { source, at: start, depth: 0 };
        reader.skip_attributes()?;
        let node = reader.value()?;
        reader.skip_blank()?;
        match reader.peek() {
            None => Ok(node),
            Some(_) => Err(reader.expected("the end of the text")),
        }
    }

    /// Reads what stands after the first `start` bytes of a source: a value, and further ones after commas.
    pub fn read_several_from(source: &Arc<Source>, start: usize) -> Result<(Node, Vec<Node>), Diagnostic> {
        let mut reader = Reader { source, at: start, depth: 0 };
        let first = reader.value()?;
        let mut others = Vec::new();
        loop {
            reader.skip_blank()?;
            match reader.peek() {
                None => return Ok((first, others)),
                Some(',') => reader.at += 1,
                Some(_) => return Err(reader.expected("the end of the text")),
            }
            others.push(reader.value()?);
        }
    }

    /// The identifier in front of the parentheses, or a bare identifier.
    pub fn name(&self) -> Option<&str> {
        match &self.kind {
            Kind::Struct { name, .. } | Kind::Tuple { name, .. } => name.as_ref().map(Origin::text),
            Kind::Leaf => {
                let text = self.origin.text();
                text.starts_with(|c: char| c.is_alphabetic() || c == '_').then_some(text)
            }
            _ => None,
        }
    }

    /// Where the name stands, or the first line of a value without one: a place short enough to point at.
    pub fn head(&self) -> Origin {
        match &self.kind {
            Kind::Struct { name: Some(name), .. } | Kind::Tuple { name: Some(name), .. } => name.clone(),
            _ => first_line(&self.origin),
        }
    }

    pub fn field(&self, name: &str) -> Option<&Node> {
        match &self.kind {
            Kind::Struct { fields, .. } => fields.iter().find(|field| field.name == name).map(|field| &field.value),
            _ => None,
        }
    }

    /// What stands in a list; nothing if this is none.
    pub fn items(&self) -> &[Node] {
        match &self.kind {
            Kind::List(items) => items,
            _ => &[],
        }
    }

    /// Puts `value` at the dotted `path` of struct fields, inserting a field that is not written (its default
    /// is what gets replaced). `key` is where the path was written. A leading or interleaved segment that
    /// repeats the struct's own name (`camera.Flight.frames`) is allowed.
    pub fn set(&mut self, path: &[&str], key: &Origin, value: &Node) -> Result<(), Diagnostic> {
        let Some((first, rest)) = path.split_first() else {
            *self = value.clone();
            return Ok(());
        };
        if self.name() == Some(first) {
            return self.set(rest, key, value);
        }
        self.unit_to_struct();
        let described = self.name().unwrap_or("this value").to_string();
        match &mut self.kind {
            Kind::Struct { fields, .. } => {
                if let Some(field) = fields.iter_mut().find(|field| field.name == *first) {
                    return field.value.set(rest, key, value);
                }
                if !rest.is_empty() {
                    let known: Vec<&str> = fields.iter().map(|field| field.name.as_str()).collect();
                    return Err(Diagnostic::input(format!("`{described}` has no field `{first}` written out"))
                        .at(key, "this path goes through it")
                        .suggest(first, known));
                }
                fields.push(Field { name: first.to_string(), origin: key.clone(), value: value.clone() });
                Ok(())
            }
            Kind::Tuple { items, .. } => match first.parse::<usize>().ok().and_then(|index| items.get_mut(index)) {
                Some(node) => node.set(rest, key, value),
                None => Err(no_part(key, &described, first)),
            },
            Kind::List(items) => match first.parse::<usize>().ok().and_then(|index| items.get_mut(index)) {
                Some(node) => node.set(rest, key, value),
                None => Err(no_part(key, &described, first)),
            },
            Kind::Map(entries) => {
                let found = entries.iter_mut().find(|(name, _)| name.origin.text().trim_matches('"') == *first);
                match found {
                    Some((_, node)) => node.set(rest, key, value),
                    None => Err(no_part(key, &described, first)),
                }
            }
            Kind::Leaf => Err(no_part(key, &described, first)),
        }
    }

    /// `Stage` and `Stage()` are both ways to write a stage with only defaults; as a struct it can take fields.
    fn unit_to_struct(&mut self) {
        let name = match &self.kind {
            Kind::Leaf if self.name().is_some() => Some(self.origin.clone()),
            Kind::Tuple { name, items } if items.is_empty() => name.clone(),
            _ => return,
        };
        self.kind = Kind::Struct { name, fields: Vec::new() };
    }

    /// Reads the node as `T` through the `ron` crate; mistakes come back with the place they were written at.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, Diagnostic> {
        let mut rendered = Rendered::default();
        rendered.node(self);
        rendered.parse(&self.origin)
    }

    /// Like [`Node::parse`], for a struct whose name was already looked at (a stage, a measure): only its
    /// parenthesised part is read. A bare identifier reads as "all defaults".
    pub fn parse_fields<T: DeserializeOwned>(&self) -> Result<T, Diagnostic> {
        let mut rendered = Rendered::default();
        match &self.kind {
            Kind::Struct { fields, .. } => rendered.fields(fields, &self.origin),
            Kind::Tuple { items, .. } if !items.is_empty() => rendered.items('(', items, ')', &self.origin),
            Kind::List(_) | Kind::Map(_) => rendered.node(self),
            Kind::Leaf | Kind::Tuple { .. } => rendered.push("()", &self.origin),
        }
        rendered.parse(&self.origin)
    }

    /// The value without comments and layout: what a cell's identity is made of.
    pub fn canonical(&self) -> String {
        let mut rendered = Rendered::default();
        rendered.node(self);
        rendered.text
    }
}

fn no_part(key: &Origin, described: &str, part: &str) -> Diagnostic {
    Diagnostic::input(format!("`{described}` has no part `{part}`")).at(key, "this path goes through it")
}

/// One-line RON text and, for every piece of it, where the piece came from.
#[derive(Default)]
struct Rendered {
    text: String,
    pieces: Vec<(usize, Origin)>,
}

impl Rendered {
    fn push(&mut self, text: &str, origin: &Origin) {
        self.pieces.push((self.text.len(), origin.clone()));
        self.text.push_str(text);
    }

    fn node(&mut self, node: &Node) {
        match &node.kind {
            Kind::Leaf => self.push(node.origin.text(), &node.origin),
            Kind::Struct { name, fields } => {
                name.iter().for_each(|name| self.push(name.text(), name));
                self.fields(fields, &node.origin);
            }
            Kind::Tuple { name, items } => {
                name.iter().for_each(|name| self.push(name.text(), name));
                self.items('(', items, ')', &node.origin);
            }
            Kind::List(items) => self.items('[', items, ']', &node.origin),
            Kind::Map(entries) => {
                self.push("{", &node.origin);
                for (key, value) in entries {
                    self.node(key);
                    self.push(":", &key.origin);
                    self.node(value);
                    self.push(",", &value.origin);
                }
                self.push("}", &node.origin);
            }
        }
    }

    fn fields(&mut self, fields: &[Field], origin: &Origin) {
        self.push("(", origin);
        for Field { name, origin, value } in fields {
            self.push(name, origin);
            self.push(":", &value.origin);
            self.node(value);
            self.push(",", &value.origin);
        }
        self.push(")", origin);
    }

    fn items(&mut self, open: char, items: &[Node], close: char, origin: &Origin) {
        self.push(&open.to_string(), origin);
        for (index, item) in items.iter().enumerate() {
            if index > 0 {
                self.push(",", &item.origin);
            }
            self.node(item);
        }
        self.push(&close.to_string(), origin);
    }

    fn parse<T: DeserializeOwned>(&self, whole: &Origin) -> Result<T, Diagnostic> {
        let options = ron::Options::default()
            .with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME)
            .with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
        options.from_str(&self.text).map_err(|error| {
            // `ron` counts lines and columns from 1, columns in characters
            let position = error.span.start;
            let line_start: usize =
                self.text.split_inclusive('\n').take(position.line.saturating_sub(1)).map(str::len).sum();
            let column: usize =
                self.text[line_start..].chars().take(position.col.saturating_sub(1)).map(char::len_utf8).sum();
            let piece = self.pieces.partition_point(|(start, _)| *start <= line_start + column);
            let origin = piece.checked_sub(1).and_then(|at| self.pieces.get(at)).map_or(whole, |(_, origin)| origin);
            Diagnostic::input(error.code.to_string()).at(&first_line(origin), "here")
        })
    }
}

/// A place that spans many lines is shown by its first line: the rest would bury the message.
fn first_line(origin: &Origin) -> Origin {
    let end = origin.text().find('\n').map_or(origin.range.end, |at| origin.range.start + at);
    Origin { source: origin.source.clone(), range: origin.range.start..end }
}

/// Brackets in brackets, more than any experiment has and fewer than a stack can hold.
const DEEPEST: usize = 100;

struct Reader<'a> {
    source: &'a Arc<Source>,
    at: usize,
    depth: usize,
}

impl<'a> Reader<'a> {
    fn rest(&self) -> &'a str {
        &self.source.text[self.at..]
    }

    fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    fn origin(&self, range: Range<usize>) -> Origin {
        Origin { source: self.source.clone(), range }
    }

    fn expected(&self, what: &str) -> Diagnostic {
        let (found, width) = match self.peek() {
            Some(c) => (format!("`{c}`"), c.len_utf8()),
            None => ("the end of the text".into(), 0),
        };
        Diagnostic::input(format!("expected {what}, found {found}")).at(&self.origin(self.at..self.at + width), "here")
    }

    fn skip_blank(&mut self) -> Result<(), Diagnostic> {
        loop {
            let trimmed = self.rest().trim_start();
            self.at = self.source.text.len() - trimmed.len();
            if trimmed.starts_with("//") {
                self.at += trimmed.find('\n').unwrap_or(trimmed.len());
            } else if trimmed.starts_with("/*") {
                self.block_comment()?;
            } else {
                return Ok(());
            }
        }
    }

    fn block_comment(&mut self) -> Result<(), Diagnostic> {
        let start = self.at;
        let mut depth = 0usize;
        loop {
            if self.rest().starts_with("/*") {
                depth += 1;
                self.at += 2;
            } else if self.rest().starts_with("*/") {
                depth -= 1;
                self.at += 2;
                if depth == 0 {
                    return Ok(());
                }
            } else if let Some(c) = self.peek() {
                self.at += c.len_utf8();
            } else {
                return Err(
                    Diagnostic::input("this comment is never closed").at(&self.origin(start..start + 2), "opened here")
                );
            }
        }
    }

    fn skip_attributes(&mut self) -> Result<(), Diagnostic> {
        self.skip_blank()?;
        while self.rest().starts_with("#![") {
            match self.rest().find(']') {
                Some(end) => self.at += end + 1,
                None => return Err(self.expected("`]` after this attribute")),
            }
            self.skip_blank()?;
        }
        Ok(())
    }

    fn value(&mut self) -> Result<Node, Diagnostic> {
        self.skip_blank()?;
        let start = self.at;
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(Diagnostic::input(format!("more than {DEEPEST} brackets stand in each other"))
                .at(&self.origin(start..start), "here"));
        }
        let kind = match self.peek() {
            Some('[') => Kind::List(self.sequence(']')?),
            Some('{') => self.map()?,
            Some('(') => self.parenthesised(None)?,
            Some('"') => self.string()?,
            Some('\'') => self.character()?,
            Some(c) if c.is_alphabetic() || c == '_' => self.word()?,
            Some(c) if c.is_ascii_digit() || "+-.".contains(c) => self.number(),
            _ => return Err(self.expected("a value")),
        };
        self.depth -= 1;
        Ok(Node { origin: self.origin(start..self.at), kind })
    }

    fn word(&mut self) -> Result<Kind, Diagnostic> {
        if self.rest().starts_with("r\"") || self.rest().starts_with("r#") {
            return self.raw_string();
        }
        let name = self.identifier();
        let after = self.at;
        self.skip_blank()?;
        if self.peek() == Some('(') {
            return self.parenthesised(Some(name));
        }
        self.at = after;
        Ok(Kind::Leaf)
    }

    fn identifier(&mut self) -> Origin {
        let start = self.at;
        let length = self.rest().find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(self.rest().len());
        self.at += length;
        self.origin(start..self.at)
    }

    fn number(&mut self) -> Kind {
        let sign_after_exponent = |text: &str, at: usize| {
            let hex = text.starts_with("0x") || text.starts_with("-0x");
            !hex && at > 0 && matches!(text.as_bytes()[at - 1], b'e' | b'E')
        };
        let text = self.rest();
        let end = text
            .char_indices()
            .find(|&(at, c)| {
                !(c.is_alphanumeric() || c == '_' || c == '.')
                    && !(at == 0 && (c == '+' || c == '-'))
                    && !((c == '+' || c == '-') && sign_after_exponent(text, at))
            })
            .map_or(text.len(), |(at, _)| at);
        self.at += end;
        Kind::Leaf
    }

    fn string(&mut self) -> Result<Kind, Diagnostic> {
        let start = self.at;
        let mut escaped = false;
        for (at, c) in self.rest().char_indices().skip(1) {
            match c {
                '"' if !escaped => {
                    self.at = start + at + 1;
                    return Ok(Kind::Leaf);
                }
                _ => escaped = c == '\\' && !escaped,
            }
        }
        Err(Diagnostic::input("this string is never closed").at(&self.origin(start..start + 1), "opened here"))
    }

    fn raw_string(&mut self) -> Result<Kind, Diagnostic> {
        let hashes = self.rest()[1..].chars().take_while(|c| *c == '#').count();
        let close = format!("\"{}", "#".repeat(hashes));
        let body = 2 + hashes;
        match self.rest().get(body..).and_then(|text| text.find(&close)) {
            Some(end) => {
                self.at += body + end + close.len();
                Ok(Kind::Leaf)
            }
            None => Err(Diagnostic::input("this raw string is never closed")
                .at(&self.origin(self.at..self.at + 1), "opened here")),
        }
    }

    fn character(&mut self) -> Result<Kind, Diagnostic> {
        let length = self.rest().char_indices().skip(2).find(|(_, c)| *c == '\'').map(|(at, _)| at + 1);
        match length {
            Some(length) => {
                self.at += length;
                Ok(Kind::Leaf)
            }
            None => Err(self.expected("a closed character")),
        }
    }

    /// After the opening bracket: values up to `close`.
    fn sequence(&mut self, close: char) -> Result<Vec<Node>, Diagnostic> {
        self.at += 1;
        let mut items = Vec::new();
        while !self.closes(close)? {
            items.push(self.value()?);
            self.separator(close)?;
        }
        Ok(items)
    }

    fn map(&mut self) -> Result<Kind, Diagnostic> {
        self.at += 1;
        let mut entries = Vec::new();
        while !self.closes('}')? {
            let key = self.value()?;
            self.skip_blank()?;
            if self.peek() != Some(':') {
                return Err(self.expected("`:` after this key"));
            }
            self.at += 1;
            entries.push((key, self.value()?));
            self.separator('}')?;
        }
        Ok(Kind::Map(entries))
    }

    fn parenthesised(&mut self, name: Option<Origin>) -> Result<Kind, Diagnostic> {
        let open = self.at;
        self.at += 1;
        if !self.field_follows()? {
            self.at = open;
            return Ok(Kind::Tuple { name, items: self.sequence(')')? });
        }
        let mut fields: Vec<Field> = Vec::new();
        let mut known: HashMap<&str, Range<usize>> = HashMap::new();
        while !self.closes(')')? {
            if !self.field_follows()? {
                return Err(self.expected("a field `name: value`"));
            }
            let key = self.identifier();
            if let Some(first) = known.insert(&self.source.text[key.range.clone()], key.range.clone()) {
                return Err(Diagnostic::input(format!("the field `{}` is given twice", key.text()))
                    .at(&key, "a second time")
                    .at(&self.origin(first), "first here"));
            }
            self.skip_blank()?;
            self.at += 1;
            fields.push(Field { name: key.text().to_string(), origin: key, value: self.value()? });
            self.separator(')')?;
        }
        Ok(Kind::Struct { name, fields })
    }

    /// Looks ahead for `name :` without consuming it.
    fn field_follows(&mut self) -> Result<bool, Diagnostic> {
        self.skip_blank()?;
        let start = self.at;
        let named = self.peek().is_some_and(|c| c.is_alphabetic() || c == '_') && {
            self.identifier();
            self.skip_blank()?;
            self.peek() == Some(':')
        };
        self.at = start;
        Ok(named)
    }

    fn closes(&mut self, close: char) -> Result<bool, Diagnostic> {
        self.skip_blank()?;
        let closes = self.peek() == Some(close);
        self.at += usize::from(closes);
        Ok(closes)
    }

    fn separator(&mut self, close: char) -> Result<(), Diagnostic> {
        self.skip_blank()?;
        match self.peek() {
            Some(',') => {
                self.at += 1;
                Ok(())
            }
            Some(c) if c == close => Ok(()),
            _ => Err(self.expected(&format!("`,` or `{close}`"))),
        }
    }
}
