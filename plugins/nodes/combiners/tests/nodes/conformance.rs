//! Every kind of this crate through the rules that every node keeps.

use athermal_combiners::{
    Adwin, AutoWeighted, Best, Conformal, Fallback, Guard, Hedge, Mean, Median, PageHinkley,
    StateGate, Trimmed,
};
use athermal_testkit::conformance;
use athermal_testkit::{Case, Rule, assert_every_kind_conforms};

conformance!(Mean, Case::new(""));

conformance!(
    Median,
    Case::new(""),
    Case::new("").input("voters", 4, "nm")
);

conformance!(
    Trimmed,
    Case::new(""),
    Case::new("share = 0.4").input("voters", 7, "nm"),
);

conformance!(Fallback, Case::new(""));

conformance!(
    Best,
    Case::new(r#"memory = "10min""#),
    Case::new("memory = { truths = 5 }"),
    Case::new(r#"memory = { half_life = "2min" }"#),
);

conformance!(
    Hedge,
    Case::new(""),
    Case::new(
        r#"
        rate = 0.5
        half_life = "5min"
        floor = 0.1
        "#
    )
    .input("voters", 4, "nm"),
);

conformance!(
    StateGate,
    Case::new("")
        .input("state", 1, "1")
        .between("state", 0.0, 2.0),
    Case::new(r#"dwell = "1min""#)
        .input("voters", 2, "nm")
        .input("state", 1, "1")
        .between("state", 0.0, 2.0),
);

conformance!(
    Guard,
    Case::new(r#"memory = "10min""#).input("voters", 1, "nm"),
    Case::new(
        r#"
        memory = "2min"
        min_truths = 1
        "#
    )
    .input("voters", 2, "nm"),
);

conformance!(
    AutoWeighted,
    Case::new(r#"memory = "15min""#),
    Case::new(
        r#"
        memory = "1min"
        power = 1.0
        "#
    )
    .input("voters", 2, "nm"),
    Case::new(
        r#"
        memory = "5min"
        weights = "as_printed"
        "#
    )
    .except(Rule::Ranges, "`power` is for inverse powers"),
    Case::new(
        r#"
        memory = "5min"
        weights = "as_printed_raw"
        "#
    )
    .except(
        Rule::Ranges,
        "`power` is for inverse powers, `shrinkage` and `floor` for weights that add up to 1"
    ),
    Case::new(
        r#"
        memory = { half_life = "5min" }
        shrinkage = 0.3
        floor = 0.2
        "#
    ),
);

conformance!(
    Conformal,
    Case::new(r#"memory = "10min""#).input("prediction", 1, "nm"),
    Case::new(
        r#"
        memory = "2min"
        coverage = 0.6
        gain = 0.1
        "#
    )
    .input("prediction", 2, "nm"),
    Case::new(
        r#"
        memory = "5min"
        gain = 0.0
        "#
    )
    .input("prediction", 1, "nm"),
);

conformance!(
    PageHinkley,
    Case::new("first = 5"),
    Case::new(
        r#"
        first = 5
        watch = "size"
        threshold = 2.0
        every = "30s"
        hold = "2min"
        "#
    )
    .input("voters", 1, "nm"),
);

conformance!(
    Adwin,
    Case::new("first = 5"),
    Case::new(
        r#"
        first = 5
        clock = 1
        confidence = 0.1
        watch = "size"
        "#
    )
    .input("voters", 1, "nm"),
);

#[test]
fn every_kind_of_this_crate_conforms() {
    assert_every_kind_conforms(env!("CARGO_PKG_NAME"));
}
