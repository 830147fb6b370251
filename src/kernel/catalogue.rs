//! The kernels that come with lodlab: each is assembled, parsed and validated once a process.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::{GroundForm, Kernel, assemble};
use crate::experiment::diagnostic::{Diagnostic, Source};

type Known = HashMap<(String, Option<GroundForm>), Arc<Kernel>>;

static KNOWN: OnceLock<Mutex<Known>> = OnceLock::new();

impl Kernel {
    /// One of the kernels that come with lodlab by its path under `kernels/`, for example `rays/ray_cast.wgsl`.
    /// `form` is how the ground is held; without, as the kernel would have it.
    pub fn built_in(path: &str, form: Option<GroundForm>) -> Result<Arc<Kernel>, Diagnostic> {
        // a thread that failed while it held the lock has left whole kernels only
        let mut known = KNOWN.get_or_init(Default::default).lock().unwrap_or_else(PoisonError::into_inner);
        let key = (path.to_string(), form);
        if let Some(kernel) = known.get(&key) {
            return Ok(kernel.clone());
        }
        let text = assemble::built_in_text(path)
            .ok_or_else(|| Diagnostic::run(format!("lodlab has no kernel file `{path}`")))?;
        let kernel = Self::from_source(Source::new(format!("kernels/{path}"), text.into_owned()), true, form)?;
        known.insert(key, kernel.clone());
        Ok(kernel)
    }

    /// Reads kernels anew from now on, since their files have changed.
    pub fn forget_built_in() {
        KNOWN.get_or_init(Default::default).lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// The paths of all kernel files that come with lodlab, by room; libraries are not among them.
    pub fn built_in_paths() -> Vec<String> {
        assemble::built_in_paths()
    }
}
