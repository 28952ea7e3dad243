//! What cannot be read hides no other mistake of its file, and none is told that may only follow from it.

use super::mistakes::{SOUND, assert_told};
use crate::workbench::{Scratch, athermal};

#[test]
fn a_file_that_extends_a_missing_one_has_its_own_mistakes_told_and_none_that_the_other_may_mend() {
    let text = r#"schema = 1
extends = "missing.toml"
naem = "machine"
[signals.extra]
unit = "C/parsec"
channels = ["a"]
[nodes.thermal]
ahead = "soon"
each = "axis"
inputs.truth = "drift.{axis}"
[nodes.gradients]
type = "slope"
inputs.signal = "tempreature"
inputs.other = "extra"
windws = ["5min"]
min_coverage = 3.0
[nodes.vote]
type = "auto_weighted"
power = 99
shrinkage = 0.5
weights = "as_printed_rw"
[nodes]
inherited = false
[nodes.fast]
type = "slpe"
[nodes.gone]
module = "pair"
window = "5min"
[outputs]
vote = "vote"
extra = { form = "extra" }
reason = "watch:reason.{axis}"
[[tests]]
name = "a"
expect = [{ of = "vote.Z1", given_above = 0.5, rmse_belw = "1 nm" }]
"#;
    let expected = [
        (2, "there is no such file"),
        (3, "no key \"naem\""),
        (5, "parsec"),
        (14, "no input `other`"),
        (15, "no key \"windws\""),
        (16, "`min_coverage` is 3"),
        (19, "`power` is 99"),
        (21, "as_printed_rw"),
        (25, "slpe"),
        (31, "no key \"form\""),
        (32, "\"{axis}\" stands for nothing"),
        (33, "nothing to run over"),
        (35, "no key \"rmse_belw\""),
    ];
    assert_told("command-line-no-parent", text, &expected);
}

#[test]
fn a_mistake_of_the_syntax_hides_no_other_and_costs_only_what_it_touches() {
    let text = SOUND.replace("[\"5min\"]", "[5min]")
        + r#"[nodes.thermal]
type = "linear"
each = "axis"
inputs.features = ["temperatur", "temperature"]
inputs.truth = "drift.{axis}"
seletion = 3
[nodes.other]
type = "slope"
inputs.signal = "position.Z"
"#;
    let expected = [
        (15, "this is not TOML"),
        (21, "temperatur"),
        (23, "seletion"),
        (24, "windows"),
        (26, "no channel that matches `Z`"),
    ];
    assert_told("command-line-syntax", &text, &expected);
}

#[test]
fn names_that_a_mistake_of_the_syntax_costs_are_not_missed() {
    let text = r#"schema = 1
[sets]
axis = [X, "Y"]
[signals.temperature
unit = "Cel"
channels = ["a"]
[signals.position]
unit = "nm"
channels = "axis"
max_age = "1min"
[nodes]
drift = { type = "slope", inputs.signal = "position", windows = ["5min] }
[nodes.thermal]
type = "linear"
each = "axis"
inputs.features = ["temperature", "tmperature"]
inputs.truth = "drift.{axis}"
ahead = 5
[outputs]
predicted = ["thermal", "drift", "termal"]
"#;
    let expected = [
        (3, "this is not TOML"),
        (4, "this is not TOML"),
        (12, "this is not TOML"),
        (16, "`tmperature`"),
        (18, "ahead"),
        (20, "`termal`"),
    ];
    assert_told("command-line-lost-names", text, &expected);
}

#[test]
fn a_list_that_is_not_closed_does_not_swallow_what_follows() {
    let text = SOUND.replace("windows = [\"5min\"]", "windows = [\"5min\"")
        + "[nodes.thermal]\ntype = \"zero\"\ninputs.truth = \"drift\"\nahed = \"5min\"\n";
    let scratch = Scratch::new("command-line-unclosed");
    let graph = scratch.file("wrong.toml", text);
    let told = athermal(&[&"check", &graph]).ended(2).told;
    assert!(told.contains("no key \"ahed\""), "{told}");
    assert!(told.contains("unclosed array"), "{told}");
    assert!(told.ends_with("2 errors\n"), "{told}");
}

#[test]
fn inputs_under_a_misspelt_key_or_among_the_parameters_are_one_mistake_that_says_where_they_belong()
{
    let text = SOUND.to_owned()
        + r#"[nodes.thermal]
type = "slope"
input.signal = "temperature"
windows = ["5min"]
[nodes.both]
type = "linear"
feature = "temperature"
truth = "drift.X"
ahead = "5min"
[nodes.filtered]
type = "state_space"
inputs = { features = "temperature", truth = "drift.X" }
ahead = "5min"
states = 2
stats = 2
"#;
    let expected = [
        (20, "no key \"input\""),
        (24, "no key \"feature\""),
        (25, "no key \"truth\""),
        (32, "no key \"stats\""),
    ];
    assert_told("command-line-input", &text, &expected);
    let scratch = Scratch::new("command-line-input-help");
    let graph = scratch.file("wrong.toml", text);
    let told = athermal(&[&"check", &graph]).ended(2).told;
    assert!(told.contains("did you mean \"inputs\"?"), "{told}");
    for port in ["features", "truth"] {
        let help = format!("`{port}` is an input: write `inputs.{port} = …`");
        assert!(told.contains(&help), "{told}");
    }
}

#[test]
fn the_sections_of_a_running_machine_are_checked() {
    let text = SOUND.replace("[outputs]\npredicted = \"thermal\"\n", "")
        + r#"[outputs]
predicted = "drift"
[source]
path = "/dev/ttyUSB0"
[sinks]
file = "out.csv"
"a b" = { path = "out.csv" }
[runtime]
heartbeat = 1
hartbeat = "1s"
"#;
    let expected = [
        (21, "expected a table for \"file\""),
        (22, "\"a b\" cannot be the name of a sink"),
        (24, "expected a duration"),
        (25, "no key \"hartbeat\""),
    ];
    assert_told("command-line-deployment", &text, &expected);
    let text = text.replace("heartbeat = 1\nhartbeat = \"1s\"", "heartbeat = \"0s\"");
    let expected = [&expected[..2], &[(24, "longer than 0")]].concat();
    assert_told("command-line-heartbeat", &text, &expected);
    let text = "schema = 1\nsource = \"a.csv\"\nruntime = 3\nmodel = 4\n";
    let expected = [
        (2, "expected a table for \"source\""),
        (3, "expected a table for \"runtime\""),
        (4, "expected a text in quotes for \"model\""),
    ];
    assert_told("command-line-sections", text, &expected);
}

#[test]
fn a_mistake_that_rests_on_a_key_that_cannot_be_read_is_not_told_and_one_that_only_uses_its_word_is()
 {
    let text = SOUND.to_owned()
        + r#"[nodes.thermal]
type = "arx"
inputs.features = "temperature"
inputs.truth = "drift.X"
ahead = "5min"
lags = ["5min", 10]
order = { na = "1..9" }
[nodes.motion]
type = "narx"
inputs.features = "temperature"
inputs.truth = "drift.X"
ahead = "5min"
lags = ["5min"]
tolerance = 1.5
and = 3
"#;
    let expected = [
        (23, "expected a duration"),
        (31, "`tolerance` is 1.5"),
        (32, "no key \"and\""),
    ];
    assert_told("command-line-rests-on", &text, &expected);
}

#[test]
fn an_input_of_another_name_in_the_place_of_the_one_that_is_missing_is_one_mistake() {
    let text = SOUND.to_owned()
        + r#"[nodes.thermal]
type = "zero"
inputs.truth = "drift.X"
ahead = "0s"
[nodes.sure]
type = "conformal"
inputs.voters = "thermal"
inputs.truth = "drift.X"
memory = "1h"
[nodes.none]
type = "conformal"
inputs.voters = "thermal"
inputs.others = "thermal"
inputs.truth = "drift.X"
memory = "1h"
"#;
    let expected = [
        (24, "`conformal` has no input `voters`"),
        (27, "`conformal` needs the input `prediction`"),
        (29, "`conformal` has no input `voters`"),
        (30, "`conformal` has no input `others`"),
    ];
    assert_told("command-line-other-input", &text, &expected);
    let scratch = Scratch::new("command-line-other-input-help");
    let graph = scratch.file("wrong.toml", text);
    let told = athermal(&[&"check", &graph]).ended(2).told;
    assert!(told.contains("did you mean `prediction`?"), "{told}");
}
