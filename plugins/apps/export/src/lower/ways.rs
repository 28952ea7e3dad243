//! What to put in the place of a kind that no export has.

use athermal_core::compile::PlannedNode;

const ARX: &str = "put `arx` of the same inputs in its place, whose fit is a linear form";
const WATCH: &str = "leave it out: errors are watched where the data are kept, by `athermal serve`";

/// Kinds with the way around each.
const WAYS: [(&str, &str); 13] = [
    ("remeasure", "leave it out, as `die-tester-compensate` does"),
    (
        "moving",
        "put `first_order` with `output = \"value\"` in its place",
    ),
    ("oe", ARX),
    ("armax", ARX),
    ("arimax", ARX),
    ("bj", ARX),
    ("state_space", ARX),
    ("narx", ARX),
    ("arma", "put `ar` in its place, whose fit is a linear form"),
    ("kalman", "put `linear` of the same features in its place"),
    (
        "stack",
        "put `auto_weighted` in its place, with its features as voters",
    ),
    ("page_hinkley", WATCH),
    ("adwin", WATCH),
];

pub(super) fn around(kind: &str) -> Option<&'static str> {
    WAYS.iter().find(|(of, _)| *of == kind).map(|(_, way)| *way)
}

/// The way around an estimator that keeps a state of its own or has no linear form, whatever its fit.
pub(super) fn around_estimator(node: &PlannedNode) -> Option<&'static str> {
    around(node.kind.name).filter(|_| node.kind.package == "athermal-estimators")
}
