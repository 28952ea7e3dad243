//! Every kind of this crate through the rules that every node keeps.

use athermal_kinematics::Kinematics;
use athermal_testkit::conformance;
use athermal_testkit::{Case, assert_every_kind_conforms};

conformance!(
    Kinematics,
    Case::new(
        r#"
        links = [{ length = "600 mm", along = [1, 2, 3] }, { length = "300 mm", along = [1, -1, 1] }]
        "#
    )
    .input("links", 2, "nm"),
    Case::new(
        r#"
        links = [{ length = "600 mm", along = [1, 2, 3], about = [1, 1, 1] }]
        point = ["10 mm", "-2 cm", "0 mm"]
        unit = "um/min"
        "#
    )
    .input("links", 1, "urad/min"),
);

#[test]
fn every_kind_of_this_crate_conforms() {
    assert_every_kind_conforms(env!("CARGO_PKG_NAME"));
}
