//! Mistakes in units, durations and quantities.

use crate::diagnostic::problem;
use crate::quantity::{Quantity, QuantityError};
use crate::time::DurationError;
use crate::unit::{Unit, UnitError};

problem! {
    /// A text that is no unit.
    A017 NotAUnit { error: UnitError }
    error: "unknown unit",
    explanation: "A unit is a UCUM code or a common spelling of one. Differences of temperatures are in K.",
    message: error.reason(),
    label: "not a unit",
    help: error.help(),
}

problem! {
    /// A text that is no duration.
    A018 NotADuration { error: DurationError }
    error: "duration or quantity",
    explanation: "A duration is a number and a unit of time, a quantity a number and a UCUM unit, in one text.",
    message: error.reason(),
    label: "not a duration",
    help: error.help(),
}

problem! {
    /// A text that is no quantity.
    A018 NotAQuantity { error: QuantityError }
    message: error.reason(),
    label: match error {
        QuantityError::Unit(_) => "the unit is not known",
        _ => "not a quantity",
    },
    help: error.help(),
}

problem! {
    /// A parameter that is given in a unit, within a text of its module that adds one.
    A018 UnitTwice {
        parameter: String,
        module: String,
        given: Quantity,
        /// The text of the module.
        text: String,
        /// The unit in it.
        unit: Unit,
    }
    message: format!("module \"{module}\" adds the unit to `{parameter}` itself, as \"{text}\""),
    label: "has a unit already",
    help: match given.in_unit(unit) {
        Some(number) => format!("give the number alone: {parameter} = {number}"),
        None => format!("give a number alone, in {unit}"),
    },
}

problem! {
    /// A number of samples where time is not counted in samples.
    A020 SamplesWithoutClock { text: String }
    error: "samples without sample time",
    explanation: "`2 samples` has a meaning only where `[time]` counts samples.",
    message: format!("\"{text}\" counts samples, and the time of this graph does not"),
    label: "",
    help: "write a duration like \"5min\", or count samples: `[time] unit = \"sample\"`",
}
