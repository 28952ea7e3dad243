//! What can be wrong with a node type itself, whatever its graph contains; a graph can only do without the type.

use std::fmt::Display;

use crate::channel::Channel;
use crate::node::{InputPort, OutputPort, Regressors, Runs, TruthLags};
use crate::time::Duration;
use crate::unit::Unit;

/// A mistake in the code of a kind that shows when a graph with it is compiled.
#[derive(Debug, Clone, PartialEq)]
pub struct KindFault {
    /// What the kind does, as the end of a sentence that begins with its name.
    pub(super) found: String,
    /// What its author is to do.
    pub(super) remedy: &'static str,
}

impl KindFault {
    fn new(found: impl Into<String>, remedy: &'static str) -> Self {
        let found = found.into();
        Self { found, remedy }
    }

    /// It panics, with this message.
    pub(super) fn panics(message: &str) -> Self {
        Self::new(
            format!("panics while the graph is compiled: {message}"),
            "a node answers with a `Mistake` where it cannot go on, and never panics",
        )
    }

    /// What it reads is wanted from the future.
    fn lag(wants: impl Display, lag: Duration, remedy: &'static str) -> Option<Self> {
        let found = || format!("{wants} at the lag {lag}, which is in the future");
        lag.is_negative().then(|| Self::new(found(), remedy))
    }

    /// What is wrong with the input ports that a kind declares.
    pub(super) fn of_ports(ports: &[InputPort]) -> Vec<Self> {
        let wrong = |port: &InputPort| {
            let unit = port.unit?;
            let found = || {
                let port = port.name;
                format!("declares the input port `{port}` in `{unit}`, which is no unit")
            };
            let is_one = unit.parse::<Unit>().is_ok();
            (!is_one).then(|| Self::new(found(), "`InputPort::in_unit` takes a UCUM unit"))
        };
        ports.iter().filter_map(wrong).collect()
    }

    /// What is wrong with what an estimator wants.
    pub(super) fn of_regressors(wanted: &Regressors) -> Vec<Self> {
        let features = wanted.feature_lags.iter().filter_map(|&lag| {
            let remedy = "each of `Regressors::feature_lags` is 0 or more";
            Self::lag("wants its features", lag, remedy)
        });
        let truths = match &wanted.truth_lags {
            TruthLags::At(lags) => &lags[..],
            TruthLags::None | TruthLags::SmallestLegal => &[],
        };
        let truths = truths.iter().filter_map(|&lag| {
            let remedy = "each of `TruthLags::At` is 0 or more";
            Self::lag("wants past truths", lag, remedy)
        });
        let runs = match wanted.runs {
            Runs::BetweenTruths { every } => every.filter(|every| *every <= Duration::ZERO),
            Runs::OfTruths => None,
        };
        let runs = runs.map(|every| {
            Self::new(
                format!("wants to learn of truths every {every}"),
                "`Runs::BetweenTruths` has `every` above 0, or none",
            )
        });
        features.chain(truths).chain(runs).collect()
    }

    /// What is wrong with what a feature is fitted on.
    pub(super) fn of_encoder(lags: &[Duration]) -> Vec<Self> {
        let negative = lags.iter().filter_map(|&lag| {
            let remedy = "each of `Encoder::lags` is 0 or more";
            Self::lag("is fitted on inputs", lag, remedy)
        });
        let mut faults: Vec<_> = negative.collect();
        if !lags.contains(&Duration::ZERO) {
            faults.push(Self::new(
                "is fitted without the present values of its inputs",
                "0 is among `Encoder::lags`, since new values make the node run",
            ));
        }
        faults
    }

    /// What is wrong with what a feature gives.
    pub(super) fn of_outputs(outputs: &[OutputPort]) -> Vec<Self> {
        let channels = outputs.iter().flat_map(|port| &port.channels);
        let mut faults: Vec<Self> = channels.flat_map(Self::of_channel).collect();
        if outputs.is_empty() {
            let remedy = "`outputs` gives at least one port, or the mistakes";
            faults.push(Self::new("has no output port", remedy));
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
            Some(Self::new(
                format!("gives the channel `{}` with {of} {length}", channel.name),
                "the `span`, `ahead` and `max_age` of a `Channel` are 0 or more",
            ))
        })
    }

    /// What is wrong with how far a node looks back.
    pub(super) fn of_memory(memory: Duration) -> Option<Self> {
        let found = || format!("declares that its inputs reach back {memory}");
        memory
            .is_negative()
            .then(|| Self::new(found(), "`memory` is 0 or more"))
    }
}
