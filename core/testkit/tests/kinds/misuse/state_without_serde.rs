/// A state that cannot be written.
#[derive(Debug)]
struct Last {
    value: f64,
}

athermal_core::state!(Last, "difference/1");

fn main() {}
