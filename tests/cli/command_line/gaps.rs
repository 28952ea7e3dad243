//! Inputs under wrong names, and the sections of a running machine.

use super::mistakes::{SOUND, assert_told};
use crate::workbench::{Scratch, athermal};

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
"#;
    let expected = [
        (18, "a graph file has no key \"source\""),
        (21, "expected a table for \"file\""),
        (22, "\"a b\" cannot be the name of a sink"),
    ];
    assert_told("command-line-deployment", &text, &expected);
    let (graph, _) = text.split_once("[source]").unwrap();
    let text = format!("{graph}[runtime]\nheartbeat = 1\nhartbeat = \"1s\"\n");
    let unused = (4, "no output depends on the signal");
    let expected = [
        unused,
        (19, "expected a duration"),
        (20, "no key \"hartbeat\""),
    ];
    assert_told("command-line-runtime", &text, &expected);
    let text = text.replace("heartbeat = 1\nhartbeat = \"1s\"", "heartbeat = \"0s\"");
    assert_told(
        "command-line-heartbeat",
        &text,
        &[unused, (19, "greater than 0")],
    );
    let text = "schema = 1\nsources = \"a.csv\"\nruntime = 3\nmodel = 4\n";
    let expected = [
        (2, "expected a table for \"sources\""),
        (3, "expected a table for \"runtime\""),
        (4, "expected a text in quotes for \"model\""),
    ];
    assert_told("command-line-sections", text, &expected);
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
        (29, "`conformal` has no input `voters`"),
        (30, "`conformal` has no input `others`"),
    ];
    assert_told("command-line-other-input", &text, &expected);
    let scratch = Scratch::new("command-line-other-input-help");
    let graph = scratch.file("wrong.toml", text);
    let told = athermal(&[&"check", &graph]).ended(2).told;
    assert!(told.contains("did you mean `prediction`?"), "{told}");
}
