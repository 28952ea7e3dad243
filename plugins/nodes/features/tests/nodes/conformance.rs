//! Every kind of this crate through the rules that every node keeps.

use athermal_features::{
    Delay, Difference, FirstOrder, Hampel, Lag, MinimumDifference, Moving, Pick, Product, Resample,
    SampleAt, Scale, Slope, Sum,
};
use athermal_testkit::conformance;
use athermal_testkit::{Case, Rule, assert_every_kind_conforms};

conformance!(
    Slope,
    Case::new(r#"windows = ["5min"]"#).input("signal", 2, "Cel"),
    Case::new(r#"windows = ["1min", "2min", "10min"]"#).input("signal", 3, "nm"),
    Case::new(
        r#"
        windows = { dynamic_range = "2min", shortest = "1min", steps = 3, harmonics = 2 }
        unit = "mK/min"
        min_samples = 2
        min_coverage = 0.0
        cold = "partial"
        "#
    )
    .input("signal", 1, "K"),
);

conformance!(
    FirstOrder,
    Case::new(r#"time_constants = ["1min"]"#).input("signal", 2, "Cel"),
    Case::new(
        r#"
        time_constants = { from = "1min", to = "1h", steps = 4 }
        output = "value"
        "#
    ),
    Case::new(
        r#"
        time_constants = ["1min", "3min"]
        span = "15min"
        "#
    )
    .except(
        Rule::Past,
        "`span` says how far back it is to count, beyond which a share of 0.7 % is left"
    ),
);

conformance!(
    Delay,
    Case::new(r#"delay = "1min""#),
    Case::new(
        r#"
        delay = "3 ticks"
        unit = "nm"
        "#
    )
    .except(Rule::Units, "`unit` is that of the input"),
);

conformance!(
    Pick,
    Case::new(""),
    Case::new(r#"names = ["one", "two", "three"]"#).input("signal", 3, "Cel"),
);

conformance!(
    Sum,
    Case::new(""),
    Case::new("weights = [1.0, -2.5]"),
    Case::new("weights = [1.0, -1.0]")
        .input("signal", 2, "Cel")
        .except(Rule::Ranges, "weights of temperatures add up to 0 or 1"),
);

conformance!(
    Product,
    Case::new(r#"unit = "nm2""#).except(
        Rule::Units,
        "inputs are taken as plain numbers in their own units",
    ),
);

conformance!(
    Scale,
    Case::new(""),
    Case::new(
        r#"
        factor = 2.5
        offset = "-3 um"
        unit = "nm"
        "#
    )
    .except(
        Rule::Units,
        "the factor is one between numbers in the stated units"
    ),
);

conformance!(
    Moving,
    Case::new(r#"windows = ["5min"]"#).input("signal", 2, "Cel"),
    Case::new(
        r#"
        windows = ["1min", "3min"]
        min_samples = 1
        min_coverage = 0.0
        cold = "partial"
        "#
    )
    .input("signal", 3, "nm"),
);

conformance!(
    Hampel,
    Case::new(r#"window = "5min""#)
        .input("signal", 2, "Cel")
        .except(
            Rule::Past,
            "the verdict on a sample is of its instant, though it rests on the window"
        ),
    Case::new(
        r#"
        window = "2min"
        threshold = 1.5
        floor = "5 nm"
        replace = "median"
        "#
    )
    .input("signal", 2, "um"),
);

conformance!(
    MinimumDifference,
    Case::new(r#"difference = "5 mK""#).input("signal", 2, "Cel"),
    Case::new(r#"difference = "0.2 um""#)
        .input("signal", 1, "nm")
        .except(
            Rule::Past,
            "within `difference` of the sample, which is all of the range here, it is that of any time before"
        )
        .except(
            Rule::Memory,
            "it is that of any time before, and as near to the sample whichever that is"
        ),
);

conformance!(
    Lag,
    Case::new(r#"lags = ["1min"]"#),
    Case::new(
        r#"
        lags = ["0s", "30s", "5min"]
        max_age = "20s"
        "#
    )
    .input("signal", 2, "Cel"),
);

conformance!(
    Difference,
    Case::new(""),
    Case::new(
        r#"
        over = "2min"
        max_age = "20s"
        "#
    )
    .input("signal", 2, "Cel"),
);

conformance!(
    Resample,
    Case::new(r#"every = "1min""#),
    Case::new(
        r#"
        every = "25s"
        method = "last"
        "#
    )
    .input("signal", 2, "Cel"),
);

conformance!(
    SampleAt,
    Case::new("")
        .input("signal", 2, "Cel")
        .input("instants", 1, "nm"),
);

#[test]
fn every_kind_of_this_crate_conforms() {
    assert_every_kind_conforms(env!("CARGO_PKG_NAME"));
}
