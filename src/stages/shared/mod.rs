//! What several stages have in common: layouts, cameras, traversal, prefix sums, and what rounding can do.

pub mod border;
pub mod drawn;
pub mod first_hit;
pub mod heights;
pub mod octaves;
pub mod prefix_sums;
pub mod projected;
pub mod rounding;
pub mod sketch;
pub mod traversal;
