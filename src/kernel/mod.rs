//! WGSL kernels: assembled from files, reflected by naga, never mirrored by hand.
//!
//! A kernel file may start with lines `//!include lib/NAME.wgsl`. Each included file stands once, in front of
//! the file that wants it, and every byte of the assembled text knows the file it came from, so that a
//! mistake is reported where it was written. A line `//!include ground` takes in the file of the form in which the ground is held.

mod assemble;
mod catalogue;
mod limits;
mod loops;
mod reflect;
mod stack;
mod tokens;
mod value;

use std::sync::Arc;

use crate::experiment::diagnostic::{Diagnostic, Source};

pub use assemble::{Assembled, GroundForm, built_in_folder, read_from_checkout};
pub use reflect::{
    Binding, BindingKind, Elem, Entry, Field, FieldKind, GROUND_GROUP, Nested, OWN_GROUP, Packing, Structure,
};
pub use stack::on_large_stack;
pub use value::Value;

/// A kernel file that passed naga's validation, and what is known of its entry points.
#[derive(Debug)]
pub struct Kernel {
    /// The name that errors and timings use: the file's name.
    pub name: String,
    pub assembled: Assembled,
    /// Identity of the text that runs, included files among it.
    pub hash: String,
    pub entries: Vec<Entry>,
    /// `override` constants by name.
    pub overrides: Vec<String>,
    /// Kernels of this crate run without the driver's bounds checks; a user's kernel keeps them.
    pub trusted: bool,
    module: naga::Module,
}

impl Kernel {
    /// A kernel from any text; `source.name` is what errors show. `form` is how the ground is held; without, as the kernel would have it.
    pub fn from_source(
        source: Arc<Source>,
        trusted: bool,
        form: Option<GroundForm>,
    ) -> Result<Arc<Kernel>, Diagnostic> {
        let name = source.name.rsplit('/').next().unwrap_or_default().to_string();
        let assembled = Assembled::new(source, form)?;
        limits::check_text(&assembled)?;
        let reflected = on_large_stack(|| reflect::reflect(&assembled, trusted));
        let (entries, overrides, module) =
            reflected.map_err(|why| Diagnostic::run(why).at(&assembled.main.everywhere(), "in this kernel"))??;
        let hash = blake3::hash(assembled.text.as_bytes()).to_hex().as_str()[..16].to_string();
        Ok(Arc::new(Kernel { name, assembled, hash, entries, overrides, trusted, module }))
    }

    pub fn entry(&self, name: &str) -> Result<&Entry, Diagnostic> {
        let entry = self.entries.iter().find(|entry| entry.name == name).ok_or_else(|| {
            Diagnostic::input(format!("`{}` has no entry point `{name}`", self.name))
                .at(&self.assembled.main.everywhere(), "in this kernel")
                .suggest(name, self.entries.iter().map(|entry| entry.name.as_str()))
        })?;
        entry.refused.clone().map_or(Ok(entry), Err)
    }

    /// How often the loops of a thread turn in all, as far as the kernel's text says so; `parameter` is the value of a field of its uniform
    /// structure, where it is a whole number.
    pub fn turns(&self, entry: &str, parameter: impl Fn(&str) -> Option<i64>) -> u64 {
        let found = self.module.entry_points.iter().find(|known| known.name == entry);
        found.map_or(0, |entry| loops::turns(&self.module, entry, &parameter))
    }

    /// The same kernel with the ground in another form.
    pub fn with_ground(self: &Arc<Self>, form: Option<GroundForm>) -> Result<Arc<Kernel>, Diagnostic> {
        match (self.assembled.ground, form) {
            (Some(own), Some(form)) if own != form => {
                Self::from_source(self.assembled.main.clone(), self.trusted, Some(form))
            }
            _ => Ok(self.clone()),
        }
    }

    /// What a variable is bound to, in any of the entry points.
    pub fn binding(&self, variable: &str) -> Option<&BindingKind> {
        let mut bindings = self.entries.iter().flat_map(|entry| &entry.bindings);
        bindings.find(|binding| binding.name == variable).map(|binding| &binding.kind)
    }
}
