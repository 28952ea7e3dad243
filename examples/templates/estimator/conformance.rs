//! Every kind of this crate through the rules that every node keeps.

use athermal_testkit::conformance;
use athermal_testkit::{Case, assert_every_kind_conforms};
use my_node::MyNode;

conformance!(
    MyNode,
    Case::new("ahead = '1min'"),
    Case::new("ahead = '0s'\nshrinkage = 0.5").input("features", 1, "Cel"),
);

#[test]
fn every_kind_of_this_crate_conforms() {
    assert_every_kind_conforms(env!("CARGO_PKG_NAME"));
}
