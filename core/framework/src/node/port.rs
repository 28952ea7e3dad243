//! Decides how a node declares its ports and says what is wrong with its inputs; not which channels reach them.

use super::{FeatureFit, Hindsight};
use crate::channel::Channel;
use crate::diagnostic::counted;

/// How an input port reads its channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Read {
    /// Only values that are new at this tick.
    Fresh,
    /// The last value, while it is not older than its maximum age.
    Held,
    /// The measured value of what is predicted; the framework pairs it with predictions, the node never reads it as data.
    Truth,
}

/// An output port of a kind, known before there is a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PortSummary {
    /// The name after a colon in a reference: `stderr` of `drift:stderr`.
    pub name: &'static str,
    /// One line for people: what it gives.
    pub summary: &'static str,
}

impl PortSummary {
    /// A port of this name.
    #[must_use]
    pub const fn new(name: &'static str, summary: &'static str) -> Self {
        Self { name, summary }
    }
}

/// The name of the port by which channels freeze the learning of an estimator; the framework reads it, not the node.
pub const FREEZE: &str = "freeze";

/// An input port as the kind declares it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InputPort {
    /// The name under `inputs.` in a graph file.
    pub name: &'static str,
    /// How it is read.
    pub read: Read,
    /// Whether a graph may leave it out.
    pub optional: bool,
    /// The unit in which its channels are given; none where it takes any. Channels of another are converted by a factor.
    pub unit: Option<&'static str>,
    /// One line for people.
    pub summary: &'static str,
}

impl InputPort {
    const fn new(name: &'static str, read: Read, summary: &'static str) -> Self {
        Self {
            name,
            read,
            optional: false,
            unit: None,
            summary,
        }
    }

    /// A port that takes only new values.
    #[must_use]
    pub const fn fresh(name: &'static str, summary: &'static str) -> Self {
        Self::new(name, Read::Fresh, summary)
    }

    /// A port that takes the last value up to its maximum age.
    #[must_use]
    pub const fn held(name: &'static str, summary: &'static str) -> Self {
        Self::new(name, Read::Held, summary)
    }

    /// The port of the truth.
    #[must_use]
    pub const fn truth(summary: &'static str) -> Self {
        Self::new("truth", Read::Truth, summary)
    }

    /// The port that freezes the learning of an estimator: see [`FREEZE`].
    #[must_use]
    pub const fn freeze() -> Self {
        let summary =
            "learning goes on only while all of these are 0, such as the reason of a `health` node";
        Self::new(FREEZE, Read::Held, summary).or_none()
    }

    /// The same port, its channels given in a unit (UCUM): `mK/min`.
    #[must_use]
    pub const fn in_unit(mut self, unit: &'static str) -> Self {
        self.unit = Some(unit);
        self
    }

    /// The same port, which a graph may leave out.
    #[must_use]
    pub const fn or_none(mut self) -> Self {
        self.optional = true;
        self
    }
}

/// An output port: a named, ordered bundle of channels. A node's first port is its default.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputPort {
    /// The name after the `:` of a reference.
    pub name: &'static str,
    /// Its channels, in order.
    pub channels: Vec<Channel>,
}

/// The channels that reach a node, port by port, as known when the graph is compiled.
#[derive(Debug, Clone, Default)]
pub struct Inputs {
    /// The node's declared ports and the channels of each, in declared order; empty for an optional port left out.
    pub ports: Vec<(InputPort, Vec<Channel>)>,
    /// The member of `each` that this instance stands for.
    pub member: Option<String>,
    /// Of what is known later, for a feature that [looks back](super::Encoder::looks_back).
    pub hindsight: Option<Hindsight>,
    pub(crate) fit: Option<FeatureFit>,
    /// What the graph calls the channels of each port; nothing once it is compiled.
    pub(crate) names: Vec<Vec<String>>,
}

impl Inputs {
    /// What the graph calls a channel of a port while it is compiled, such as `drift.Z1`: channels of two nodes may have one name.
    #[must_use]
    pub fn reference(&self, port: &str, nth: usize) -> &str {
        let place = self.ports.iter().position(|(own, _)| own.name == port);
        let name = place.and_then(|place| self.names.get(place)?.get(nth));
        let own = || self.port(port).get(nth).map_or("", |own| &own.name);
        name.map_or_else(own, String::as_str)
    }

    /// The channels of a port; none where the port has been left out, or the kind declares no such port.
    ///
    /// # Panics
    /// In a debug build, where the kind declares no such port.
    #[must_use]
    pub fn port(&self, name: &str) -> &[Channel] {
        let found = self.ports.iter().find(|(port, _)| port.name == name);
        debug_assert!(
            found.is_some(),
            "it asks for the input port `{name}`, and declares {:?}",
            self.ports
                .iter()
                .map(|(port, _)| port.name)
                .collect::<Vec<_>>()
        );
        found.map_or(&[], |(_, channels)| channels)
    }
}

/// What a kind finds wrong with its parameters or inputs when a graph is compiled, or with what was fitted when a model is read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mistake {
    /// The parameter (`windows`, `selection.folds`, `lags.1` for the second of a list) or input port (`inputs.signal`) at fault.
    pub at: String,
    /// What was found and what is allowed.
    pub message: String,
    /// What to write instead.
    pub help: Option<String>,
}

impl Mistake {
    /// A mistake at a parameter or `inputs.PORT`.
    #[must_use]
    pub fn at(at: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            at: at.into(),
            message: message.into(),
            help: None,
        }
    }

    /// A mistake at each of these lists that has more or fewer values than it must have.
    #[must_use]
    pub fn of_lengths(needed: usize, lists: &[(&str, usize)]) -> Vec<Self> {
        let wrong = lists.iter().filter(|(_, found)| *found != needed);
        wrong
            .map(|(at, found)| {
                let found = counted(*found, "value");
                Self::at(*at, format!("`{at}` has {found} and must have {needed}"))
            })
            .collect()
    }

    /// Adds the way out.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}
