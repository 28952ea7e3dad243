//! Feature nodes of athermal: slopes and statistics over trailing windows, filters, lags and delays, sums and products.

mod arithmetic;
mod delay;
mod difference;
mod first_order;
mod hampel;
mod lag;
mod minimum_difference;
mod moving;
mod past;
mod pick;
mod resample;
mod rounding;
mod sample_at;
pub mod slope;
mod sorted;
mod summary;
mod windows;

pub use arithmetic::{Product, Scale, Sum};
pub use delay::{Delay, Lateness};
pub use difference::Difference;
pub use first_order::{FirstOrder, FirstOrderOutput, Grid, TimeConstants};
pub use hampel::{Hampel, Replacement};
pub use lag::Lag;
pub use minimum_difference::MinimumDifference;
pub use moving::Moving;
pub use pick::Pick;
pub use resample::{Resample, ResampleMethod};
pub use sample_at::SampleAt;
pub use slope::Slope;
