//! What several stages have in common: layouts, cameras, traversal, prefix sums, and what rounding can do.

pub mod border;
pub mod drawn;
pub mod first_hit;
pub mod prefix_sums;
pub mod projector;
pub mod pyramid;
pub mod rounding;
pub mod traversal;
