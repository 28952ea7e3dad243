//! Mistakes in what is compared or combined: units, spans, horizons and truths that differ.

use crate::diagnostic::problem;
use crate::time::Duration;
use crate::unit::Unit;

problem! {
    /// Two things that must have the same unit.
    A048 Units { first: String, first_unit: Unit, second: String, second_unit: Unit }
    error: "units that do not fit",
    explanation: "Two things are compared or combined that do not measure the same. Where a factor is all that it takes (um/min to \
        nm/min), it is inserted; between what does not convert, there is none.",
    message: format!("`{first}` is in {first_unit} and `{second}` in {second_unit}"),
    label: "units differ",
    help: "they are different quantities, which no unit makes one: refer to one of the same kind",
}

problem! {
    /// A point on a temperature scale where a difference is wanted, or the other way round.
    A063 PointOrDifference { channel: String, unit: Unit, wanted_by: String, wanted: Unit }
    error: "point and difference",
    explanation: "Cel and [degF] are points on a scale, K is a difference. Turning one into the other takes an offset, which is never \
        inserted: 1 K of expansion is not 1 Cel.",
    message: {
        let (is, takes) = if unit.is_temperature_point() {
            ("a temperature", "a difference of temperatures")
        } else {
            ("a difference of temperatures", "a temperature")
        };
        format!("`{channel}` is {is} ({unit}), and `{wanted_by}` {takes} ({wanted})")
    },
    label: "a point is no difference",
    help: "Cel and [degF] are points on a scale, and K is a difference; take a slope or difference of a temperature, or read the \
           temperature itself",
}

problem! {
    /// Two things that must summarise the same length of time.
    A049 Spans { first: String, first_span: Duration, second: String, second_span: Duration }
    error: "spans that do not fit",
    explanation: "Votes, and the truth that they are scored by, summarise the same length of time: a slope over 5 minutes is not one over \
        10.",
    message: format!("`{first}` summarises {first_span} and `{second}` {second_span}"),
    label: "spans differ",
    help: "compute both over windows of the same length",
}

problem! {
    /// Two predictions that must have the same horizon.
    A050 Horizons { first: String, first_ahead: Duration, second: String, second_ahead: Duration }
    error: "horizons that do not fit",
    explanation: "All voters of a combiner predict for the same instant, so they have the same `ahead`.",
    message: format!("`{first}` looks {first_ahead} ahead and `{second}` {second_ahead}"),
    label: "horizons differ",
    help: "give both the same `ahead`; what is no prediction has none, and a `persistence` node makes one of it",
}

problem! {
    /// Two predictions that must be of the same truth, or one and the truth that it is judged by.
    A066 Truths { first: String, first_truth: String, second: String, second_truth: String }
    error: "predictions of different truths",
    explanation: "All voters of a combiner predict the same thing, and are judged by it. A prediction of one axis is none of another, \
        however alike the two are.",
    message: if second == second_truth {
        format!("`{first}` predicts `{first_truth}` and is to be judged by `{second}`")
    } else {
        format!("`{first}` predicts `{first_truth}` and `{second}` `{second_truth}`")
    },
    label: "truths differ",
    help: "combine predictions of one axis; `each` makes a node for each of several",
}

problem! {
    /// A vote that is not what its node predicts.
    A067 NoPrediction { channel: String, prediction: String }
    error: "a vote that is no prediction",
    explanation: "The first port of an estimator or combiner is its prediction. Its other ports, such as `std_dev`, `lower` or `weights`, \
        describe that prediction; combined with predictions they would make a number of no meaning.",
    message: format!("`{channel}` describes the prediction `{prediction}` and is none"),
    label: "not a prediction",
    help: format!("let the prediction vote: `{prediction}`"),
}
