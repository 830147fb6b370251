//! What a buffer looks like: the numbers in it, colours, ranges, and the ways in which somebody can see it. Pure values; `gpu::paint` draws them.

pub mod channel;
pub mod colours;
pub mod form;
pub mod projection;
pub mod scale;

pub use channel::Channel;
pub use colours::Colours;
pub use form::Form;
pub use projection::Projection;
pub use scale::{Range, Scale};
