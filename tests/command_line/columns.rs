//! What the program tells fits the 80 columns of a terminal, and every help teaches by examples.

use crate::workbench::{Scratch, athermal};

#[test]
fn help_has_examples_and_fits_80_columns() {
    let fits = |help: &str, of: &str| {
        for line in help.lines() {
            assert!(line.chars().count() <= 80, "{of}: {line}");
        }
    };
    let all = athermal(&[&"--help"]).ended(0).out;
    fits(&all, "athermal");
    let listed = all.lines().skip_while(|line| *line != "Commands:").skip(1);
    let listed = listed.take_while(|line| !line.is_empty());
    let named = listed.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let commands: Vec<_> = named
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(commands.len() > 15, "{commands:?}");
    for command in commands.into_iter().filter(|&command| command != "help") {
        let help = athermal(&[&command, &"--help"]).ended(0).out;
        fits(&help, command);
        let taught = help.contains("Example") || help.contains("\nCommands:");
        assert!(taught, "{command} has no example:\n{help}");
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
    for (told, holds) in [(fit.ended(0), "R²"), (evaluated.ended(0), "persistence")] {
        assert!(told.out.contains(holds), "{}", told.out);
        for line in told.out.lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }
}

#[test]
fn what_is_told_of_node_types_fits_80_columns() {
    let listed = athermal(&[&"nodes"]).ended(0).out;
    let kinds = listed
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let kinds: Vec<_> = kinds
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(kinds.contains(&"slope") && kinds.len() > 40, "{kinds:?}");
    let told = kinds
        .iter()
        .map(|kind| athermal(&[&"nodes", kind]).ended(0).out);
    for page in std::iter::once(listed.clone()).chain(told) {
        // A table stays as it is: a formula in it cannot be broken.
        for line in page.lines().filter(|line| !line.starts_with('|')) {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }
}
