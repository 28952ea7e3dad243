//! Monotonic time: what decides when something is done, and never what is computed.

use std::ops::{Add, Sub};

use crate::time::Duration;

/// A moment on the monotonic clock of the program, in nanoseconds since it started. Steps of the host's clock do not touch it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Moment(i64);

impl Moment {
    /// The first moment of the program.
    pub const START: Self = Self(0);

    /// The moment `ns` nanoseconds after the start.
    #[must_use]
    pub const fn from_ns(ns: i64) -> Self {
        Self(ns)
    }

    /// Nanoseconds since the start.
    #[must_use]
    pub const fn as_ns(self) -> i64 {
        self.0
    }
}

impl Add<Duration> for Moment {
    type Output = Self;

    fn add(self, after: Duration) -> Self {
        Self(self.0.saturating_add(after.as_ns()))
    }
}

impl Sub for Moment {
    type Output = Duration;

    fn sub(self, before: Self) -> Duration {
        Duration::from_ns(self.0.saturating_sub(before.0))
    }
}
