//! A mistake hides no other of what could be read: all are reported together.

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
pub(crate) fn assert_told(name: &str, text: &str, expected: &[(u64, &str)]) {
    let told = told(name, text);
    let fits = told.len() == expected.len()
        && told
            .iter()
            .zip(expected)
            .all(|((line, message), (place, part))| line == place && message.contains(part));
    assert!(fits, "{told:#?}");
}

#[test]
fn six_mistakes_of_six_kinds_are_reported_at_once_each_with_its_suggestion() {
    let text = r#"schema = 1
[signals.temperature]
unit = "nm/mn"
channels = ["a"]
max_age = "1min"
[signals.position]
unit = "nm"
channels = ["X"]
max_age = "5 minuets"
[nodes.gradients]
type = "slpe"
inputs.signal = "position"
windows = ["5min"]
[nodes.drift]
type = "slope"
inputs.signal = "positon"
widows = ["5min"]
[nodes.thermal]
type = "zero"
inputs.truth = "drfit"
ahead = "5min"
[outputs]
predicted = "thermal"
"#;
    let scratch = Scratch::new("six-mistakes");
    let graph = scratch.file("wrong.toml", text);
    let report = athermal(&[&"check", &"--format", &"json", &graph]);
    let report = report.ended(2).json();
    let shown = report["diagnostics"].as_array().unwrap().iter();
    let shown = shown.map(|one| {
        let help = one["help"].as_str().or(one["message"].as_str());
        (one["line"].as_u64().unwrap(), help.unwrap().to_owned())
    });
    let expected = [
        (3, "nm/min"),
        (9, "the units are ns, us, ms, s, min"),
        (11, "`slope`"),
        (16, "`position`"),
        (17, "\"windows\""),
        (20, "`drift`"),
    ];
    let shown: Vec<_> = shown.collect();
    assert_eq!(shown.len(), expected.len(), "{shown:#?}");
    for ((line, help), (at, part)) in shown.iter().zip(expected) {
        assert!(*line == at && help.contains(part), "{shown:#?}");
    }
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
        (28, "`windows` is 0s and must be greater than 0"),
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
    // What is given to a module counts once no module has a mistake.
    let text = text
        .replace("other = \"nothing\"", "other = \"slope\"")
        .replace(
            "module = \"pair\"\ninputs.from = \"temperature\"\n[nodes.two]",
            "module = \"pair\"\ninputs.from = \"temperature\"\nwindow = \"5min\"\n[nodes.two]",
        );
    let expected = [(18, "soon"), (21, "tow")];
    assert_told("command-line-module-parameters", &text, &expected);
}

/// Signals, and slopes of them, to which nodes with mistakes are added.
pub(crate) const SOUND: &str = r#"schema = 1
[sets]
axis = ["X", "Y"]
[signals.temperature]
unit = "Cel"
channels = ["a", "b"]
max_age = "1min"
[signals.position]
unit = "nm"
channels = "axis"
max_age = "1min"
[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["5min"]
[outputs]
predicted = "thermal"
"#;

#[test]
fn a_parameter_that_cannot_be_read_hides_nothing_else_of_its_node() {
    let text = SOUND.to_owned()
        + r#"[nodes.thermal]
type = "linear"
each = "axis"
inputs.feature = "temperatur"
inputs.truth = "drift.*"
ahead = 5
solver = { type = "ridge", alpha = -1.0 }
[nodes.vote]
type = "page_hinkley"
inputs.voters = "thermal"
inputs.truth = "drift.Z"
first = 1
threshold = "much"
[nodes.back]
type = "delay"
inputs.signal = "back"
delay = "soon"
"#;
    let expected = [
        (21, "no input `feature`"),
        (21, "no node or signal `temperatur`"),
        (22, "one channel"),
        (23, "ahead"),
        (24, "alpha"),
        (28, "no channel that matches `Z`"),
        (30, "threshold"),
        (34, "soon"),
    ];
    assert_told("command-line-unreadable", &text, &expected);
}

#[test]
fn an_instance_of_a_module_that_cannot_be_expanded_hides_none_of_its_own_mistakes() {
    let text = SOUND.to_owned()
        + r#"[modules.pair]
inputs = ["from"]
required = ["window"]
outputs = { slope = "slope" }
nodes.slope = { type = "slope", inputs.signal = "{from}", windows = ["{window}"] }
[nodes.one]
module = "pair"
each = "axs"
inputs.from = "temperture"
inputs.form = "position.{axis}"
windw = "5min"
[nodes.two]
module = "par"
each = "axs"
inputs.from = "position.{axis}"
[nodes.three]
module = "pair"
each = "axis"
inputs.from = "position.{axes}"
[nodes.thermal]
type = "pick"
inputs.signal = ["one", "two", "three", "for"]
"#;
    let expected = [
        (25, "no set \"axs\""),
        (26, "temperture"),
        (27, "no key \"form\""),
        (28, "no key \"windw\""),
        (30, "no module \"par\""),
        (31, "no set \"axs\""),
        (33, "window"),
        (36, "{axes}"),
        (39, "`for`"),
    ];
    assert_told("command-line-unexpanded", &text, &expected);
}

#[test]
fn a_set_that_is_not_known_hides_nothing_of_the_nodes_that_use_it() {
    let nodes = r#"[nodes.thermal]
type = "linear"
each = "axs"
inputs.features = ["temperatur", "{axis}"]
inputs.truth = "drift.{axis}"
ahead = 5
label = "{axis}"
[nodes.fast]
type = "slope"
each = "axis"
inputs.signals = "position.{axis}"
windows = "{axis}"
seletion = 3
"#;
    let expected = [
        (20, "no set \"axs\""),
        (21, "temperatur"),
        (28, "no input `signals`"),
        (29, "windows"),
        (30, "seletion"),
    ];
    let text = SOUND.to_owned() + nodes;
    assert_told("command-line-unknown-set", &text, &expected);
    // Of a faulty set it is not known what its members would have been.
    let text = text.replace("[\"X\", \"Y\"]", "[\"X\", 2]");
    let expected = [&[(3, "number 2")], &expected[..3]].concat();
    assert_told("command-line-faulty-set", &text, &expected);
    let text = SOUND.replace("[sets]\naxis =", "[set]\naxis =")
        + "[nodes.thermal]\ntype = \"zero\"\neach = \"axis\"\ninputs.truth = \"drift.{axis}\"\nahead = \"0s\"\n\
           [nodes.near]\ntype = \"pick\"\ninputs.signal = \"axi\"\n";
    let expected = [(2, "no key \"set\""), (25, "axi")];
    assert_told("command-line-set-section", &text, &expected);
}

#[test]
fn what_follows_from_a_mistake_is_not_told_beside_it() {
    let text = r#"schema = 1
[sets]
axis = ["X"]
[signals.temperature]
unit = "C"
channels = "axis"
range = ["0 Cel", "50 Cel"]
max_age = "1min"
[modules.pair]
inputs = ["from"]
parameters = { window = "5mn" }
outputs = { slope = "slope" }
nodes.slope = { type = "slope", inputs.signal = "{form}", windows = ["{window}"], cld = 1 }
[nodes.one]
module = "pair"
each = "axis"
inputs.from = "temperature.{axes}"
[outputs]
one = "one"
[[tests]]
name = "a"
on = "a.csv"
expect = [{ of = "one", given_above = 0.5 }]
"#;
    let expected = [
        (7, "which does not convert"),
        (13, "{form}"),
        (17, "{axes}"),
    ];
    assert_told("command-line-follows", text, &expected);
}

#[test]
fn a_file_without_schema_is_looked_through_all_the_same() {
    let text = WRONG.replace("schema = 1\n", "");
    let told = told("command-line-schema", &text);
    assert_eq!(told.len(), 6, "{told:#?}");
    assert!(told[0].1.contains("schema"), "{told:#?}");
}

#[test]
fn a_text_in_place_of_a_list_and_a_port_behind_a_channel_are_shown_as_they_are_written() {
    let text = SOUND.replace("[\"5min\"]", "\"5min\"")
        + "[nodes.thermal]\ntype = \"slope\"\ninputs.signal = \"position.X:slope\"\nwindows = [\"5min\"]\n";
    let scratch = Scratch::new("as-written");
    let graph = scratch.file("wrong.toml", text);
    let told = athermal(&[&"check", &"--format", &"json", &graph])
        .ended(2)
        .json();
    let told = told["diagnostics"].as_array().unwrap().iter();
    let helps: Vec<&str> = told.map(|one| one["help"].as_str().unwrap()).collect();
    let expected = [
        "a list stands in brackets, e.g. [\"5min\"]",
        "a port stands behind the node: `position:slope.X`",
    ];
    assert_eq!(helps, expected);
}

#[test]
fn what_a_misspelt_key_was_meant_for_is_looked_at_under_its_right_name() {
    let text = r#"schema = 1
[signals.temperature]
unit = "Cel"
chanels = ["a", "b"]
column = "{chanel}"
max_ago = "1min"
[modules.pair]
input = ["from"]
require = ["window"]
output = { slope = "slope" }
nodes.slope = { type = "slope", inputs.signal = "{from}", windows = ["{windw}"] }
[nodes.one]
module = "pair"
inputs.from = "temperature.c"
window = "5min"
[nodes.two]
tpye = "delay"
inputs.signal = { form = "temperature.d", maxage = "1min" }
delay = "soon"
[outputs]
shown = { form = "one" }
"#;
    let expected = [
        (4, "chanels"),
        (5, "{chanel}"),
        (6, "max_ago"),
        (8, "input"),
        (9, "require"),
        (10, "output"),
        (11, "{windw}"),
        (14, "no channel that matches `c`"),
        (17, "tpye"),
        (18, "form"),
        (18, "no channel that matches `d`"),
        (18, "maxage"),
        (19, "soon"),
        (21, "form"),
    ];
    assert_told("command-line-misspelt", text, &expected);
}

const ONCE: &str = r#"error[A008]: expected a duration like "5min" for "max_age", found the number 5
 --> wrong.toml:9:78
  |
9 | ... from = "{from}", max_age = 5 }, windws = ["5min"], min_samples = -1 }
  |                                ^ expected a duration like "5min"
  |
  = note: node `one/slope`, and 1 more node
  = help: a duration needs a unit, e.g. "5min"

error[A006]: the node has no key "windws"
 --> wrong.toml:9:83
  |
9 | ...= { from = "{from}", max_age = 5 }, windws = ["5min"], min_samples = -1 }
  |                                        ^^^^^^ unknown key
  |
  = note: node `one/slope`, and 1 more node
  = help: did you mean "windows"?

error[A008]: expected a whole number, 0 or more for "min_samples", found the number -1
 --> wrong.toml:9:116
  |
9 | ...= ["5min"], min_samples = -1 }
  |                              ^^ expected a whole number, 0 or more
  |
  = note: node `one/slope`, and 1 more node
3 errors
"#;

#[test]
fn a_faulty_node_of_a_module_that_is_placed_twice_tells_each_mistake_once() {
    let text = r#"schema = 1
[signals.temperature]
unit = "Cel"
channels = ["a"]
max_age = "1min"
[modules.pair]
inputs = ["from"]
outputs = { slope = "slope" }
nodes.slope = { type = "slope", inputs.signal = { from = "{from}", max_age = 5 }, windws = ["5min"], min_samples = -1 }
[nodes]
one = { module = "pair", inputs.from = "temperature" }
two = { module = "pair", inputs.from = "temperature" }
[outputs]
slopes = ["one", "two"]
"#;
    let scratch = Scratch::new("command-line-twice");
    let graph = scratch.file("wrong.toml", text);
    let told = athermal(&[&"check", &graph]).ended(2).told;
    let told = told.replace(&graph.display().to_string(), "wrong.toml");
    assert_eq!(told, ONCE);
}

#[test]
fn a_file_with_mistakes_of_its_syntax_is_read_no_further_and_all_of_them_are_reported() {
    let text = WRONG.replace("\"nm\"", "nm") + "also = what\n";
    let expected = [(7, "not TOML"), (25, "not TOML")];
    assert_told("command-line-syntax", &text, &expected);
    let text = WRONG.replace("schema = 1\n", "schema = 1\nextends = \"none.toml\"\n");
    assert_told(
        "command-line-no-parent",
        &text,
        &[(2, "there is no such file")],
    );
}

#[test]
fn numbers_that_nothing_holds_are_all_reported() {
    let text = r#"schema = 1
[signals.temperature]
unit = "Cel"
channels = ["a", "b"]
max_age = "1min"
[nodes.gradients]
type = "slope"
inputs.signal = "temperature"
windows = { dynamic_range = "8min", shortest = "4min", steps = 99999999999999999999, harmonics = 4 }
[nodes.sum]
type = "sum"
inputs.signal = "gradients"
weights = [1e999, 1]
[outputs]
predicted = "sum"
"#;
    let expected = [
        (9, "the number 99999999999999999999 is too large"),
        (13, "the number 1e999 is too large"),
    ];
    assert_told("too-large", text, &expected);
}
