//! Records and what is made of them: table, CSV, JSON, plots, a page.

pub mod html;
pub mod pareto;
pub mod pictures;
pub mod records;
pub mod table;

pub use records::{Identity, Record, Store};
