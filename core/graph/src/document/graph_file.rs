//! What a graph file declares, typed and expanded; whether it makes sense is decided by the compiler.

use std::fmt;

use indexmap::IndexMap;

use super::declare::TableBase;
use super::tree::Value;
use crate::diagnostic::Place;
use crate::quantity::Quantity;
use crate::time::{Duration, TimeColumns, TimeFormat, Zone};
use crate::unit::Unit;

/// A whole graph file after merging, with every `each` expanded.
#[derive(Debug, Clone)]
pub struct GraphFile {
    /// The graph's name.
    pub name: Option<String>,
    /// What the graph is for.
    pub description: Option<String>,
    /// The members of each set.
    pub sets: IndexMap<String, Vec<String>>,
    /// How tabular sources give time.
    pub time: TimeBase,
    /// How tabular sources lay out their text.
    pub table: TableBase,
    /// What is measured, in the order of the file.
    pub signals: Vec<SignalDecl>,
    /// The nodes, in the order of the file.
    pub nodes: Vec<NodeDecl>,
    /// Names that stand for nothing because of reported mistakes, so that references to them are no further mistakes.
    pub broken: Vec<String>,
    /// Inherited nodes that were removed.
    pub removed: Vec<String>,
    /// What comes out, in the order of the file.
    pub outputs: Vec<OutputDecl>,
    /// The list under `[[tests]]`, as it stands.
    pub tests: Option<Value>,
    /// The sections of a machine file, such as `sources`, `sinks`, `runtime` and `model`, as they stand.
    pub deployment: IndexMap<String, Value>,
    /// The merged tree before expansion; what a model stores.
    pub tree: Value,
}

/// How tabular sources give time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TimeBase {
    /// One column holds the time of each row, or several together.
    Column {
        /// Which.
        column: TimeColumns,
        /// How their text is read.
        form: TimeForm,
        /// Where dates and times are those of a clock on the wall; without it they are UTC, save those that have an offset.
        zone: Option<Zone>,
    },
}

/// How the time of a row is read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TimeForm {
    /// A number; `unit` is the length of one.
    Numbers {
        /// Length of 1.
        unit: Duration,
    },
    /// A date and time as RFC 3339 writes it.
    Rfc3339,
    /// A date and time in another form.
    Format(TimeFormat),
    /// Hours, minutes and seconds since a beginning, beyond a day: `29:59:00`, `1.05:59:00`, `1 day, 5:59:00`.
    Elapsed,
    /// A number that counts from another origin than 1970, as Julian days do.
    Since {
        /// Length of 1.
        unit: Duration,
        /// How far before 1970 the origin lies, in ns.
        origin_ns: i128,
    },
    /// A sample number.
    Samples {
        /// Time from one sample to the next; without it, one sample is carried as one second.
        step: Option<Duration>,
    },
}

impl fmt::Display for TimeBase {
    /// "the column `time_s` in steps of 1s", to stand in a sentence.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let TimeBase::Column { column, form, .. } = self;
        write!(f, "the column `{column}` ")?;
        match form {
            TimeForm::Numbers { unit } | TimeForm::Since { unit, .. } => {
                write!(f, "in steps of {unit}")
            }
            TimeForm::Elapsed => f.write_str("of hours, minutes and seconds"),
            TimeForm::Rfc3339 | TimeForm::Format(_) => f.write_str("of dates and times"),
            TimeForm::Samples { step: None } => f.write_str("of sample numbers"),
            TimeForm::Samples { step: Some(step) } => write!(f, "of samples {step} apart"),
        }
    }
}

impl TimeBase {
    /// The length of one sample as it is carried inside, if samples are what counts: the step, or 1 s without one.
    pub fn sample(&self) -> Option<Duration> {
        let TimeBase::Column { form, .. } = self;
        match form {
            TimeForm::Samples { step } => Some(step.unwrap_or(Duration::from_ns(1_000_000_000))),
            TimeForm::Numbers { .. }
            | TimeForm::Rfc3339
            | TimeForm::Format(_)
            | TimeForm::Elapsed
            | TimeForm::Since { .. } => None,
        }
    }
}

/// A group of measured channels.
#[derive(Debug, Clone)]
pub struct SignalDecl {
    /// The signal's name.
    pub name: String,
    /// Where it is declared.
    pub place: Place,
    /// The unit of its samples.
    pub unit: Unit,
    /// Where the unit stands.
    pub unit_place: Place,
    /// Its channels, each with where it is named.
    pub channels: Vec<(String, Place)>,
    /// The name of each channel's column, with `{channel}` for the channel.
    pub column: String,
    /// Lowest and highest value, in the signal's unit; beyond them a sample is absent.
    pub range: Option<(f64, f64)>,
    /// How long a held sample counts.
    pub max_age: Option<Duration>,
    /// The channels that the data may lack.
    pub optional: Vec<String>,
    /// Of what is planned: how long before it applies it is known.
    pub known_ahead: Option<Duration>,
    /// The name of the column that says from when a planned value applies, with `{channel}` for the channel.
    pub applies_at: String,
}

/// A node and its instances.
#[derive(Debug, Clone)]
pub struct NodeDecl {
    /// The node's name; inside a module, after the names of the instances that it is part of: `axis/thermal`.
    pub name: String,
    /// Where it is declared.
    pub place: Place,
    /// Its `type`, and where that stands; none where a mistake in it has been reported.
    pub kind: Option<(String, Place)>,
    /// The sets of its `each`, in order.
    pub each: Vec<String>,
    /// One per member, or one without `each`.
    pub instances: Vec<InstanceDecl>,
    /// Whether it has mistakes, which have been reported.
    pub faulty: bool,
    /// Whether its parameters cannot be read, since their members or samples are not known.
    pub open: bool,
}

/// One instance of a node.
#[derive(Debug, Clone)]
pub struct InstanceDecl {
    /// The member of the node's sets: `Z1`, or `1-X` over two sets; none without `each`.
    pub member: Option<String>,
    /// Inside of modules with `each`: how the nodes beside it name it, as `axis[Z1]/thermal`, and the member that is left.
    pub scopes: Vec<(String, Option<String>)>,
    /// The inputs, in the order of the file.
    pub inputs: Vec<InputDecl>,
    /// The node's table without `type`, `each` and `inputs`; members substituted, samples turned into durations.
    pub parameters: Value,
}

/// What an input port reads.
#[derive(Debug, Clone)]
pub struct InputDecl {
    /// The port's name.
    pub port: String,
    /// Where it is named.
    pub place: Place,
    /// The references, each with where it stands.
    pub references: Vec<(String, Place)>,
    /// How old a held value may be, and where that stands.
    pub max_age: Option<(Duration, Place)>,
}

/// A named output.
#[derive(Debug, Clone)]
pub struct OutputDecl {
    /// The output's name.
    pub name: String,
    /// Where it is named.
    pub place: Place,
    /// The references, each with where it stands.
    pub from: Vec<(String, Place)>,
    /// The rate at which the output passes from an old graph to a new one, and where it stands.
    pub blend: Option<(Quantity, Place)>,
}
