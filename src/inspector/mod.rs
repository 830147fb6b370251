//! The inspector: every buffer of a chain, seen, probed and compared.
//!
//! It draws values and owns no algorithm. A *wish* says what somebody wants to see (`wish`); a *worker* beside the window carries it out
//! with the same plans and executors as a run (`worker`, `subject`); what comes back is shown by *panes*, one file each. Kernels paint what
//! is seen (`gpu::paint`), so that nothing comes back to the host but what is read as text.

pub mod app;
mod ask;
pub mod desk;
mod document;
mod export;
mod panes;
pub mod probe;
pub mod screen;
mod shot;
mod subject;
pub mod view;
mod watch;
pub mod wish;
mod worker;

pub use app::{App, window};
pub use panes::experiments::shipped;
pub use screen::Screen;
pub use shot::Shot;
