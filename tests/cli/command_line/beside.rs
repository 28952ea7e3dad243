//! A mistake hides none that stands beside it in the same table.

use super::mistakes::{SOUND, assert_told};

const SIGNALS: &str = r#"schema = 1
[signals.t]
unit = "Cel"
channels = ["a", "b"]
[signals.u]
unit = "K"
channels = ["c"]
[signals.p]
unit = "nm"
channels = ["X"]
max_age = "1min"
[outputs]
t = "t"
u = "u"
p = "p"
"#;

fn told(name: &str, nodes: &str, expected: &[(u64, &str)]) {
    let name = format!("command-line-beside-{name}");
    assert_told(&name, &(SIGNALS.to_owned() + nodes), expected);
}

#[test]
fn each_signal_that_says_no_age_is_told_at_an_input() {
    let sum = r#"[nodes.both]
type = "sum"
inputs.signal = ["t.a", "t.b", "u.c"]
"#;
    told("ages", sum, &[(18, "`t.a` counts"), (18, "`u.c` counts")]);
    let linear = r#"[nodes.warm]
type = "linear"
inputs.features = "t"
inputs.truth = "u.c"
ahead = "0s"
"#;
    let expected = [(18, "`t.a` counts"), (19, "`u.c` counts")];
    told("features-and-truth", linear, &expected);
}

#[test]
fn of_a_node_with_an_unknown_key_the_references_are_looked_up_and_no_more() {
    let linear = r#"[nodes.warm]
type = "linear"
strange = 1
inputs.features = ["t", "tt"]
inputs.truth = "p.Y"
train.abs_truth = { below = "3 K" }
"#;
    let expected = [
        (18, "strange"),
        (19, "no node or signal `tt`"),
        (20, "no channel that matches `Y`"),
    ];
    told("unknown-key", linear, &expected);
    let vote = r#"[nodes.vote]
type = "mean"
strange = 1
inputs.voters = ["p.X", "u.c"]
"#;
    told("unknown-key-of-a-vote", vote, &[(18, "strange")]);
}

#[test]
fn what_an_unknown_key_may_be_meant_for_is_not_told_to_be_missing() {
    let linear = r#"[nodes.warm]
type = "linear"
inputs.features = "p"
inputs.truth = "p.X"
aheda = "5min"
"#;
    told("meant", linear, &[(20, "aheda")]);
    let aged = r#"[nodes.sum]
type = "sum"
inputs.signal = { from = "u", max_aeg = "1min" }
"#;
    told("meant-age", aged, &[(18, "max_aeg")]);
}

#[test]
fn a_mistake_in_a_part_of_a_test_hides_none_beside_it() {
    let test = r#"heat = "temperature"
[nodes.thermal]
type = "zero"
inputs.truth = "drift.X"
ahead = "0s"
[[tests]]
name = "a"
fit = { simulate = "die-testr", days = -1, sed = 3 }
inputs = { "temperature.a" = { strt = 1, ramp = "1 nm/s", noise = "-1 K" } }
faults = [{ channel = "temperature.plate9", kind = "missin", for = "-1s" }]
expect = [{ of = "drift.X", beats = ["drift.X", 5], with = 3 }, { of = "drft", rmse_below = "-1 nm" }]
"#;
    let expected = [
        (25, "sed"),
        (26, "every"),
        (26, "strt"),
        (27, "missin"),
        (28, "the number 5"),
        (28, "with"),
        (28, "drft"),
        (28, "`rmse_below` is -1 nm"),
    ];
    let text = SOUND.to_owned() + test;
    assert_told("command-line-beside-tests", &text, &expected);
}
