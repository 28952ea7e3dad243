//! Decides what can be wrong with a kind of node itself, whatever its graph says, and how its author is told; a graph can only do
//! without the kind.

use crate::channel::Channel;
use crate::node::{InputPort, OutputPort, Regressors, Runs, TruthLags};
use crate::time::Duration;

/// A mistake in the code of a kind that shows when a graph with it is compiled.
#[derive(Debug, Clone, PartialEq)]
pub enum KindFault {
    /// It panics.
    Panics {
        /// What it says.
        said: String,
    },
    /// Features are wanted from the future.
    FeatureLag {
        /// Where they stand.
        lag: Duration,
    },
    /// Past truths are wanted from the future.
    TruthLag {
        /// Where they stand.
        lag: Duration,
    },
    /// Inputs of a fitted feature are wanted from the future.
    EncoderLag {
        /// Where they stand.
        lag: Duration,
    },
    /// Present inputs of a fitted feature are not wanted.
    EncoderWithoutPresent,
    /// Truths are wanted in no time, or less.
    RunsEvery {
        /// How far apart.
        every: Duration,
    },
    /// It looks back into the future.
    Memory {
        /// How far.
        memory: Duration,
    },
    /// A channel that it gives has a length of time that is negative.
    Length {
        /// Which: `span`, `ahead` or `max_age`.
        of: &'static str,
        /// The channel.
        channel: String,
        /// How long it is.
        length: Duration,
    },
    /// Nothing comes out of it.
    NoOutput,
    /// An input port has a unit that is none.
    PortUnit {
        /// The port.
        port: &'static str,
        /// What stands for the unit.
        unit: &'static str,
    },
}

impl KindFault {
    /// What it does, as the end of a sentence that begins with its name.
    pub(super) fn found(&self) -> String {
        match self {
            Self::Panics { said } => format!("panics while the graph is compiled: {said}"),
            Self::FeatureLag { lag } => {
                format!("wants its features at the lag {lag}, which is in the future")
            }
            Self::TruthLag { lag } => {
                format!("wants past truths at the lag {lag}, which is in the future")
            }
            Self::EncoderLag { lag } => {
                format!("is fitted on inputs at the lag {lag}, which is in the future")
            }
            Self::EncoderWithoutPresent => {
                "is fitted without the present values of its inputs".to_owned()
            }
            Self::RunsEvery { every } => format!("wants to be told of truths every {every}"),
            Self::Memory { memory } => format!("says that its inputs reach back {memory}"),
            Self::Length {
                of,
                channel,
                length,
            } => format!("gives the channel `{channel}` with {of} {length}"),
            Self::NoOutput => "has no output port".to_owned(),
            Self::PortUnit { port, unit } => {
                format!("declares the input port `{port}` in `{unit}`, which is no unit")
            }
        }
    }

    /// What its author is to do.
    pub(super) fn remedy(&self) -> &'static str {
        match self {
            Self::Panics { .. } => {
                "a node answers with a `Mistake` where it cannot go on, and never panics"
            }
            Self::FeatureLag { .. } => "each of `Regressors::feature_lags` is 0 or more",
            Self::TruthLag { .. } => "each of `TruthLags::At` is 0 or more",
            Self::EncoderLag { .. } => "each of `Encoder::lags` is 0 or more",
            Self::EncoderWithoutPresent => {
                "0 is among `Encoder::lags`, since new values make the node run"
            }
            Self::RunsEvery { .. } => "`Runs::BetweenTruths` has `every` above 0, or none",
            Self::Memory { .. } => "`memory` is 0 or more",
            Self::Length { .. } => "the `span`, `ahead` and `max_age` of a `Channel` are 0 or more",
            Self::NoOutput => "`outputs` gives at least one port, or the mistakes",
            Self::PortUnit { .. } => "`InputPort::in_unit` takes a UCUM unit",
        }
    }

    /// What is wrong with the input ports that a kind declares.
    pub(super) fn of_ports(ports: &[InputPort]) -> Vec<Self> {
        let wrong = |port: &InputPort| {
            let unit = port.unit?;
            let is_one = unit.parse::<crate::unit::Unit>().is_ok();
            let port = port.name;
            (!is_one).then_some(Self::PortUnit { port, unit })
        };
        ports.iter().filter_map(wrong).collect()
    }

    /// What is wrong with what an estimator wants.
    pub(super) fn of_regressors(wanted: &Regressors) -> Vec<Self> {
        let features = wanted.feature_lags.iter();
        let features = features.map(|&lag| (lag, Self::FeatureLag { lag }));
        let truths = match &wanted.truth_lags {
            TruthLags::At(lags) => &lags[..],
            TruthLags::None | TruthLags::SmallestLegal => &[],
        };
        let truths = truths.iter().map(|&lag| (lag, Self::TruthLag { lag }));
        let lags = features.chain(truths);
        let negative = lags.filter(|(lag, _)| lag.is_negative());
        let runs = match wanted.runs {
            Runs::BetweenTruths { every } => every.filter(|every| *every <= Duration::ZERO),
            Runs::OfTruths => None,
        };
        let runs = runs.map(|every| Self::RunsEvery { every });
        negative.map(|(_, fault)| fault).chain(runs).collect()
    }

    /// What is wrong with what a feature is fitted on.
    pub(super) fn of_encoder(lags: &[Duration]) -> Vec<Self> {
        let negative = lags.iter().filter(|lag| lag.is_negative());
        let mut faults: Vec<_> = negative.map(|&lag| Self::EncoderLag { lag }).collect();
        if !lags.contains(&Duration::ZERO) {
            faults.push(Self::EncoderWithoutPresent);
        }
        faults
    }

    /// What is wrong with what a feature gives.
    pub(super) fn of_outputs(outputs: &[OutputPort]) -> Vec<Self> {
        let channels = outputs.iter().flat_map(|port| &port.channels);
        let mut faults: Vec<Self> = channels.flat_map(Self::of_channel).collect();
        if outputs.is_empty() {
            faults.push(Self::NoOutput);
        }
        faults
    }

    fn of_channel(channel: &Channel) -> impl Iterator<Item = Self> + '_ {
        let lengths = [
            ("span", Some(channel.span)),
            ("ahead", Some(channel.ahead)),
            ("max_age", channel.max_age),
        ];
        lengths.into_iter().filter_map(|(of, length)| {
            let length = length.filter(|length| length.is_negative())?;
            let channel = channel.name.clone();
            Some(Self::Length {
                of,
                channel,
                length,
            })
        })
    }

    /// What is wrong with how far a node says to look back.
    pub(super) fn of_memory(memory: Duration) -> Option<Self> {
        memory.is_negative().then_some(Self::Memory { memory })
    }
}
