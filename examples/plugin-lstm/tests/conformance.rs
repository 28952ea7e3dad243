//! Every kind of this crate through the rules that every node keeps.

use athermal_lstm::{Lstm, LstmEncoder};
use athermal_testkit::conformance;
use athermal_testkit::{Case, assert_every_kind_conforms};

conformance!(
    Lstm,
    Case::new(
        r#"
        ahead = "1min"
        sequence = { steps = 4, every = "20s" }
        units = 4
        training = { epochs = 4, batch = 32 }
        "#
    ),
    Case::new(
        r#"
        ahead = "0s"
        sequence = { steps = 1, every = "1min" }
        units = 1
        training = { epochs = 2, patience = 1, validation = 0.5, seed = 7 }
        "#
    )
    .input("features", 1, "Cel"),
);

conformance!(
    LstmEncoder,
    Case::new(
        r#"
        ahead = "1min"
        sequence = { steps = 3, every = "30s" }
        units = 3
        training = { epochs = 4, batch = 32 }
        "#
    ),
    Case::new(
        r#"
        ahead = "0s"
        train.abs_truth = { below = "60 nm" }
        sequence = { steps = 2, every = "1min" }
        units = 1
        training = { epochs = 2, rate = 0.02 }
        "#
    )
    .input("features", 2, "Cel"),
);

#[test]
fn every_kind_of_this_crate_conforms() {
    assert_every_kind_conforms(env!("CARGO_PKG_NAME"));
}
