//! A user's mistake, told in the user's own file: what was found, what was expected, what to do.

use std::borrow::Cow;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use codespan_reporting::diagnostic as codespan;
use codespan_reporting::term;

use super::excerpt::{Excerpt, Excerpts};

/// A text a mistake can be in: an experiment file, a kernel, one `--set` argument.
#[derive(Debug, PartialEq, Eq)]
pub struct Source {
    pub name: String,
    pub text: String,
}

impl Source {
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Arc<Self> {
        Arc::new(Self { name: name.into(), text: text.into() })
    }

    /// The whole text as one place, for mistakes that are about the file and not about a part of it.
    pub fn everywhere(self: &Arc<Self>) -> Origin {
        Origin { source: self.clone(), range: 0..0 }
    }
}

/// A byte range of a source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    pub source: Arc<Source>,
    pub range: Range<usize>,
}

impl Origin {
    pub fn text(&self) -> &str {
        &self.source.text[self.range.clone()]
    }

    /// Line and column of the start, both from 1, the column in characters.
    pub fn line_column(&self) -> (usize, usize) {
        let before = &self.source.text[..self.range.start.min(self.source.text.len())];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

/// Whose turn it is to act; decides the exit status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The command line or a file is wrong: exit status 2.
    Input,
    /// The experiment could not be carried out (device, disk, a failed check): exit status 1.
    Run,
    /// Somebody has ended it: exit status 130, as shells have it.
    Interrupted,
}

/// One message with the places it is about. The first label is the place to look at first.
#[derive(Clone, Debug, thiserror::Error)]
pub struct Diagnostic {
    pub fault: Fault,
    pub message: String,
    pub labels: Vec<(Origin, String)>,
    pub help: Option<String>,
}

impl Diagnostic {
    pub fn input(message: impl Into<String>) -> Self {
        Self { fault: Fault::Input, message: message.into(), labels: Vec::new(), help: None }
    }

    pub fn run(message: impl Into<String>) -> Self {
        Self { fault: Fault::Run, ..Self::input(message) }
    }

    pub fn interrupted(message: impl Into<String>) -> Self {
        Self { fault: Fault::Interrupted, ..Self::input(message) }
    }

    pub fn at(mut self, origin: &Origin, label: impl Into<String>) -> Self {
        self.labels.push((origin.clone(), label.into()));
        self
    }

    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Adds the place only where none is known yet: a caller knows the file, its callee the exact spot.
    pub fn or_at(self, origin: &Origin, label: &str) -> Self {
        if self.labels.is_empty() { self.at(origin, label) } else { self }
    }

    pub fn exit_code(&self) -> u8 {
        match self.fault {
            Fault::Input => 2,
            Fault::Run => 1,
            Fault::Interrupted => 130,
        }
    }

    /// "did you mean" for a name that is not among the known ones.
    pub fn suggest<'a>(self, found: &str, known: impl IntoIterator<Item = &'a str>) -> Self {
        let known: Vec<&str> = known.into_iter().collect();
        // to compare two names takes the product of their lengths
        let is_name = |name: &str| name.len() <= LONGEST_NAME;
        let likeness = |name: &str| match is_name(found) && is_name(name) {
            true => strsim::jaro_winkler(found, name),
            false => 0.0,
        };
        let close = known.iter().map(|name| (likeness(name), name)).max_by(|(a, _), (b, _)| a.total_cmp(b));
        match close {
            Some((likeness, name)) if likeness > 0.8 => self.help(format!("did you mean `{name}`?")),
            _ if known.is_empty() => self.help("there are none here"),
            _ => self.help(format!("known: {}", known.join(", "))),
        }
    }
}

/// Bytes of what can be a slip of a name.
const LONGEST_NAME: usize = 100;
/// Characters of a message, a label or a help; names and values in it can be as long as the file.
const LONGEST: usize = 1000;

/// A text without its middle if it is too long: both its ends say something.
fn shortened(text: &str) -> Cow<'_, str> {
    let count = text.chars().count();
    if count <= LONGEST {
        return text.into();
    }
    let (head, tail) = (2 * LONGEST / 3, LONGEST / 3);
    let byte = |at: usize| text.char_indices().nth(at).map_or(text.len(), |(byte, _)| byte);
    format!("{} … {}", &text[..byte(head)], &text[byte(count - tail)..]).into()
}

impl fmt::Display for Diagnostic {
    /// The whole diagnostic with its source lines, as it is shown to the user, without colours.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (mut excerpts, mut labels) = (Vec::new(), Vec::new());
        for (index, (origin, text)) in self.labels.iter().enumerate() {
            let (excerpt, place) = Excerpt::new(origin);
            excerpts.push(excerpt);
            let style = if index == 0 { codespan::LabelStyle::Primary } else { codespan::LabelStyle::Secondary };
            labels.push(codespan::Label::new(style, index, place).with_message(shortened(text)));
        }
        let files = Excerpts(excerpts);
        let report = codespan::Diagnostic::error()
            .with_message(shortened(&self.message))
            .with_labels(labels)
            .with_notes(self.help.iter().map(|help| format!("help: {}", shortened(help))).collect());
        let config = term::Config::default();
        let shown = term::emit_into_string(&config, &files, &report).map_err(|_| fmt::Error)?;
        f.write_str(shown.trim_end())
    }
}
