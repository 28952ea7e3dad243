//! Numbers of channels that do not suit a node, or its parameters, are told when a graph is checked, and only those.

use super::mistakes::assert_told;
use crate::workbench::{Graph, Scratch, athermal};

fn graph(sensors: usize, node: &str) -> String {
    let names: Vec<String> = (0..sensors).map(|nth| format!("\"t{nth}\"")).collect();
    format!(
        r#"schema = 1
[signals.temperature]
unit = "Cel"
channels = [{}]
max_age = "1min"
[signals.position]
unit = "nm"
channels = ["X"]
[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["5min"]
[nodes.model]
inputs.features = "temperature"
inputs.truth = "drift"
ahead = "0s"
{node}
"#,
        names.join(", ")
    )
}

/// What is said of a graph that is refused.
fn checked(name: &str, text: &str) -> String {
    let scratch = Scratch::new(name);
    let graph = scratch.file("graph.toml", text);
    athermal(&[&"check", &graph]).ended(2).told
}

#[test]
fn lists_of_orders_are_as_long_as_there_are_features() {
    for kind in ["armax", "oe", "bj", "arimax"] {
        let node = |list: &str| graph(2, &format!("type = \"{kind}\"\nnb = {list}\nnk = [0, 0]"));
        let name = format!("command-line-lists-{kind}");
        let expected = [(18, "`nb` has 3 orders for 2 features")];
        assert_told(&name, &node("[1, 1, 1]"), &expected);
        let expected = [(18, "`nb` has 1 order for 2 features")];
        assert_told(&name, &node("[1]"), &expected);
    }
}

#[test]
fn more_features_than_a_kind_takes_are_reported() {
    let told = |name: &str, sensors: usize, node: &str, expected: &[(u64, &str)]| {
        assert_told(
            &format!("command-line-many-{name}"),
            &graph(sensors, node),
            expected,
        );
    };
    let polynomial = [(14, "40 features give 860 terms")];
    told("polynomial", 40, "type = \"polynomial\"", &polynomial);
    let text = graph(40, "type = \"polynomial\"");
    let way_out = "name fewer features, or set `interactions = false`";
    assert!(checked("command-line-many-help", &text).contains(way_out));
    let narx = [(
        14,
        "41 features and lags give more than 500 products of up to 2",
    )];
    let node = "type = \"narx\"\nlags = [\"5min\"]";
    told("narx", 40, node, &narx);
    // A parameter out of its range comes first.
    let expected = [(19, "`most` is 0 and must be 1 or more")];
    told("narx-most", 40, &format!("{node}\nmost = 0"), &expected);
    let space = [(14, "60 features over a horizon of 100 steps")];
    told("space", 60, "type = \"state_space\"\nhorizon = 100", &space);
}

#[test]
fn a_scale_of_temperature_that_is_written_as_another_unit_is_named() {
    let text = graph(1, "type = \"linear\"")
        .replace("\"Cel\"", "\"C\"")
        .replace(
            "inputs.signal = \"position\"",
            "inputs.signal = \"temperature\"\nunit = \"mK/min\"",
        );
    let told = checked("command-line-scale", &text);
    assert!(
        told.contains("degrees Celsius are \"Cel\"; \"C\" is the coulomb"),
        "{told}"
    );
}

/// The help for each of these lines in the place of a sound one.
fn helped(name: &str, text: &str, wrong: &[(&str, &str, &str)]) {
    for (nth, (line, instead, help)) in wrong.iter().enumerate() {
        assert!(text.contains(line), "{line}");
        let told = checked(&format!("{name}-{nth}"), &text.replace(line, instead));
        assert!(told.contains(help), "{instead}: {told}");
    }
}

#[test]
fn a_number_without_its_unit_is_reported_with_an_example() {
    let text = Graph::new()
        .signal("rate", "nm/min", "X", "1min")
        .with("range = ['-200 nm/min', '200 nm/min']")
        .section("nodes.move", "type = 'compensate'")
        .with("inputs.rate = 'rate'; range = '20 um'")
        .with("max_rate = '1000 nm/min'; max_slew = '50 nm/s'")
        .with("stop = { below = '3 nm/min', above = '6 nm/min' }")
        .section("nodes.radius", "type = 'optical_loss'")
        .with("inputs.drift = 'rate'; radii = ['2 um']")
        .outputs("move = { from = 'move', blend = '5 nm/s' }; loss = 'radius'");
    let wrong = [
        (
            "range = [\"-200 nm/min\"",
            "range = [-20",
            "write \"-20 nm/min\"",
        ),
        (
            "range = \"20 um\"",
            "range = 200",
            "needs a unit, e.g. \"200 nm/min\"",
        ),
        (
            "range = \"20 um\"",
            "range = \"200\"",
            "needs a unit, e.g. \"200 nm/min\"",
        ),
        (
            "below = \"3 nm/min\"",
            "below = 0.5",
            "needs a unit, e.g. \"0.5 nm/min\"",
        ),
        (
            "radii = [\"2 um\"]",
            "radii = [2]",
            "needs a unit, e.g. \"2 nm/min\"",
        ),
        (
            "blend = \"5 nm/s\"",
            "blend = 5",
            "needs a unit, e.g. \"5 nm/s\"",
        ),
    ];
    helped("command-line-bare", &text, &wrong);
}

#[test]
fn channels_of_one_name_are_told_apart_by_their_nodes() {
    let text = r#"schema = 1
[signals.p]
unit = "nm"
channels = ["q"]
[nodes.s]
type = "slope"
inputs.signal = "p"
windows = ["5min"]
unit = "nm/s"
[nodes.s2]
type = "slope"
inputs.signal = "p"
windows = ["5min"]
unit = "um/min"
[nodes.both]
type = "sum"
inputs.signal = ["s", "s2"]
weights = [1]
[outputs]
both = "both"
"#;
    let expected = [
        (17, "`s.q` is in nm/s and `s2.q` in um/min"),
        (18, "`weights` has 1 numbers for 2 channels"),
    ];
    assert_told("command-line-one-name", text, &expected);
}

#[test]
fn a_state_for_each_rate_is_no_mistake_beside_one_in_a_parameter() {
    let text = r#"schema = 1
[signals.position]
unit = "nm"
channels = ["X", "Y"]
max_age = "1min"
[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["5min"]
[nodes.stability]
type = "stability"
inputs.drift = "drift"
stable_below = "10 nm/min"
transient_above = "50 nm/min"
[nodes.correction]
type = "compensate"
inputs.rate = "drift"
inputs.state = "stability"
range = "2 um"
max_rate = "60 nm/min"
max_slew = "1 nm/s"
stop_in = [0]
[outputs]
correction = "correction"
"#;
    let expected = "expected the name of a choice for \"stop_in\"";
    assert_told("state-per-rate", text, &[(22, expected)]);
}
