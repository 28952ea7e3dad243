use athermal_core::testkit::Bench;

struct Difference {}

athermal_core::conformance!(Difference, athermal_core::testkit::Case::new(""));

fn main() {
    Bench::of(&Difference {});
}
