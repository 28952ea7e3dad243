//! Decides how a limit given as a quantity becomes a number in a channel's unit; not what is done at the limit.

use athermal_core::channel::Channel;
use athermal_core::node::{Mistake, OutputPort};
use athermal_core::quantity::Quantity;
use athermal_core::time::Duration;
use athermal_core::unit::Unit;

/// A limit of a size, in `unit`. Of temperatures it is a difference.
pub(crate) fn size(limit: &Quantity, unit: &Unit, at: &str) -> Result<f64, Mistake> {
    limit.as_difference(unit).ok_or_else(|| {
        let message = format!("`{at}` is in {}, which cannot be in {unit}", limit.unit);
        Mistake::at(at, message).help(format!("give it in {unit}"))
    })
}

/// The same for a limit that may be left out.
pub(crate) fn size_or_none(
    limit: Option<&Quantity>,
    unit: &Unit,
    at: &str,
    mistakes: &mut Vec<Mistake>,
) -> Option<f64> {
    match size(limit?, unit, at) {
        Ok(value) => Some(value),
        Err(mistake) => {
            mistakes.push(mistake);
            None
        }
    }
}

/// The longest pause that is bridged, where nothing else is said.
pub(crate) fn minute() -> Duration {
    Duration::from_ns(60_000_000_000)
}

/// The unit of a change per second of values in `unit`.
pub(crate) fn per_second(unit: &Unit) -> Unit {
    unit.difference().per(&Unit::second())
}

/// A value that a state holds in one unit, in another; a state of an older form does not say in which.
pub(crate) fn brought(value: f64, from: Option<&Unit>, to: Option<&Unit>) -> Option<f64> {
    match (from, to) {
        (Some(from), Some(to)) if from != to => from.convert(value, to),
        _ => Some(value),
    }
}

/// Channels that are passed on, and a number for each that says why not.
pub(crate) fn with_reasons(signal: &[Channel]) -> Vec<OutputPort> {
    vec![
        OutputPort {
            name: "signal",
            channels: signal.to_vec(),
        },
        OutputPort {
            name: "reason",
            channels: signal.iter().map(numbered).collect(),
        },
    ]
}

/// A channel of numbered states or reasons beside another channel.
pub(crate) fn numbered(of: &Channel) -> Channel {
    Channel {
        name: of.name.clone(),
        unit: Unit::one(),
        span: of.span,
        ahead: Duration::ZERO,
        max_age: of.max_age,
    }
}

/// Whether two ports have channels one for one.
pub(crate) fn same_count(
    port: &str,
    found: &[Channel],
    other: &str,
    expected: &[Channel],
) -> Option<Mistake> {
    (found.len() != expected.len()).then(|| {
        let message = format!(
            "`{port}` has {} channels and `{other}` has {}",
            found.len(),
            expected.len()
        );
        Mistake::at(format!("inputs.{port}"), message)
            .help("both go together one by one, in the same order")
    })
}
