//! Decides what a node is tried with: its parameters, and what reaches its ports.

use super::Rule;
use crate::node::{FREEZE, InputPort, Kind, Read};
use crate::time::Duration;
use crate::unit::Unit;

/// How many ticks a run has, unless a case needs more.
const TICKS: usize = 600;

/// How far apart they are on average, unless a case says otherwise.
pub(super) const EVERY: Duration = Duration::from_ns(10_000_000_000);

/// The shortest time between ticks: instants are rounded to a ten-thousandth of it.
const SHORTEST_NS: i64 = 10_000;

/// For how many ticks a value is held.
const HELD_TICKS: i64 = 6;

/// Parameters to try a kind with, and the channels that it is fed.
///
/// Every port that a graph may not leave out is fed, two channels of it in nm by default (three of `features`, in K, and of
/// `voters`; one of `truth`). Values wander between −100 and 100, or between 20 and 30 of a temperature; estimators get a
/// truth that hangs on their features, combiners get voters that follow the truth.
///
/// Beside the stated cases the kit tries some of its own: of a kind that can go on learning, each case that does not learn with
/// `learn = true` and, where all of them do, the first with `learn = false`; and where no case connects all the ports that a
/// graph may leave out, one in which they are.
#[derive(Debug, Clone)]
pub struct Case {
    pub(super) parameters: String,
    pub(super) inputs: Vec<Given>,
    pub(super) exceptions: Vec<(Rule, String)>,
    pub(super) without_input: Vec<String>,
    pub(super) ticks: usize,
    pub(super) every: Duration,
}

/// What a port is fed.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    pub(super) port: String,
    pub(super) channels: usize,
    pub(super) unit: String,
    pub(super) range: Option<(f64, f64)>,
    /// How long a value is held.
    pub(super) max_age: Duration,
}

impl Case {
    /// A case with these parameters, as they stand in the node's table of a graph file, without `type` and `inputs`.
    #[must_use]
    pub fn new(parameters: impl Into<String>) -> Self {
        Self {
            parameters: parameters.into(),
            inputs: Vec::new(),
            exceptions: Vec::new(),
            without_input: Vec::new(),
            ticks: TICKS,
            every: EVERY,
        }
    }

    /// The same, with so many channels in this unit at a port.
    #[must_use]
    pub fn input(mut self, port: &str, channels: usize, unit: &str) -> Self {
        self.inputs.retain(|given| given.port != port);
        self.inputs.push(Given {
            port: port.to_owned(),
            channels,
            unit: unit.to_owned(),
            range: None,
            max_age: self.held(),
        });
        self
    }

    /// The same, with values between these two at a port that [`Case::input`] has described.
    #[must_use]
    pub fn between(mut self, port: &str, low: f64, high: f64) -> Self {
        for given in self.inputs.iter_mut().filter(|given| given.port == port) {
            given.range = Some((low, high));
        }
        self
    }

    /// The same, run for so many ticks rather than 600: for a node that takes more of them to have anything to say. It is never run
    /// for fewer.
    #[must_use]
    pub fn ticks(mut self, ticks: usize) -> Self {
        self.ticks = ticks.max(TICKS);
        self
    }

    /// The same, with ticks about so far apart (`"1s"`) rather than 10 s, to which windows and horizons of the case should fit. Values
    /// are held for six of them, and wander as fast by the tick as they do at 10 s.
    ///
    /// # Panics
    /// Where that is no time from 10 µs to a day.
    #[must_use]
    pub fn every(mut self, every: &str) -> Self {
        let longest = Duration::from_ns(86_400_000_000_000);
        self.every = match every.parse::<Duration>() {
            Ok(every) if every >= Duration::from_ns(SHORTEST_NS) && every <= longest => every,
            _ => panic!("`{every}` is no time from 10 µs to a day, such as \"1s\""),
        };
        self
    }

    /// The same, with output ports that have something to say before any input has come: a state, a reason, a safe value.
    #[must_use]
    pub fn speaks_without_input(mut self, ports: &[&str]) -> Self {
        self.without_input = ports.iter().map(|&port| port.to_owned()).collect();
        self
    }

    /// The same, without one of the rules. The reason is for those who read the test.
    #[must_use]
    pub fn except(mut self, rule: Rule, reason: &str) -> Self {
        self.exceptions.push((rule, reason.to_owned()));
        self
    }

    /// How long values are held.
    pub(super) fn held(&self) -> Duration {
        Duration::from_ns(HELD_TICKS * self.every.as_ns())
    }

    pub(super) fn asks_for(&self, rule: Rule) -> bool {
        !self.exceptions.iter().any(|(except, _)| *except == rule)
    }

    /// What each port of a kind is fed.
    pub(super) fn given(&self, kind: &Kind) -> Vec<Given> {
        let stated = |port: &InputPort| self.inputs.iter().find(|given| given.port == port.name);
        let mut all: Vec<Given> = (kind.inputs)()
            .iter()
            .filter_map(|port| match stated(port) {
                Some(given) => Some(given.clone()),
                None => (!port.optional).then(|| by_default(port)),
            })
            .collect();
        // A port that the kind lacks is for the compiler to complain of.
        let known = |given: &&Given| !all.iter().any(|known| known.port == given.port);
        let unknown: Vec<_> = self.inputs.iter().filter(known).cloned().collect();
        all.extend(unknown);
        for given in &mut all {
            given.max_age = self.held();
        }
        all
    }
}

/// What a port is fed of which a case says nothing.
pub(super) fn by_default(port: &InputPort) -> Given {
    let (channels, unit, range) = match (port.name, port.read) {
        (_, Read::Truth) => (1, "nm", None),
        ("features", _) => (3, "K", None),
        ("voters", _) => (3, "nm", None),
        (FREEZE, _) => (1, "1", Some((0.0, 1.0))),
        _ => (2, "nm", None),
    };
    Given {
        port: port.name.to_owned(),
        channels,
        unit: port.unit.unwrap_or(unit).to_owned(),
        range,
        max_age: Duration::from_ns(HELD_TICKS * EVERY.as_ns()),
    }
}

impl Given {
    /// Between which values its channels wander.
    pub(super) fn range(&self) -> (f64, f64) {
        let point = || Unit::parse(&self.unit).is_ok_and(|unit| unit.is_temperature_point());
        self.range.unwrap_or_else(|| {
            if point() {
                (20.0, 30.0)
            } else {
                (-100.0, 100.0)
            }
        })
    }
}
