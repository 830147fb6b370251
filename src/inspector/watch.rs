//! Files of kernels that change while they are looked at.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::SystemTime;

use super::wish::Shown;
use crate::kernel::{Kernel, built_in_folder};

/// Seconds between two looks at the files.
const EVERY_S: f64 = 0.4;

#[derive(Default)]
pub struct Watch {
    /// When each file was written, as far as it was looked at.
    files: BTreeMap<PathBuf, Option<SystemTime>>,
    looked_s: f64,
    number: u64,
}

fn written(path: &PathBuf) -> Option<SystemTime> {
    std::fs::metadata(path).and_then(|about| about.modified()).ok()
}

impl Watch {
    /// Changes whenever a file has changed.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Looks at the files of the kernels that run.
    pub fn follow(&mut self, shown: &Shown) {
        let folder = built_in_folder();
        for run in shown.plan.steps.iter().filter_map(|step| step.run()) {
            for source in run.kernel.assembled.sources() {
                let path = match source.name.strip_prefix("kernels/") {
                    Some(name) => folder.as_ref().map(|folder| folder.join(name)),
                    None => Some(PathBuf::from(&source.name)),
                };
                if let Some(path) = path.filter(|path| path.is_file()) {
                    self.files.entry(path.clone()).or_insert_with(|| written(&path));
                }
            }
        }
    }

    /// Whether a file was written since the last look.
    pub fn has_changed(&mut self, now_s: f64) -> bool {
        if now_s - self.looked_s < EVERY_S {
            return false;
        }
        self.looked_s = now_s;
        let mut changed = false;
        for (path, known) in &mut self.files {
            let now = written(path);
            if now != *known {
                *known = now;
                changed = true;
            }
        }
        if changed {
            Kernel::forget_built_in();
            self.number += 1;
        }
        changed
    }
}
