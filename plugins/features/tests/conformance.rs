//! Every kind of this crate through the rules that every node keeps.

use athermal_core::conformance;
use athermal_core::testkit::{Case, Rule, assert_every_kind_conforms};
use athermal_features::{Delay, FirstOrder, Pick, Product, Scale, Slope, Sum};

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
    Case::new("weights = [1.0, -1.0]").input("signal", 2, "Cel"),
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

#[test]
fn every_kind_of_this_crate_conforms() {
    assert_every_kind_conforms(env!("CARGO_PKG_NAME"));
}
