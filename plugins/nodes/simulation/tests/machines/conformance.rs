//! Every machine of this crate through the rules that every machine keeps.

use athermal_simulation as _;
use athermal_testkit::assert_every_machine_conforms;

#[test]
fn every_machine_of_this_crate_conforms() {
    assert_every_machine_conforms(env!("CARGO_PKG_NAME"));
}
