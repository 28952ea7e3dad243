//! A schedule as a plan: its steps, each announced before it applies.

use super::schedule::Track;
use super::{Machine, SECOND_NS, Setup};
use crate::compile::SourceChannel;
use crate::time::Duration;

/// The signal of a graph whose channels are the set points of a machine, as `set_point.chuck`.
const SET_POINTS: &str = "set_point";

/// Whether a machine gives a planned channel of a graph, or the instants from which on its values apply.
pub fn plans(machine: &dyn Machine, source: &SourceChannel) -> bool {
    let signal = source.name.strip_prefix(SET_POINTS);
    let name = signal.and_then(|rest| match source.is_instant {
        true => rest.strip_prefix(":applies_at."),
        false => rest.strip_prefix('.').filter(|_| source.planned.is_some()),
    });
    let mut set_points = machine.set_points().iter();
    name.is_some_and(|name| set_points.any(|of| of.name == name))
}

/// The set points of one name, in the order in which they are announced: each row of a recording may announce one.
#[derive(Debug, Clone)]
pub struct Announcements {
    track: Track,
    ahead_ns: i64,
    /// The instant of the last step that was announced; none before the first.
    announced_ns: Option<i64>,
}

impl Announcements {
    /// Those of a planned channel of a graph, each as long before it applies as that is known ahead; none where a machine that is set up
    /// so has no such set point.
    pub fn of(machine: &dyn Machine, setup: &Setup, source: &SourceChannel) -> Option<Self> {
        let name = source.name.strip_prefix(SET_POINTS)?.strip_prefix('.')?;
        Self::ahead(machine, setup, name, source.planned?.known_ahead)
    }

    /// Those of a set point, each so long before it applies; none where the machine has no set point of that name.
    pub fn ahead(
        machine: &dyn Machine,
        setup: &Setup,
        name: &str,
        ahead: Duration,
    ) -> Option<Self> {
        let set_point = machine.set_points().iter().find(|of| of.name == name)?;
        let own = machine.schedule(setup.seed);
        let schedule = setup.schedule.as_ref().or(own.as_ref());
        let constant = || Track::constant(set_point.default);
        Some(Self {
            track: schedule.map_or_else(constant, |schedule| schedule.track(set_point)),
            ahead_ns: ahead.as_ns(),
            announced_ns: None,
        })
    }

    /// What a row at an instant announces: a set point, and the second from which on it applies. The first row announces what applies.
    pub fn next(&mut self, now_ns: i64) -> Option<(f64, f64)> {
        let (at_ns, value) = match self.announced_ns {
            None => (now_ns, self.track.at(now_ns)),
            Some(announced_ns) => self.track.after(announced_ns)?,
        };
        let is_known = at_ns <= now_ns.saturating_add(self.ahead_ns);
        is_known.then(|| {
            self.announced_ns = Some(at_ns);
            (value, at_ns as f64 / SECOND_NS as f64)
        })
    }
}
