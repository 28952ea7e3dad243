//! A mistake hides no other: those of a file's form and those of its meaning are told together.

use crate::workbench::{Scratch, athermal};

const WRONG: &str = r#"schema = 1
[signals.temperature]
unit = "Cel"
channels = ["a", "b"]
max_age = "1 fortnight"
[signals.position]
unit = "nm"
channels = ["X"]
max_age = "1min"
[nodes.gradients]
type = "slpe"
inputs.signal = "temprature"
[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["5min"]
[nodes.thermal]
type = "linear"
inputs.features = ["gradients", "temperature"]
inputs.truth = "drift.Y"
ahead = "0s"
lags = 3
[outputs]
predicted = "thermal"
"#;

#[test]
fn a_mistake_of_the_form_hides_none_of_the_meaning() {
    let scratch = Scratch::new("command-line-mistakes");
    let graph = scratch.file("wrong.toml", WRONG);
    let told = athermal(&[&"check", &"--format", &"json", &graph]).ended(2);
    let told = told.json();
    let told = told["diagnostics"].as_array().unwrap();
    let lines: Vec<_> = told
        .iter()
        .map(|one| {
            (
                one["line"].as_u64().unwrap(),
                one["message"].as_str().unwrap(),
            )
        })
        .collect();
    let expected = [
        (5, "fortnight"),
        (11, "slpe"),
        (12, "temprature"),
        (20, "Y"),
        (22, "lags"),
    ];
    assert_eq!(lines.len(), expected.len(), "{lines:#?}");
    for ((line, message), (place, names)) in lines.iter().zip(expected) {
        assert!(*line == place && message.contains(names), "{lines:#?}");
    }
}
