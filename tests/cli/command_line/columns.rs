//! What the program tells fits the 80 columns of a terminal, and every help teaches by examples.

use super::mistakes::SOUND;
use crate::workbench::{Scratch, athermal};

#[track_caller]
fn assert_fits<'a>(lines: impl Iterator<Item = &'a str>) {
    for line in lines {
        assert!(line.chars().count() <= 80, "{line}");
    }
}

/// What a list explains: the first word of each line that is set in by two spaces.
fn listed<'a>(lines: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let named = lines.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    named
        .filter_map(|line| line.split_whitespace().next())
        .collect()
}

#[test]
fn help_has_examples_and_fits_80_columns() {
    let all = athermal(&[&"--help"]).ended(0).out;
    assert_fits(all.lines());
    let below = all.lines().skip_while(|line| *line != "Begin:");
    let commands = listed(below.take_while(|line| *line != "Options:"));
    assert!(commands.len() > 15, "{commands:?}");
    for command in commands.into_iter().filter(|&command| command != "help") {
        let help = athermal(&[&command, &"--help"]).ended(0).out;
        assert_fits(help.lines());
        let taught = help.contains("Example") || help.contains("\nCommands:");
        assert!(taught, "{command} has no example:\n{help}");
        let examples = help.lines().skip_while(|line| !line.starts_with("Example"));
        let mut goes_on = false;
        for line in examples.filter(|line| line.starts_with("  ")) {
            let whole = goes_on || line.contains("athermal");
            assert!(whole, "{command}: an example is broken off before `{line}`");
            goes_on = line.ends_with('\\');
        }
    }
}

#[test]
fn what_fit_and_evaluate_tell_fits_80_columns() {
    let scratch = Scratch::new("command-line-columns");
    let graph = concat!(env!("CARGO_MANIFEST_DIR"), "/graphs/die-tester.toml");
    let (data, model) = (scratch.path("data.csv"), scratch.path("model.json"));
    athermal(&[
        &"simulate",
        &"die-tester",
        &"--days",
        &"0.5",
        &"-o",
        &data,
        &"-q",
    ])
    .ended(0);
    let fit = athermal(&[
        &"fit",
        &graph,
        &"--data",
        &data,
        &"-o",
        &model,
        &"--candidates",
    ]);
    let evaluated = athermal(&[&"evaluate", &model, &"--data", &data]);
    let alone = athermal(&[&"evaluate", &model, &"--data", &data, &"--each-on-its-own"]);
    let expected = [
        (fit, "R²"),
        (evaluated, "persistence"),
        (alone, "on its own "),
    ];
    for (told, holds) in expected.map(|(told, holds)| (told.ended(0), holds)) {
        assert!(told.out.contains(holds), "{}", told.out);
        assert_fits(told.out.lines());
    }
}

#[test]
fn what_is_told_of_node_types_fits_80_columns() {
    let all = athermal(&[&"nodes"]).ended(0).out;
    assert_fits(all.lines());
    let kinds = listed(all.lines());
    assert!(kinds.contains(&"slope") && kinds.len() > 40, "{kinds:?}");
    for kind in kinds {
        let page = athermal(&[&"nodes", &kind]).ended(0).out;
        // A table stays as it is: a formula in it cannot be broken.
        assert_fits(page.lines().filter(|line| !line.starts_with('|')));
    }
}

#[test]
fn a_reference_whose_columns_have_names_that_are_taken_is_one_mistake() {
    let text = SOUND.replace(
        "predicted = \"thermal\"",
        "drift = [\"drift\", \"last\", \"first\"]",
    ) + r#"[nodes.last]
type = "persistence"
each = "axis"
inputs.truth = "drift.{axis}"
ahead = "5min"
[nodes.first]
type = "persistence"
each = "axis"
inputs.truth = "drift.{axis}"
ahead = "5min"
"#;
    let scratch = Scratch::new("command-line-columns-taken");
    let graph = scratch.file("graph.toml", text);
    let told = athermal(&[&"check", &graph]).ended(2).told;
    for part in [
        "there are two output columns named `drift.X`, and one more name comes twice",
        "such as `last = \"last\"`, or refer to fewer channels",
        "2 errors",
    ] {
        assert!(told.contains(part), "{told}");
    }
}
