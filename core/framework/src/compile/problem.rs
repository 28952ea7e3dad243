//! Decides what can be wrong with a graph that reads well.

mod told;

use std::sync::Arc;

use super::kind_fault::KindFault;
use crate::diagnostic::Names;
use crate::node::{Kind, Written};
use crate::quantity::Quantity;
use crate::time::Duration;
use crate::unit::Unit;

/// A mistake in what a graph means.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)] // each variant's fields are the data of the sentence that `message` makes of them
pub enum CompileProblem {
    /// A `type` that no linked crate brings.
    UnknownKind {
        kind: String,
        known: Vec<&'static str>,
    },
    /// Two crates bring the same kind.
    KindTwice {
        kind: String,
        packages: Vec<&'static str>,
    },
    /// Something that the kind's crate writes has a name that is taken twice.
    WrittenTwice {
        kind: String,
        of: Written,
        name: &'static str,
        packages: Vec<&'static str>,
    },
    /// A reference to a node or signal that is not there.
    UnknownNode { node: String, known: Arc<Names> },
    /// A reference to an inherited node that the file removes.
    RemovedNode { node: String },
    /// A reference to a port that the node does not have.
    UnknownPort {
        node: String,
        port: String,
        known: Vec<&'static str>,
    },
    /// A reference that ends, or goes on with a channel, where its port should stand.
    EmptyPort {
        node: String,
        channel: Option<String>,
        known: Vec<&'static str>,
    },
    /// A reference that matches no channel.
    UnknownChannel {
        node: String,
        channel: String,
        known: Arc<Names>,
    },
    /// An input that the kind does not have.
    UnknownInput {
        kind: &'static str,
        input: String,
        meant: Option<&'static str>,
        known: Vec<&'static str>,
    },
    /// An input that the kind needs and the node does not give.
    MissingInput {
        kind: &'static str,
        input: &'static str,
        summary: &'static str,
    },
    /// An input with another number of channels than it takes.
    ChannelCount {
        input: &'static str,
        found: Vec<String>,
        expected: &'static str,
    },
    /// Two things that must have the same unit.
    Units {
        first: String,
        first_unit: Unit,
        second: String,
        second_unit: Unit,
    },
    /// A point on a temperature scale where a difference is wanted, or the other way round.
    PointOrDifference {
        channel: String,
        unit: Unit,
        wanted_by: String,
        wanted: Unit,
    },
    /// Limits of a fit that admit no row.
    NoRows { below: Quantity, above: Quantity },
    /// Two things that must summarise the same length of time.
    Spans {
        first: String,
        first_span: Duration,
        second: String,
        second_span: Duration,
    },
    /// Two predictions that must have the same horizon.
    Horizons {
        first: String,
        first_ahead: Duration,
        second: String,
        second_ahead: Duration,
    },
    /// Two predictions that must be of the same truth, or one and the truth that it is judged by.
    Truths {
        first: String,
        first_truth: String,
        second: String,
        second_truth: String,
    },
    /// A vote that is not what its node predicts.
    NoPrediction { channel: String, prediction: String },
    /// A regressor or a vote that counts twice.
    Repeated {
        channel: String,
        input: &'static str,
    },
    /// A loop without a delay.
    Cycle { path: Vec<String> },
    /// A regressor that contains part of the answer.
    Leak {
        regressor: String,
        lag: Duration,
        truth: String,
        span: Duration,
        /// How far the truth itself is behind what was measured.
        late: Duration,
        ahead: Duration,
        /// The channels from the regressor back to what was measured; none where the truth itself is lagged.
        path: Vec<String>,
    },
    /// A held input whose age nothing bounds; with the signal that could say how long its samples count.
    NoMaxAge {
        channel: String,
        input: String,
        signal: Option<String>,
    },
    /// A mistake that the kind found.
    Parameter {
        message: String,
        help: Option<String>,
    },
    /// Something that the kind can use and doubts to be meant.
    Doubt {
        message: String,
        help: Option<String>,
    },
    /// An estimator that is told to learn while it runs and cannot.
    NeverLearns {
        kind: &'static str,
        help: Option<&'static str>,
    },
    /// A mistake in the code of a kind.
    Kind {
        kind: &'static str,
        author: String,
        fault: KindFault,
    },
    /// An estimator without a horizon.
    NoHorizon { kind: &'static str },
    /// A truth that is a prediction.
    PredictedTruth { channel: String },
    /// A truth that tells of a prediction, as its standard deviation does.
    TruthOfPrediction { channel: String, prediction: String },
    /// A truth made of values that depend on all of the past.
    EndlessTruth { channel: String, node: String },
    /// A limit of a unit that is not the truth's.
    LimitUnit { found: Unit, expected: Unit },
    /// A rate at which no output passes from one graph to the next.
    Blend {
        output: String,
        found: Quantity,
        expected: Unit,
    },
    /// Two channels of the same name.
    DuplicateName { name: String, what: &'static str },
    /// Columns of the same names as others of the output, because of one reference; with an output that it could be alone.
    DuplicateColumns {
        first: String,
        more: usize,
        alone: Option<String>,
    },
    /// A node whose outputs nobody uses; of a file that the graph extends, or of its own.
    UnusedNode { node: String, inherited: bool },
    /// A signal that nobody uses.
    UnusedSignal { signal: String },
    /// Columns that are named for another unit than their signal's.
    ColumnUnit {
        signal: String,
        column: String,
        named: Unit,
        unit: Unit,
    },
    /// An output behind which there is no signal.
    Unreachable { output: String },
    /// A graph without outputs.
    NoOutputs,
}

impl CompileProblem {
    /// A mistake in the code of a kind.
    pub(super) fn of_kind(kind: &Kind, fault: KindFault) -> Self {
        Self::Kind {
            kind: kind.name,
            author: kind.author(),
            fault,
        }
    }
}
