//! Kernel files joined to one text with a span table back to the files.

use std::ops::Range;
use std::sync::Arc;

use include_dir::{Dir, include_dir};

use crate::experiment::diagnostic::{Diagnostic, Origin, Source};

static KERNELS: Dir = include_dir!("$CARGO_MANIFEST_DIR/kernels");
const INCLUDE: &str = "//!include ";

/// The text naga and the driver see.
#[derive(Debug)]
pub struct Assembled {
    pub text: String,
    /// The file that was asked for.
    pub main: Arc<Source>,
    /// Start in `text` of each file, ascending.
    files: Vec<(usize, Arc<Source>)>,
}

pub fn built_in_text(name: &str) -> Option<&'static str> {
    KERNELS.get_file(name)?.contents_utf8()
}

/// Kernel files by room; `lib/` has what they share.
pub fn built_in_paths() -> Vec<String> {
    let rooms = KERNELS.dirs().filter(|dir| !dir.path().starts_with("lib"));
    let files = rooms.flat_map(|room| room.files());
    let mut paths: Vec<String> = files.map(|file| file.path().display().to_string()).collect();
    paths.sort();
    paths
}

impl Assembled {
    pub fn new(main: Arc<Source>) -> Result<Self, Diagnostic> {
        let mut assembled = Self { text: String::new(), main: main.clone(), files: Vec::new() };
        assembled.add(main, &mut Vec::new())?;
        Ok(assembled)
    }

    fn add(&mut self, source: Arc<Source>, seen: &mut Vec<String>) -> Result<(), Diagnostic> {
        seen.push(source.name.clone());
        for (start, line) in include_lines(&source.text) {
            let name = line[INCLUDE.len()..].trim();
            if seen.contains(&format!("kernels/{name}")) {
                continue;
            }
            let Some(text) = built_in_text(name) else {
                let origin = Origin { source: source.clone(), range: start..start + line.len() };
                return Err(Diagnostic::input(format!("there is no kernel library `{name}`"))
                    .at(&origin, "included here")
                    .suggest(name, library_names().iter().map(String::as_str)));
            };
            self.add(Source::new(format!("kernels/{name}"), text), seen)?;
        }
        self.files.push((self.text.len(), source.clone()));
        self.text.push_str(&source.text);
        self.text.push('\n');
        Ok(())
    }

    /// The place in a file that a byte range of the assembled text came from.
    pub fn origin(&self, range: Range<usize>) -> Origin {
        let file = self.files.partition_point(|(start, _)| *start <= range.start).saturating_sub(1);
        let (start, source) = &self.files[file];
        let clamp = |at: usize| at.saturating_sub(*start).min(source.text.len());
        Origin { source: source.clone(), range: clamp(range.start)..clamp(range.end) }
    }
}

/// The include lines at the top of a file: only blank lines and comments may stand before them.
fn include_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut start = 0;
    text.split_inclusive('\n')
        .map(move |line| {
            let at = start;
            start += line.len();
            (at, line.trim_end())
        })
        .take_while(|(_, line)| line.is_empty() || line.starts_with("//"))
        .filter(|(_, line)| line.starts_with(INCLUDE))
}

fn library_names() -> Vec<String> {
    let files = KERNELS.get_dir("lib").map(|dir| dir.files());
    files.into_iter().flatten().map(|file| file.path().display().to_string()).collect()
}
