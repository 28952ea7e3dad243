//! Structural time series: a level that wanders, a trend, regressors, and the Kalman filter that follows them.
//!
//! Decides how states and their uncertainty follow from observations, and which variances make them most likely; does not
//! decide what is observed, nor when.

mod filter;
mod likelihood;
mod matrix;
mod model;
mod resetting;
mod simplex;
#[cfg(test)]
mod tests;

pub use filter::{Forecast, Innovation, Kalman};
pub use likelihood::{Followed, Series, follow, most_likely};
pub use model::{Movement, Passage, Structural};
pub use resetting::Resetting;
