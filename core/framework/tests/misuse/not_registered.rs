use athermal_core::testkit::{Bench, Case};

struct Difference {}

athermal_core::conformance!(Difference, Case::new(""));

fn main() {
    Bench::of(&Difference {});
}
