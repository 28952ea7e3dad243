//! Feature nodes of athermal: slopes over trailing windows, delays, picks.

mod arithmetic;
mod delay;
mod first_order;
mod pick;
pub mod slope;

pub use arithmetic::{Product, Scale, Sum};
pub use delay::{Delay, Lateness};
pub use first_order::{FirstOrder, FirstOrderOutput, Grid, TimeConstants};
pub use pick::Pick;
pub use slope::Slope;
