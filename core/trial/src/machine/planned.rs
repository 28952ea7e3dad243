//! A schedule as a plan: its steps, each announced before it applies.

use super::schedule::Track;
use super::{Machine, MachineError, SECOND_NS, Setup, recording::unit_of};
use crate::compile::SourceChannel;
use crate::time::Duration;
use crate::unit::Unit;

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

/// A planned channel of a graph whose set points a machine announces: where they and their instants go, and the units of both sides.
pub(super) struct Announced {
    set_points: Announcements,
    to: [usize; 2],
    units: (Unit, Unit),
}

impl Announced {
    /// A source of a graph, of a number, in the unit of the graph; none where the machine has no such set point.
    pub(super) fn of(
        machine: &dyn Machine,
        setup: &Setup,
        (number, source): (usize, &SourceChannel),
        graph: &Unit,
    ) -> Result<Option<Self>, MachineError> {
        let Some(set_points) = Announcements::of(machine, setup, source) else {
            return Ok(None);
        };
        let from = unit_of("Cel")?;
        if !from.measures_same(graph) {
            return Err(MachineError::Unit {
                channel: source.name.clone(),
                machine: Box::new(from),
                graph: Box::new(graph.clone()),
            });
        }
        let applies_at = source.planned.map_or(number, |of| of.applies_at);
        Ok(Some(Self {
            set_points,
            to: [number, applies_at],
            units: (from, graph.clone()),
        }))
    }

    /// Puts what a row at an instant announces in its places, where it announces anything.
    pub(super) fn put(&mut self, now_ns: i64, values: &mut [f64]) {
        if let Some((set_point, from_s)) = self.set_points.next(now_ns) {
            let (machine, graph) = &self.units;
            let [value, applies_at] = self.to;
            values[value] = machine.convert(set_point, graph).unwrap_or(f64::NAN);
            values[applies_at] = from_s;
        }
    }
}
