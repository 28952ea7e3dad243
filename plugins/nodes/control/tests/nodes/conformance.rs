//! Every kind of this crate through the rules that every node keeps.

use athermal_control::{
    Compensate, CrossCheck, Health, OpticalLoss, Remeasure, SafeState, Settled, Stability,
    Uncorrected,
};
use athermal_testkit::conformance;
use athermal_testkit::{Case, Rule, assert_every_kind_conforms};

/// Why the past of a correction is not asked for.
const IS_TAKEN_OUT: &str =
    "it sums up all rates, and a truth that is made of it has it taken out again by `uncorrected`";

conformance!(
    Compensate,
    Case::new(
        r#"
        range = "20 um"
        max_rate = "1000 nm/min"
        max_slew = "50 nm/s"
        "#
    )
    .input("rate", 2, "nm/min")
    .speaks_without_input(&["correction", "why"])
    .except(Rule::Past, IS_TAKEN_OUT)
    .except(Rule::Memory, IS_TAKEN_OUT),
    Case::new(
        r#"
        range = "100 nm"
        max_rate = "60 nm/min"
        max_slew = "1 nm/s"
        deadband = "2 nm/min"
        stop = { below = "5 nm/min", above = "10 nm/min" }
        stop_in = ["stable"]
        max_gap = "2min"
        "#
    )
    .input("rate", 1, "nm/min")
    .input("state", 1, "1")
    .between("state", 0.0, 2.0)
    .input("realigned", 1, "1")
    .between("realigned", 0.0, 1.0)
    .speaks_without_input(&["correction", "why"])
    .except(Rule::Past, IS_TAKEN_OUT)
    .except(Rule::Memory, IS_TAKEN_OUT),
);

/// Why the past of a sensor is not all that a value is made of.
const IS_OF_OTHERS: &str =
    "the others say whether a sample is there, and a verdict stands for as long as it holds";

conformance!(
    CrossCheck,
    Case::new(
        r#"
        ahead = "0s"
        lag = "1min"
        after = "20s"
        recover = "1min"
        "#
    )
    .input("signal", 3, "Cel")
    .speaks_without_input(&["reason"])
    .except(Rule::Past, IS_OF_OTHERS),
    Case::new(
        r#"
        ahead = "0s"
        limit = 2.0
        lag = "10s"
        recover = "30s"
        "#
    )
    .input("signal", 4, "K")
    .speaks_without_input(&["reason"])
    .except(Rule::Past, IS_OF_OTHERS),
);

conformance!(
    Health,
    Case::new("")
        .input("signal", 2, "Cel")
        .speaks_without_input(&["reason"]),
    Case::new(
        r#"
        range = ["21 Cel", "28 Cel"]
        max_rate = "0.2 K/s"
        stuck_after = "1min"
        noise_above = "1 mK"
        noise_below = "5 K"
        noise_samples = 5
        max_gap = "1min"
        recover = "30s"
        "#
    )
    .input("signal", 2, "Cel")
    .speaks_without_input(&["reason"])
    .except(
        Rule::Past,
        "the verdict on a sample is of its instant, whatever it rests on"
    ),
);

conformance!(
    OpticalLoss,
    Case::new(
        r#"
        over = "5min"
        radii = ["10 um", "2 um"]
        "#
    )
    .input("drift", 2, "nm/min"),
    Case::new(
        r#"
        over = "5min"
        radii = ["10 um"]
        "#
    )
    .input("drift", 3, "nm/min"),
);

/// Why the past of a request is not asked for.
const IS_SUMMED_UP: &str =
    "what is uncertain sums up since the last measurement, whenever that was";

conformance!(
    Remeasure,
    Case::new(
        r#"
        tolerance = "20 nm"
        lead = "2min"
        longest = "1h"
        "#
    )
    .input("std_dev", 2, "nm/min")
    .between("std_dev", 0.5, 8.0)
    .speaks_without_input(&["ask", "due", "why"])
    .except(Rule::Past, IS_SUMMED_UP)
    .except(Rule::Memory, IS_SUMMED_UP),
    Case::new(
        r#"
        tolerance = "0.1 um"
        least = "20s"
        longest = "10min"
        memory = "2min"
        sigmas = 3.0
        "#
    )
    .input("std_dev", 2, "nm/min")
    .between("std_dev", 0.5, 20.0)
    .input("measured", 1, "nm")
    .speaks_without_input(&["ask", "due", "why"])
    .except(Rule::Past, IS_SUMMED_UP)
    .except(Rule::Memory, IS_SUMMED_UP),
);

conformance!(
    SafeState,
    Case::new(
        r#"
        when_lost = "zero"
        after = 2
        max_slew = "5 nm/s"
        "#
    )
    .speaks_without_input(&["safe", "why"]),
    Case::new(
        r#"
        when_lost = "value"
        value = "-10 nm"
        max_slew = "1 nm/s"
        "#
    )
    .input("distrust", 1, "1")
    .speaks_without_input(&["safe", "why"]),
    Case::new(
        r#"
        when_lost = "hold"
        max_slew = "1 nm/s"
        "#
    )
    .speaks_without_input(&["safe", "why"]),
);

conformance!(
    Settled,
    Case::new(
        r#"
        below = "0.3 dB"
        change = "2 K"
        for = "1min"
        "#
    )
    .input("loss", 1, "dB")
    .between("loss", 0.0, 1.0)
    .input("set_point", 1, "Cel")
    .speaks_without_input(&["since"])
    .except(
        Rule::Past,
        "how long settling took is told until the next change"
    )
    .except(
        Rule::Memory,
        "a change of any time ago may not have settled yet"
    ),
);

conformance!(
    Stability,
    Case::new(
        r#"
        stable_below = "20 nm/min"
        transient_above = "80 nm/min"
        "#
    )
    .input("drift", 3, "nm/min"),
    Case::new(
        r#"
        stable_below = "30 nm/min"
        transient_above = "60 nm/min"
        hysteresis = "5 nm/min"
        dwell = "1min"
        "#
    )
    .input("drift", 1, "nm/min"),
);

conformance!(
    Uncorrected,
    Case::new(""),
    Case::new(r#"until_first = "zero""#).input("applied", 2, "um"),
);

#[test]
fn every_kind_of_this_crate_conforms() {
    assert_every_kind_conforms(env!("CARGO_PKG_NAME"));
}
