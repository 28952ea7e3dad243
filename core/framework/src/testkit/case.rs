//! Decides what a node is tried with: its parameters, and what reaches its ports.

use super::Rule;
use crate::node::{InputPort, Kind, Read};
use crate::unit::Unit;

/// Parameters to try a kind with, and the channels that it is fed.
///
/// Every port that a graph may not leave out is fed, two channels of it in nm by default (three of `features`, in K, and of
/// `voters`; one of `truth`). Values wander between −100 and 100, or between 20 and 30 of a temperature; estimators get a
/// truth that hangs on their features, combiners get voters that follow the truth.
#[derive(Debug, Clone)]
pub struct Case {
    pub(super) parameters: String,
    inputs: Vec<Given>,
    pub(super) exceptions: Vec<(Rule, String)>,
    pub(super) without_input: Vec<String>,
}

/// What a port is fed.
#[derive(Debug, Clone)]
pub(super) struct Given {
    pub(super) port: String,
    pub(super) channels: usize,
    pub(super) unit: String,
    pub(super) range: Option<(f64, f64)>,
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

    /// The same, with output ports that have something to say before any input has come: a state, a reason, a refuge.
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
        all
    }
}

fn by_default(port: &InputPort) -> Given {
    let (channels, unit) = match (port.name, port.read) {
        (_, Read::Truth) => (1, "nm"),
        ("features", _) => (3, "K"),
        ("voters", _) => (3, "nm"),
        _ => (2, "nm"),
    };
    Given {
        port: port.name.to_owned(),
        channels,
        unit: port.unit.unwrap_or(unit).to_owned(),
        range: None,
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
