//! Records and what is made of them: data for other programs, tables that answer which method wins, plots, a page.

pub mod compare;
pub mod data;
pub mod equal;
mod export;
pub mod folders;
pub mod page;
pub mod pictures;
pub mod plot;
pub mod records;
pub mod standing;
pub mod store;
pub mod table;
mod write;

pub use records::{Identity, Record, Results};
pub use store::Store;
pub use write::{Put, Wanted, write};
