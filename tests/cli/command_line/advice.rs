//! Whoever does what a help says is told it no more.

use super::mistakes::{SOUND, assert_told};
use crate::workbench::{Scratch, athermal};

/// A sound graph with a node that nothing reads.
fn idle() -> String {
    let nodes = r#"
[nodes.thermal]
type = "zero"
inputs.truth = "drift.X"
ahead = "0s"
[nodes.idle]
type = "slope"
inputs.signal = "temperature"
windows = ["5min"]
"#;
    SOUND.to_owned() + nodes
}

#[test]
fn a_node_that_nothing_reads_is_deleted_where_it_stands_and_removed_where_it_is_inherited() {
    let scratch = Scratch::new("advice-unused");
    let own = scratch.file("own.toml", idle());
    let told = athermal(&[&"check", &own]).ended(0);
    told.tells(&["name it under `[outputs]`, or delete it"]);
    assert!(!told.told.contains("= false"), "{}", told.told);
    let extends = "schema = 1\nextends = \"own.toml\"\n";
    let child = scratch.file("child.toml", extends);
    let told = athermal(&[&"check", &child]).ended(0);
    told.tells(&["or write `nodes.idle = false` in the file that inherits it"]);
    let child = scratch.file("child.toml", format!("{extends}nodes.idle = false\n"));
    let told = athermal(&[&"check", &child]).ended(0);
    assert!(!told.told.contains("idle"), "{}", told.told);
}

#[test]
fn a_reference_that_ends_with_the_colon_of_a_port_is_refused_with_what_to_write() {
    let text = idle()
        + r#"[nodes.picked]
type = "pick"
inputs.signal = ["temperature:", "temperature:.a", "drift:", "drift:.X", "temperature:raw"]
[[tests]]
name = "a"
inputs = { "temperature:" = { constant = "1 Cel", for = "1min", every = "1s" } }
expect = [{ of = "drift:", given_above = 0.5 }]
"#;
    let scratch = Scratch::new("advice-colon");
    let file = scratch.file("graph.toml", &text);
    athermal(&[&"check", &file]).ended(2).tells(&[
        "no output port of `temperature` stands behind the colon",
        "help: write `temperature`\n",
        "help: write `temperature.a`\n",
        "help: write `drift`, or name a port; its ports are `slope`, ",
        "help: write `drift.X`, or name a port; its ports are `slope`, ",
        "`temperature` has channels and no ports: `temperature.CHANNEL`",
    ]);
    let expected = [
        (29, "no output port of `temperature`"),
        (29, "no output port of `temperature`"),
        (29, "no output port of `drift`"),
        (29, "no output port of `drift`"),
        (29, "`temperature` has no output port `raw`"),
        (32, "no output port of `temperature`"),
        (33, "no output port of `drift`"),
    ];
    assert_told("advice-colons", &text, &expected);
}
