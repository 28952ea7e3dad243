//! The monotonic clock of the program.

use std::time::Instant as Clock;

pub use athermal_run::live::Moment;

/// The monotonic clock of the program.
#[derive(Debug, Clone, Copy)]
pub struct MonotonicClock(Clock);

impl MonotonicClock {
    /// One that starts now.
    #[must_use]
    pub fn start() -> Self {
        Self(Clock::now())
    }

    /// The moment now.
    #[must_use]
    pub fn now(&self) -> Moment {
        Moment::from_ns(i64::try_from(self.0.elapsed().as_nanos()).unwrap_or(i64::MAX))
    }
}
