//! Feature nodes of athermal: slopes over trailing windows, delays, picks.

mod delay;
mod pick;
pub mod slope;

pub use delay::{Delay, Lateness};
pub use pick::Pick;
pub use slope::Slope;
