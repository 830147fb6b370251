//! The GPU: adapters, and the one place that dispatches.

mod bind;
mod cache;
pub mod device;
mod encode;
mod execute;
pub mod held;
pub mod limits;
mod memory;
pub mod paint;
mod parameters;
mod readback;
mod stamps;
pub mod statistics;
pub mod submit;
mod timing;
mod tool;
mod turns;
mod watch;

use thiserror::Error;

use crate::experiment::diagnostic::Diagnostic;

pub use device::{AdapterSummary, Gpu};
pub use execute::Executor;
pub use held::Held;
pub use submit::StepTime;
pub use watch::Waiting;

#[derive(Clone, Debug, Error)]
pub enum GpuError {
    #[error("no Vulkan, Metal or D3D12 adapter was found")]
    NoAdapter,
    #[error("no adapter is called `{wanted}`; there are: {}", known.join(", "))]
    UnknownAdapter { wanted: String, known: Vec<String> },
    #[error("the adapter {adapter} cannot be opened: {why}")]
    Open { adapter: String, why: String },
    /// (In full: a megabyte is more than what is too much.)
    #[error("buffer `{buffer}` needs {needed} bytes, {adapter} binds {limit} at most")]
    BufferTooLarge { buffer: String, needed: u64, adapter: String, limit: u64 },
    #[error("{what} needs {needed}, {adapter} has {limit}")]
    Limit { what: String, needed: u64, adapter: String, limit: u64 },
    #[error("out of memory while making {0}")]
    OutOfMemory(String),
    #[error("{what} was refused: {why}")]
    Refused { what: String, why: String },
    #[error("the device was lost: {0}")]
    Lost(String),
    #[error("a plan that cannot be carried out: {0}; this is a mistake in lodlab")]
    Plan(String),
}

impl GpuError {
    fn help(&self) -> Option<&'static str> {
        match self {
            GpuError::NoAdapter => {
                Some("install a driver; Debian's software adapter is `apt-get install mesa-vulkan-drivers libvulkan1`")
            }
            GpuError::UnknownAdapter { .. } => Some("`lodlab devices` lists them; a part of the name is enough"),
            GpuError::BufferTooLarge { .. } => {
                Some("crop or resample the terrain, or choose a smaller viewport or grid")
            }
            GpuError::OutOfMemory(_) => Some("crop or resample the terrain, or choose a smaller viewport or grid"),
            GpuError::Limit { .. } => Some("make it smaller, or choose another adapter with --adapter"),
            _ => None,
        }
    }
}

impl From<GpuError> for Diagnostic {
    fn from(error: GpuError) -> Self {
        let made = match error {
            GpuError::UnknownAdapter { .. } => Diagnostic::input(error.to_string()),
            _ => Diagnostic::run(error.to_string()),
        };
        Diagnostic { help: error.help().map(str::to_string), ..made }
    }
}
