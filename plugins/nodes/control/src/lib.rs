//! Control nodes of athermal: from a predicted drift to a correction that may be trusted, and what it is worth.

mod compensate;
mod cross_check;
mod health;
mod limit;
pub mod optical_loss;
mod remeasure;
mod safe_state;
mod settled;
mod stability;
mod uncorrected;

pub use compensate::{Compensate, Stop};
pub use cross_check::CrossCheck;
pub use health::Health;
pub use optical_loss::OpticalLoss;
pub use remeasure::Remeasure;
pub use safe_state::{SafeState, WhenLost};
pub use settled::Settled;
pub use stability::{Stability, StabilityState};
pub use uncorrected::{Uncorrected, UntilFirst};
