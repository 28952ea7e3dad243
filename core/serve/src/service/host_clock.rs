//! The host's clock, asked until it is known to be right, and then never again.

use std::time::{Duration as Wait, Instant as Clock};

use super::ServiceEvent;
use crate::connector::Stamps;
use crate::deployment::DeclaredSource;
use crate::moment::{Moment, MonotonicClock};
use crate::time::Instant;

/// How often it is asked until it is right.
const EVERY: Wait = Wait::from_secs(1);

/// Asks for the host's time where a source's stamps are compared with it.
#[derive(Debug)]
pub(super) struct HostClock {
    ask: fn() -> Option<Instant>,
    clock: MonotonicClock,
    asked: Clock,
    /// Whether no source's stamps say the time of day.
    is_idle: bool,
    is_known: bool,
}

impl HostClock {
    pub(super) fn new(
        ask: fn() -> Option<Instant>,
        clock: MonotonicClock,
        sources: &[DeclaredSource],
    ) -> Self {
        let is_of_use =
            |of: &DeclaredSource| of.clock.is_some() || of.parameters.stamps() == Stamps::Clock;
        Self {
            ask,
            clock,
            asked: Clock::now(),
            is_idle: !sources.iter().any(is_of_use),
            is_known: false,
        }
    }

    /// The host's time and when that was, once.
    pub(super) fn look(&mut self, at_once: bool) -> Option<(Instant, Moment)> {
        if self.is_idle || self.is_known || !at_once && self.asked.elapsed() < EVERY {
            return None;
        }
        self.asked = Clock::now();
        let time = (self.ask)()?;
        self.is_known = true;
        Some((time, self.clock.now()))
    }

    /// What is reported of it at the start.
    pub(super) fn first(&self) -> Option<ServiceEvent> {
        let is_synchronised = false;
        (!self.is_idle && !self.is_known).then_some(ServiceEvent::HostClock { is_synchronised })
    }
}
