//! At what pace the stamps of a channel go: with the clock, faster as in a backlog, or forth and back.

use crate::live::Moment;
use crate::time::{Duration, Instant};

/// Stamps are looked at no more often: of what comes at once the first alone.
const SPACING: Duration = Duration::from_ns(200_000_000);
/// By how much a way may take longer than another, beyond `wait`.
const JITTER: Duration = Duration::from_ns(500_000_000);
/// For so long stamps go with the clock until that can be nothing else.
pub(super) const MINUTE: Duration = Duration::from_ns(60_000_000_000);

/// The stamps of a channel against the monotonic clock.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pace {
    /// Stamp less arrival, of the first look of the run and of the last.
    first: Duration,
    offset: Duration,
    /// When the run began, and the last look.
    since: Moment,
    last: Moment,
    /// Between the last two looks.
    step: Duration,
    /// How many looks the run has; 0 before the first.
    looks: u32,
}

impl Pace {
    /// Looks at a stamp that came now. A run goes on while stamps and clock stay as far apart as at its beginning, give or take `wait`.
    /// True where it looked.
    pub(super) fn look(&mut self, stamp: Instant, now: Moment, wait: Duration) -> bool {
        if self.looks > 0 && now - self.last < SPACING {
            return false;
        }
        let offset = offset(stamp, now);
        let off = offset - self.first;
        let slack = JITTER + wait;
        if self.looks > 0 && off <= slack && -off <= slack {
            self.looks = self.looks.saturating_add(1);
        } else {
            (self.first, self.since, self.looks) = (offset, now, 1);
        }
        self.step = now - self.last;
        (self.offset, self.last) = (offset, now);
        true
    }

    /// What time it is by these stamps.
    pub(super) fn time(&self, now: Moment) -> Instant {
        Instant::from_ns(now.as_ns()) + self.offset
    }

    /// Stamp less arrival.
    pub(super) fn offset(&self) -> Duration {
        self.offset
    }

    /// Whether so many stamps have gone with the clock, and the next one is not overdue.
    pub(super) fn goes(&self, stamps: u32, now: Moment) -> bool {
        let overdue = (self.step + self.step + JITTER + JITTER).min(MINUTE);
        self.looks >= stamps && now - self.last <= overdue
    }

    /// Whether they have for a minute.
    pub(super) fn lasts(&self, now: Moment) -> bool {
        self.goes(3, now) && self.last - self.since >= MINUTE
    }
}

/// Stamp less arrival. Their scales have nothing in common: only differences of it mean something.
pub(super) fn offset(stamp: Instant, now: Moment) -> Duration {
    Duration::from_ns(stamp.as_ns().saturating_sub(now.as_ns()))
}
