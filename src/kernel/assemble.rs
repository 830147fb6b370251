//! Kernel files joined to one text with a span table back to the files.

use std::borrow::Cow;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use include_dir::{Dir, include_dir};

use crate::experiment::diagnostic::{Diagnostic, Origin, Source};

static KERNELS: Dir = include_dir!("$CARGO_MANIFEST_DIR/kernels");
const INCLUDE: &str = "//!include ";
/// The line that takes in the ground, and the same for a kernel that is faster with an image of it.
const GROUND: &str = "ground";
const GROUND_AS_IMAGE: &str = "ground as image";

/// In which form a kernel finds the ground's samples: a file of `kernels/ground/`, all of which have the same functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum GroundForm {
    Array,
    Image,
}

impl GroundForm {
    fn file(self) -> &'static str {
        match self {
            GroundForm::Array => "ground/array.wgsl",
            GroundForm::Image => "ground/image.wgsl",
        }
    }
}

/// The text naga and the driver see.
#[derive(Debug)]
pub struct Assembled {
    pub text: String,
    /// The file that was asked for.
    pub main: Arc<Source>,
    /// The form of the ground that it was assembled with; `None` if it does not look at the ground.
    pub ground: Option<GroundForm>,
    /// Start in `text` of each file, ascending.
    files: Vec<(usize, Arc<Source>)>,
}

/// Where kernels are read from instead of those that are part of the program: the `kernels` of a checkout that somebody works in.
static FOLDER: OnceLock<Option<PathBuf>> = OnceLock::new();

/// From now on kernels are read from `kernels` in the current folder, if that is lodlab's. Kernels that are known stay as they are; see
/// [`Kernel::forget_built_in`](super::Kernel::forget_built_in).
pub fn read_from_checkout() {
    let folder = PathBuf::from("kernels");
    let is_ours = folder.join(GroundForm::Array.file()).is_file();
    FOLDER.get_or_init(|| is_ours.then_some(folder));
}

/// The folder that kernels are read from, if they are not those of the program.
pub fn built_in_folder() -> Option<PathBuf> {
    FOLDER.get().cloned().flatten()
}

pub fn built_in_text(name: &str) -> Option<Cow<'static, str>> {
    let own = KERNELS.get_file(name)?.contents_utf8()?;
    let newer = built_in_folder().and_then(|folder| std::fs::read_to_string(folder.join(name)).ok());
    Some(newer.map_or(Cow::Borrowed(own), Cow::Owned))
}

/// Kernel files by room; `lib/` has what they share, `ground/` what they know of the ground.
pub fn built_in_paths() -> Vec<String> {
    let is_shared = |dir: &&Dir| dir.path().starts_with("lib") || dir.path().starts_with("ground");
    let rooms = KERNELS.dirs().filter(|dir| !is_shared(dir));
    let files = rooms.flat_map(|room| room.files());
    let mut paths: Vec<String> = files.map(|file| file.path().display().to_string()).collect();
    paths.sort();
    paths
}

impl Assembled {
    /// `form` is how the ground is held; without, as the kernel would have it.
    pub fn new(main: Arc<Source>, form: Option<GroundForm>) -> Result<Self, Diagnostic> {
        let form = form.unwrap_or(if prefers_image(&main.text) { GroundForm::Image } else { GroundForm::Array });
        let mut assembled = Self { text: String::new(), main: main.clone(), ground: None, files: Vec::new() };
        assembled.add(main, form, &mut Vec::new())?;
        Ok(assembled)
    }

    fn add(&mut self, source: Arc<Source>, form: GroundForm, seen: &mut Vec<String>) -> Result<(), Diagnostic> {
        seen.push(source.name.clone());
        for (start, line) in include_lines(&source.text) {
            let mut name = line[INCLUDE.len()..].trim();
            if name == GROUND || name == GROUND_AS_IMAGE {
                self.ground = Some(form);
                name = form.file();
            }
            if seen.contains(&format!("kernels/{name}")) {
                continue;
            }
            let Some(text) = built_in_text(name) else {
                let origin = Origin { source: source.clone(), range: start..start + line.len() };
                return Err(Diagnostic::input(format!("there is no kernel library `{name}`"))
                    .at(&origin, "included here")
                    .suggest(name, library_names().iter().map(String::as_str)));
            };
            self.add(Source::new(format!("kernels/{name}"), text.into_owned()), form, seen)?;
        }
        self.files.push((self.text.len(), source.clone()));
        self.text.push_str(&source.text);
        self.text.push('\n');
        Ok(())
    }

    /// The files that it consists of.
    pub fn sources(&self) -> impl Iterator<Item = &Arc<Source>> {
        self.files.iter().map(|(_, source)| source)
    }

    /// The place in a file that a byte range of the assembled text came from.
    pub fn origin(&self, range: Range<usize>) -> Origin {
        let file = self.files.partition_point(|(start, _)| *start <= range.start).saturating_sub(1);
        let (start, source) = &self.files[file];
        let clamp = |at: usize| at.saturating_sub(*start).min(source.text.len());
        Origin { source: source.clone(), range: clamp(range.start)..clamp(range.end) }
    }
}

/// Whether a kernel, or anything that it takes in, would have the ground as an image.
fn prefers_image(text: &str) -> bool {
    include_lines(text).any(|(_, line)| {
        let name = line[INCLUDE.len()..].trim();
        name == GROUND_AS_IMAGE || built_in_text(name).is_some_and(|text| prefers_image(&text))
    })
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
    let libraries = files.into_iter().flatten().map(|file| file.path().display().to_string());
    libraries.chain([GROUND.to_string()]).collect()
}
