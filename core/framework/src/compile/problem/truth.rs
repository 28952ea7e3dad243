//! Mistakes in what an estimator learns from, and what it must not see of it.

use std::cmp::Ordering;

use crate::compile::fed_back;
use crate::compile::provenance::smallest_lag;
use crate::diagnostic::problem;
use crate::quantity::Quantity;
use crate::time::Duration;
use crate::unit::Unit;

problem! {
    /// A regressor that contains part of the answer.
    A052 Leak {
        regressor: String,
        lag: Duration,
        truth: String,
        span: Duration,
        /// How far the truth itself is behind what was measured.
        late: Duration,
        ahead: Duration,
        /// The channels from the regressor back to what was measured; none where the truth itself is lagged.
        path: Vec<String>,
    }
    error: "part of the answer",
    explanation: "A regressor, or a vote that is no prediction, overlaps the value that is predicted. Windows of neighbouring truths \
        overlap. So a recent truth, a feature made of the truth's signal, or what learns from the truth while it runs, contains part of \
        the answer, and scores would flatter. A lag of at least the truth's span less `ahead` is free of it.",
    message: format!(
        "`{regressor}` contains part of the answer: it overlaps the value of `{truth}` that is predicted"
    ),
    label: "sees the future",
    help: {
        let smallest = smallest_lag(*late + *span, *ahead);
        let smallest = match (span.is_zero(), late.cmp(ahead)) {
            (true, Ordering::Equal) => "one sample".to_owned(),
            (true, Ordering::Greater) => format!("one sample more than {smallest}"),
            _ => smallest.to_string(),
        };
        let is_late = match late.is_zero() {
            true => String::new(),
            false => format!(", is {late} late"),
        };
        let way = match path.is_empty() {
            true => String::new(),
            false => format!("it is made of what the truth is made of: {}; ", way_back(path)),
        };
        format!(
            "{way}the truth summarises {span}{is_late} and is predicted {ahead} ahead, so the smallest lag allowed is {smallest} \
             (here it is {lag})"
        )
    },
}

/// A way through the graph; the middle of a long one is left out.
fn way_back(path: &[String]) -> String {
    const ENDS: usize = 4;
    let quoted = |names: &[String]| {
        let names: Vec<_> = names.iter().map(|name| format!("`{name}`")).collect();
        names.join(" from ")
    };
    if path.len() <= 2 * ENDS {
        return quoted(path);
    }
    let (first, last) = (&path[..ENDS], &path[path.len() - ENDS..]);
    format!("{} from … from {}", quoted(first), quoted(last))
}

problem! {
    /// An estimator without a horizon.
    A055 NoHorizon { kind: &'static str }
    error: "an estimator without a horizon",
    explanation: "An estimator predicts the value that its truth will have at `t + ahead`, so it needs an `ahead`; `\"0s\"` is a virtual \
        sensor.",
    message: format!("`{kind}` needs to know how far `ahead` it predicts"),
    label: "`ahead` is missing",
    help: "`ahead = \"5min\"` is a forecast, `ahead = \"0s\"` a virtual sensor",
}

const SOMETHING_MEASURED: &str = "refer to something measured, such as the slope of a position";

problem! {
    /// A truth that is a prediction.
    A056 PredictedTruth { channel: String }
    error: "a truth that is a prediction",
    explanation: "An estimator learns from what was measured. A prediction, or a combination of predictions, is no truth, nor is what \
        describes one, such as its `std_dev` or `weights`.",
    message: format!("`{channel}` is a prediction and cannot be the truth"),
    label: "not measured",
    help: SOMETHING_MEASURED,
}

problem! {
    /// A truth that describes a prediction, as its standard deviation does.
    A056 TruthOfPrediction { channel: String, prediction: String }
    message: format!("`{channel}` describes the prediction `{prediction}` and cannot be the truth"),
    label: "not measured",
    help: SOMETHING_MEASURED,
}

problem! {
    /// A limit of a unit that is not the truth's.
    A057 LimitUnit { found: Unit, expected: Unit }
    error: "a limit in another unit",
    explanation: "Limits of the absolute truth are in a unit that converts to the truth's, and `blend` is a rate above zero in one that \
        converts to the output's per second.",
    message: format!("the limit is in {found} and the truth in {expected}, which do not convert"),
    label: "another unit",
    help: format!("write the limit in {expected}"),
}

problem! {
    /// A rate at which no output passes from one graph to the next.
    A057 Blend { output: String, found: Quantity, expected: Unit }
    message: format!("`blend` is {found}, and `{output}` can only pass over at a rate above zero in {expected}"),
    label: "no such rate",
    help: format!(
        "write by how much it may change per time, such as `5 {expected}`; without `blend` it steps over at once"
    ),
}

problem! {
    /// Limits of a fit that admit no row.
    A064 NoRows { below: Quantity, above: Quantity }
    error: "limits that admit nothing",
    explanation: "`train.abs_truth` leaves no row to fit on: `below` is larger than `above`, and neither is negative.",
    message: format!("no truth lies below {below} and at or above {above}"),
    label: "admits no row",
    help: "`above` is 0 or more, and `below` is larger",
}

problem! {
    /// A correction that goes by past truths which it moves.
    A162 FedBack {
        channel: String,
        /// How many more it moves and goes by.
        more: usize,
    }
    error: "a correction that goes by what it moves",
    explanation: "A correction moves the positions that it corrects. A learner, lag or vote behind it that reads them as they are measured \
        sees a drift that lacks what was taken away, and goes by that. An `uncorrected` node puts it back.",
    message: format!(
        "the correction goes by past drifts of `{channel}`{}, which it moves itself",
        match more {
            0 => String::new(),
            more => format!(" and {more} more"),
        }
    ),
    label: "goes by what it moves",
    help: fed_back::WAY_OUT,
}

problem! {
    /// A truth made of values that depend on all of the past.
    A160 EndlessTruth { channel: String, node: String }
    error: "a truth without a span",
    explanation: "What may be known of a truth, and when, follows from its span: the length of past time that one value summarises. A \
        first-order lag depends on all of the past, so it has none unless `span` defines how much of it counts.",
    message: format!("`{channel}` cannot be the truth, since `{node}` remembers all of the past"),
    label: "of no span",
    help: format!(
        "set how much of the past counts, such as `span = \"10min\"` on `{node}`, or use a window, such as `slope`"
    ),
}

problem! {
    /// What is read before it is known.
    A161 NotKnownAhead {
        channel: String,
        /// How far ahead it is read.
        ahead: Duration,
        /// How far ahead it is known, where it is planned.
        known: Option<Duration>,
        is_measured: bool,
    }
    error: "ahead of its time",
    explanation: "A negative lag reads what will be. That is known only of what is planned, such as the set points of a recipe. Its signal \
        says with `known_ahead` how long before it applies a value is known; a `lag` reads it so far ahead and no further. What is \
        measured, and what is computed from it, is not known before its time.",
    message: match known {
        Some(known) => format!("`{channel}` is read {ahead} ahead, and known {known} ahead"),
        None if *is_measured => format!("`{channel}` is measured, so that nobody knows it {ahead} ahead"),
        None => format!("`{channel}` is computed at each tick, so that nobody knows it {ahead} ahead"),
    },
    label: "sees the future",
    help: match known {
        Some(_) => format!("read it less far ahead, or plan earlier and say so: `known_ahead = \"{ahead}\"`"),
        None if *is_measured => format!(
            "if it is planned, as a set point is, say how long before it applies it is known: `known_ahead = \"{ahead}\"` on its signal"
        ),
        None => "read the signal of a plan ahead, and compute from what the `lag` gives".to_owned(),
    },
}
