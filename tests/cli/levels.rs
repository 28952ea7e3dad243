//! Truths that are levels, numbers that differ late, and fits after which nothing is left to predict from.

use crate::workbench::{Graph, Scratch, athermal, athermal_on, case};

#[test]
fn no_model_of_a_position_is_its_mean_over_the_fit() {
    let Some(case) = case("nights-of-a-telescope") else {
        return;
    };
    let scratch = Scratch::new("level");
    let (graph, data) = (case.join("level.toml"), case.join("focus.csv"));
    let model = scratch.path("l.json");
    athermal_on("fit", &graph, &data, &[&"-o", &model]).ended(0);
    let scores = athermal_on("evaluate", &model, &data, &[&"--format", &"json"]).ended(0);
    let score = &scores.json()["scores"][0];
    // The case has them of numpy: the spread is 69.6, R² 0.920.
    let of = |key: &str| score[key].as_f64().unwrap();
    assert!((of("baseline_zero") - 69.6).abs() < 0.05, "{score}");
    assert!((of("r2_zero") - 0.920).abs() < 5e-4, "{score}");
    assert!((of("no_model") - 12_083.7).abs() < 0.1, "{score}");
    let table = athermal_on("evaluate", &model, &data, &[]).ended(0).out;
    assert!(
        table.contains("no model (the mean of the fit) 69.6"),
        "{table}"
    );
    let report = scratch.path("l.html");
    let told = athermal_on("report", &model, &data, &[&"-o", &report])
        .ended(0)
        .out;
    let told = told.split_whitespace().collect::<Vec<_>>().join(" ");
    let verdict =
        "the departure from the mean of the fit of 69.6 1 RMS to 19.7, 72 % less than no model";
    assert!(told.contains(verdict), "{told}");
    let compared = athermal_on("compare", &graph, &data, &[&"--on", &data])
        .ended(0)
        .out;
    assert!(
        compared.contains("no model (the mean of the fit)"),
        "{compared}"
    );
}

#[test]
fn the_mean_is_that_of_the_fit_and_not_of_what_is_scored() {
    let scratch = Scratch::new("level-apart");
    let graph = Graph::new()
        .signal("temperature", "Cel", "a", "1min")
        .signal("height", "um", "Z", "1min")
        .model("level", "linear", "temperature", "height.Z", "0s")
        .outputs("level = 'level'");
    let graph = scratch.file("g.toml", graph);
    let rows = |from: i32| {
        let row = |i: i32| format!("{},{},{}\n", 10 * i, from + i % 7, 1000 + from + i % 7);
        let rows: String = (0..140).map(row).collect();
        format!("time_s,a,Z\n{rows}")
    };
    let (fit, other) = (
        scratch.file("fit.csv", rows(0)),
        scratch.file("other.csv", rows(20)),
    );
    let model = scratch.path("m.json");
    athermal_on("fit", &graph, &fit, &[&"-o", &model]).ended(0);
    let scores = athermal_on("evaluate", &model, &other, &[&"--format", &"json"]).ended(0);
    let score = &scores.json()["scores"][0];
    // 0 to 6, evenly: their mean is 3, their variance 4, and the others lie 20 above.
    assert_eq!(score["no_model"], 1003.0);
    let expected = f64::sqrt(20.0 * 20.0 + 4.0);
    assert!((score["baseline_zero"].as_f64().unwrap() - expected).abs() < 1e-9);
}

#[test]
fn numbers_that_a_warning_compares_have_the_digits_that_tell_them_apart() {
    let Some(case) = case("equal-numbers-in-a-warning") else {
        return;
    };
    let scratch = Scratch::new("apart");
    let model = scratch.path("m.json");
    let graph = case.join("graph.toml");
    athermal_on("fit", &graph, &case.join("fit.csv"), &[&"-o", &model]).ended(0);
    athermal_on("evaluate", &model, &case.join("later.csv"), &[])
        .ended(0)
        .tells(&["between 6.63722 and 6.63724, and was between 6.63882 and 6.63884"]);
}

/// Windows of which some are longer than any night.
const LONG: &str = "{ dynamic_range = \"4h\", shortest = \"7941s\", steps = 4, harmonics = 4 }";

/// A focus from slopes over these windows, by one voter or by two.
fn windows(nodes: &[(&str, &str)]) -> String {
    let voters: Vec<String> = nodes
        .iter()
        .map(|(name, _)| format!("\"{name}\""))
        .collect();
    let each = nodes.iter().map(|(name, window)| {
        format!(
            "[nodes.slope-{name}]\ntype = \"slope\"\ninputs.signal = \"temperature\"\nwindows = {window}\n\
             [nodes.{name}]\ntype = \"linear\"\ninputs.features = \"slope-{name}\"\ninputs.truth = \"drift.focus\"\nahead = \"4h\"\n\
             selection = {{ method = \"forward\", folds = 3, tolerance = 1e-6 }}\n"
        )
    });
    format!(
        "schema = 1\n[time]\ncolumn = \"timestamp\"\nunit = \"rfc3339\"\n\
         [signals.temperature]\nunit = \"Cel\"\nchannels = [\"ambient\"]\ncolumn = \"{{channel}}_degC\"\nmax_age = \"2h\"\n\
         [signals.focus]\nunit = \"1\"\nchannels = [\"focus\"]\ncolumn = \"{{channel}}_steps\"\nmax_age = \"2h\"\n\
         [nodes.drift]\ntype = \"slope\"\ninputs.signal = \"focus\"\nwindows = [\"4h\"]\n{}\
         [nodes.vote]\ntype = \"mean\"\ninputs.voters = [{}]\n[outputs]\npredicted = \"vote\"\n",
        each.collect::<String>(),
        voters.join(", ")
    )
}

#[test]
fn a_fit_that_leaves_an_output_nothing_to_predict_from_ends_with_1_and_names_it_first() {
    let Some(case) = case("nights-of-a-telescope") else {
        return;
    };
    let scratch = Scratch::new("bare");
    let fit = |name: &str, nodes: &[(&str, &str)]| {
        let graph = scratch.file(name, windows(nodes));
        let model = scratch.path("m.json");
        let _ = std::fs::remove_file(&model);
        let words: [&dyn AsRef<std::ffi::OsStr>; 6] = [
            &"fit",
            &graph,
            &"--data",
            &case.join("focus.csv"),
            &"-o",
            &model,
        ];
        let fitted = athermal(&words);
        assert!(model.is_file(), "{}", fitted.told);
        fitted
    };
    let none = fit("none.toml", &[("long", LONG), ("longer", LONG)]).ended(1);
    let first = none.told.lines().next().unwrap();
    assert!(
        first.contains("predicted.focus: predicts a constant"),
        "{}",
        none.told
    );
    assert!(first.contains("between gaps"), "{}", none.told);
    let some = fit("some.toml", &[("long", LONG), ("short", "[\"2h\"]")]).ended(0);
    let first = some.told.lines().next().unwrap();
    assert!(
        first.contains("predicted.focus: long predicts a constant"),
        "{}",
        some.told
    );
    let all = fit("all.toml", &[("short", "[\"2h\"]"), ("other", "[\"3h\"]")]).ended(0);
    assert!(!all.told.contains("constant"), "{}", all.told);
}
