//! Every kind of this crate through the rules that every node keeps.

use athermal_testkit::conformance;
use athermal_testkit::{Case, assert_every_kind_conforms};
use my_node::MyNode;

conformance!(
    MyNode,
    Case::new(""),
    Case::new("pace = 1.0").input("voters", 5, "nm"),
);

#[test]
fn every_kind_of_this_crate_conforms() {
    assert_every_kind_conforms(env!("CARGO_PKG_NAME"));
}
