//! A mistake hides no other: those of a file's form and those of its meaning are told together.

use serde_json::Value;

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

/// The lines at which mistakes are told, and how each is.
fn told(name: &str, text: &str) -> Vec<(u64, String)> {
    let scratch = Scratch::new(name);
    let graph = scratch.file("wrong.toml", text);
    let told = athermal(&[&"check", &"--format", &"json", &graph])
        .ended(2)
        .json();
    let told = told["diagnostics"].as_array().unwrap().iter();
    let line = |one: &Value| {
        let message = one["message"].as_str().unwrap();
        (one["line"].as_u64().unwrap(), message.to_owned())
    };
    told.map(line).collect()
}

/// Told are these alone, in this order: a line, and a part of what is said of it.
#[track_caller]
fn assert_told(name: &str, text: &str, expected: &[(u64, &str)]) {
    let told = told(name, text);
    let fits = told.len() == expected.len()
        && told
            .iter()
            .zip(expected)
            .all(|((line, message), (place, part))| line == place && message.contains(part));
    assert!(fits, "{told:#?}");
}

#[test]
fn a_mistake_of_the_form_hides_none_of_the_meaning() {
    let expected = [
        (5, "fortnight"),
        (11, "slpe"),
        (12, "temprature"),
        (20, "Y"),
        (22, "lags"),
    ];
    assert_told("command-line-mistakes", WRONG, &expected);
}

#[test]
fn a_signal_that_is_only_told_wrongly_when_it_counts_is_known_to_all_others() {
    let text = r#"schema = 1
[signals.temperature]
unit = "Cel"
channels = ["a", "b"]
range = ["20 Cel", "10 Cel"]
max_age = "-1s"
optional = ["c"]
[nodes.far]
type = "pick"
inputs.signal = "temperature.z"
[nodes.thermal]
type = "linear"
inputs.features = "temperature"
inputs.truth = "temperature"
ahead = "0s"
[outputs]
predicted = "thermal"
"#;
    let expected = [
        (5, "the range from 20 Cel to 10 Cel"),
        (6, "found a negative one"),
        (7, "no channel \"c\""),
        (10, "no channel that matches `z`"),
        (14, "one channel"),
    ];
    assert_told("command-line-signals", text, &expected);
}

#[test]
fn mistakes_of_sets_names_and_sections_hide_none_of_the_rest() {
    let text = r#"schema = 1
[sets]
axis = ["X", "X"]
[signals.temperature]
unit = "Cel"
channels = ["a"]
max_age = "1min"
[signals.position]
unit = "nm"
channels = "axis"
max_age = "1min"
[signals.drift]
unit = "nm"
channels = ["a"]
max_age = "1min"
[nodes.drift]
type = "slope"
each = "axis"
inputs.signal = "position.{axis}"
windows = ["5min"]
[node.lost]
type = "slope"
inputs.signal = "temperature"
windows = ["5min"]
[nodes."a b"]
type = "slope"
inputs.signal = "temperature"
windows = ["0min"]
[nodes.thermal]
type = "linear"
inputs.features = ["lost", "temperatur", "a b"]
inputs.truth = "drift.X"
ahead = "0s"
[outputs]
predicted = "thermal"
position = "position.Y"
"#;
    let expected = [
        (3, "the member \"X\""),
        (16, "the node \"drift\""),
        (21, "no key \"node\""),
        (25, "\"a b\" cannot be the name"),
        (28, "a window of 0s"),
        (31, "`temperatur`"),
    ];
    assert_told("command-line-sets", text, &expected);
}

#[test]
fn mistakes_of_a_module_hide_none_outside_of_it() {
    let text = r#"schema = 1
[signals.temperature]
unit = "Cel"
channels = ["a"]
max_age = "1min"
[modules.pair]
inputs = ["from"]
required = ["window"]
outputs = { slope = "slope", other = "nothing" }
nodes.slope = { type = "slope", inputs.signal = "{from}", windows = ["{window}"] }
[nodes.one]
module = "pair"
inputs.from = "temperature"
[nodes.two]
module = "pair"
inputs.from = "temperature"
window = "soon"
[nodes.shown]
type = "pick"
inputs.signal = ["one", "two:slope", "tow"]
[outputs]
shown = "shown"
both = ["one", "two:other.a"]
"#;
    let expected = [(9, "nothing"), (11, "window"), (20, "tow")];
    assert_told("command-line-modules", text, &expected);
}
