//! The panes beside the views, one file each.

pub mod camera;
pub mod chain;
pub mod experiments;
pub mod parameters;
pub mod probe;
pub mod results;
pub mod source;
