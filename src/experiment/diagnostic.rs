//! A user's mistake, told in the user's own file: what was found, what was expected, what to do.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use codespan_reporting::diagnostic as codespan;
use codespan_reporting::files::SimpleFiles;
use codespan_reporting::term;

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
        }
    }

    /// "did you mean" for a name that is not among the known ones.
    pub fn suggest<'a>(self, found: &str, known: impl IntoIterator<Item = &'a str>) -> Self {
        let known: Vec<&str> = known.into_iter().collect();
        let close =
            known.iter().max_by(|a, b| strsim::jaro_winkler(found, a).total_cmp(&strsim::jaro_winkler(found, b)));
        match close {
            Some(name) if strsim::jaro_winkler(found, name) > 0.8 => self.help(format!("did you mean `{name}`?")),
            _ if known.is_empty() => self.help("there are none here"),
            _ => self.help(format!("known: {}", known.join(", "))),
        }
    }
}

impl fmt::Display for Diagnostic {
    /// The whole diagnostic with its source lines, as it is shown to the user, without colours.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut files = SimpleFiles::new();
        let mut labels = Vec::new();
        for (index, (origin, text)) in self.labels.iter().enumerate() {
            let id = files.add(origin.source.name.as_str(), origin.source.text.as_str());
            let style = if index == 0 { codespan::LabelStyle::Primary } else { codespan::LabelStyle::Secondary };
            labels.push(codespan::Label::new(style, id, origin.range.clone()).with_message(text));
        }
        let report = codespan::Diagnostic::error()
            .with_message(&self.message)
            .with_labels(labels)
            .with_notes(self.help.iter().map(|help| format!("help: {help}")).collect());
        let config = term::Config::default();
        let shown = term::emit_into_string(&config, &files, &report).map_err(|_| fmt::Error)?;
        f.write_str(shown.trim_end())
    }
}
