//! Mistakes in signals: their columns, ranges and channels.

use std::sync::Arc;

use super::nearest_of_many;
use crate::diagnostic::{Names, problem};
use crate::unit::Unit;

problem! {
    /// Several channels would be read from one column.
    A021 OneColumn { pattern: String, channels: usize }
    error: "column pattern",
    explanation: "The columns of a signal with several channels must differ: the pattern contains `{channel}`.",
    message: format!("{channels} channels would all be read from the column \"{pattern}\""),
    label: "",
    help: "put `{channel}` into the pattern",
}

problem! {
    /// A range whose ends do not measure what the signal measures.
    A022 RangeUnit {
        /// The unit of the end.
        found: String,
        /// The unit of the signal.
        unit: Unit,
    }
    error: "bad range",
    explanation: "A range is `[low, high]`, both in units that convert to the signal's, the low one below the high one.",
    message: format!("the range is in \"{found}\", which does not convert to the signal's unit \"{unit}\""),
    label: format!("does not convert to {unit}"),
    help: match unit.scale_meant() {
        Some(meant) => meant.to_owned(),
        None => format!("write it in {unit}, or correct the signal's unit"),
    },
}

problem! {
    /// A range whose low end is not below its high end.
    A022 RangeOrder { low: f64, high: f64, unit: String }
    message: format!("the range from {low} {unit} to {high} {unit} contains nothing"),
    label: "",
    help: "write the lower limit first",
}

problem! {
    /// `optional` names what is not a channel.
    A023 UnknownChannel { name: String, signal: String, known: Arc<Names> }
    error: "unknown channel",
    explanation: "`optional` names a channel that the signal does not have.",
    message: format!("signal \"{signal}\" has no channel \"{name}\""),
    label: "not a channel",
    help: nearest_of_many(name, known, "its channels are"),
}

problem! {
    /// When values apply is said of a signal that is not known ahead.
    A029 NotPlanned {}
    error: "not planned",
    explanation: "`applies_at` names the column that says from when a value applies. Only what is planned has one, such as the set points of \
        a recipe: its signal says with `known_ahead` how long before that it is known. What is measured applies when it is measured.",
    message: "`applies_at` belongs to a signal that is known ahead",
    label: "nothing is planned here",
    help: "say how long before they apply its values are known, as `known_ahead = \"30min\"`, or leave `applies_at` out",
}
