use athermal_testkit::Bench;

struct Difference {}

athermal_testkit::conformance!(Difference, athermal_testkit::Case::new(""));

fn main() {
    Bench::of(&Difference {});
}
