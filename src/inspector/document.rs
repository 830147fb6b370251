//! The experiment that is looked at: its text, what was changed in it, and the text with the changes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::experiment::Experiment;
use crate::experiment::diagnostic::{Diagnostic, Source};
use crate::experiment::regular;
use crate::experiment::sweep::{self, Setting};

/// An experiment and the parameters that were changed, by their paths as `--set` has them.
#[derive(Clone, Debug, PartialEq)]
pub struct Document {
    /// Where it was read, for messages and for saving.
    pub path: PathBuf,
    pub source: Arc<Source>,
    pub changed: BTreeMap<String, String>,
}

impl Document {
    pub fn load(path: &Path) -> Result<Self, Diagnostic> {
        let shown = path.display();
        let text = regular::read_to_string(path)
            .map_err(|error| Diagnostic::input(format!("cannot read the experiment `{shown}`: {error}")))?;
        let source = Source::new(shown.to_string(), text);
        Ok(Self { path: path.to_path_buf(), source, changed: BTreeMap::new() })
    }

    /// Paths in the experiment are relative to this folder.
    pub fn folder(&self) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).to_path_buf()
    }

    pub fn read(&self) -> Result<Experiment, Diagnostic> {
        Experiment::read(self.source.clone(), self.folder())
    }

    pub fn settings(&self) -> Result<Vec<Setting>, Diagnostic> {
        self.changed.iter().map(|(path, value)| sweep::read_setting(&format!("{path}={value}"))).collect()
    }

    /// The experiment's text with the changes written into it; comments and layout stay.
    pub fn text(&self) -> Result<String, Diagnostic> {
        self.read()?.text_with(&self.settings()?)
    }

    /// Writes the changed text to a new file, which becomes the document.
    pub fn save_as(&mut self, path: &Path) -> Result<(), Diagnostic> {
        let text = self.text()?;
        std::fs::write(path, &text)
            .map_err(|error| Diagnostic::run(format!("cannot write `{}`: {error}", path.display())))?;
        *self = Self::load(path)?;
        Ok(())
    }
}
