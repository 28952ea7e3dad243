//! How old a tick is as a command: its source's lag behind the host, less the least lag that this source has shown.
//!
//! So a clock that is slow by hours is no backlog, and neither is a simulation; the first tick of a backlog is one. The least lag goes
//! into the journal, by which it is known after a restart. A source that goes with the clock for a minute shows what its lag is now.

use super::Timeline;
use super::judge::Judge;
use super::pace::offset;
use crate::live::Moment;
use crate::time::{Duration, Instant};

/// A lag is kept anew where it is shorter than the one that is kept by so much, and so long after that.
const STEP: Duration = Duration::from_ns(50_000_000);
const PAUSE: Duration = Duration::from_ns(1_000_000_000);

/// The lags of a source.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Age {
    /// The largest stamp less arrival: what the source shows where its lag is the least.
    most: Option<Duration>,
    /// Whether it has been shown since the start; otherwise it is what the journal says, by the host's time.
    is_shown: bool,
    kept: Option<Moment>,
}

impl Age {
    /// A stamp came. `lasting` is what its source shows by going with the clock for a minute.
    pub(super) fn look(&mut self, stamp: Instant, now: Moment, lasting: Option<Duration>) {
        let offset = offset(stamp, now);
        if self.most.is_none_or(|most| offset > most) {
            (self.most, self.is_shown) = (Some(offset), true);
        } else if let (Some(most), Some(lasting)) = (self.most, lasting)
            && most - lasting > PAUSE
        {
            (self.most, self.is_shown) = (Some(lasting), true);
        }
    }

    /// Whether a stamp that came now lags by more than it should.
    pub(super) fn lags(&self, stamp: Instant, now: Moment) -> bool {
        self.most
            .is_some_and(|most| most - offset(stamp, now) > PAUSE)
    }

    /// The host's time is known, or known better: what the journal says is meant by that.
    pub(super) fn set_host(&mut self, kept: Option<Duration>, host: Instant, now: Moment) {
        if let Some(least) = kept.filter(|_| !self.is_shown) {
            self.most = Some(offset(host, now) - least);
        }
    }

    /// The least lag by the host's time, as far as it has been shown.
    pub(super) fn least(&self, judge: &Judge, now: Moment) -> Option<Duration> {
        Some(offset(judge.host(now)?, now) - self.most.filter(|_| self.is_shown)?)
    }

    /// Whether the least lag is to be kept anew.
    pub(super) fn is_news(&mut self, kept: Option<Duration>, judge: &Judge, now: Moment) -> bool {
        if self.kept.is_some_and(|kept| now - kept < PAUSE) {
            return false;
        }
        let least = self.least(judge, now);
        let is_news = least.is_some_and(|least| {
            kept.is_none_or(|kept| kept - least > STEP || least - kept > PAUSE)
        });
        self.kept = is_news.then_some(now).or(self.kept);
        is_news
    }

    /// How old a tick is.
    pub(super) fn of(&self, at: Instant, now: Moment) -> Duration {
        let age = |most| most - offset(at, now);
        self.most.map_or(Duration::ZERO, age).max(Duration::ZERO)
    }

    /// Those of all sources of a timeline before the start.
    pub(super) fn all(timeline: &Timeline) -> Vec<Self> {
        vec![Self::default(); timeline.lags().len()]
    }
}
