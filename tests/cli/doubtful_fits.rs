//! Fits that fail, or that are worth little: the program says so, and names the true cause.

use std::fmt::Write as _;

use crate::workbench::{Finished, Graph, Scratch, athermal};

const FEATURES: &str = "inputs.features = \"in\"";

/// A graph in which one node predicts `out.y`, maybe from `in.u` and `in.v`; a row each second.
fn graph(node: &str) -> Graph {
    Graph::new()
        .time("s")
        .with("step = '1s'")
        .signal("in", "V", "u v", "1s")
        .with("column = '{channel}'")
        .signal("out", "nm", "y", "1s")
        .with("column = '{channel}'")
        .section("nodes.m", "inputs.truth = 'out.y'; ahead = '0 samples'")
        .with(node)
        .outputs("p = 'm'")
}

/// Numbers about zero that hang together in no way.
fn noise(row: usize, of: usize) -> f64 {
    let x = (row as f64 * 12.9898 + of as f64 * 78.233).sin() * 43_758.545_3;
    2.0 * (x - x.floor()) - 1.0
}

/// So many rows of `u`, `v` and a truth made from them.
fn data(rows: usize, truth: impl Fn(usize, f64, f64) -> f64) -> String {
    let mut text = String::from("s,u,v,y\n");
    for row in 0..rows {
        let (u, v) = (noise(row, 1), noise(row, 2));
        let _ = writeln!(text, "{row},{u},{v},{}", truth(row, u, v));
    }
    text
}

/// Two features that explain the truth but for a little noise.
fn explained(rows: usize) -> String {
    data(rows, |row, u, v| 3.0 * u - 2.0 * v + 0.1 * noise(row, 3))
}

fn fit(name: &str, node: &str, data: &str, more: &[&str]) -> Finished {
    fit_graph(name, &graph(node), data, more)
}

/// A fit of the graph on the rows, with more arguments; messages and report in one line each.
fn fit_graph(name: &str, graph: &str, data: &str, more: &[&str]) -> Finished {
    let scratch = Scratch::new(&format!("doubtful-{name}"));
    let (graph, data) = (
        scratch.file("graph.toml", graph),
        scratch.file("data.csv", data),
    );
    let model = scratch.path("model.json");
    let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
        vec![&"fit", &graph, &"--data", &data, &"-o", &model];
    arguments.extend(more.iter().map(|more| more as &dyn AsRef<std::ffi::OsStr>));
    let mut finished = athermal(&arguments);
    let unwrapped = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    finished.told = unwrapped(&finished.told);
    finished.out = unwrapped(&finished.out);
    finished
}

#[test]
fn gradients_that_diverge_are_an_error_that_names_the_step_size() {
    let node = |eta0: &str| {
        format!(
            "type = \"linear\"\n{FEATURES}\nsolver = {{ type = \"sgd\", eta0 = {eta0}, epochs = 100 }}"
        )
    };
    let far = fit("diverged", &node("100.0"), &explained(200), &[]).ended(1);
    far.tells(&[
        "m could not be fitted",
        "diverged",
        "`eta0` = 100",
        "a smaller `eta0`",
        "no model is written",
    ]);
    assert!(!far.told.contains("evaluate"), "{}", far.told);
    let near = fit("diverged", &node("0.01"), &explained(200), &[]).ended(0);
    assert!(!near.out.contains("of no use"), "{}", near.out);
}

#[test]
fn a_robust_fit_of_rows_with_outliers_is_of_use() {
    let rows = data(500, |row, u, v| {
        let far = 1000.0 * f64::from(row % 5 == 0);
        3.0 * u - 2.0 * v + noise(row, 3) + far
    });
    let node = format!("type = \"huber\"\n{FEATURES}");
    let told = fit("outliers", &node, &rows, &[]).ended(0).out;
    assert!(told.contains("100 of 500 rows are outliers") && !told.contains("of no use"));
}

#[test]
fn a_fit_that_is_left_with_no_regressor_says_so_and_why() {
    let stays = |row: usize, u: f64| format!("{row},{u},5,{}\n", 3.0 * u + noise(row, 3));
    let rows: String = (0..300).map(|row| stays(row, noise(row, 1))).collect();
    let rows = format!("s,u,v,y\n{rows}");
    let select = |features: &str| {
        format!(
            "type = \"linear\"\ninputs.features = \"{features}\"\nselection = {{ method = \"forward\" }}"
        )
    };
    let none = fit("none-left", &select("in.v"), &rows, &[]).ended(1);
    let some = fit("some-left", &select("in"), &rows, &[]).ended(0);
    let long = "type = \"ar\"\nlags = [\"5000s\"]";
    let no_past = fit("no-past", long, &rows, &[]).ended(1);
    for (told, left) in [(&none.out, false), (&some.out, true), (&no_past.out, false)] {
        let says_none = told.contains("no regressor is left to predict from");
        assert_eq!(says_none, !left, "{told}");
    }
    // What follows the truth has its past to go by.
    let follows = |kind: &str, more: &str| {
        let node = format!("type = \"{kind}\"\ninputs.features = \"in.v\"\n{more}");
        let told = fit("left-past", &node, &rows, &[]);
        const NOTE: &str = "no regressor is left, so it predicts from the past of the truth alone";
        let follows = told.out.contains(NOTE);
        assert_eq!(told.status, i32::from(!follows), "{}", told.out);
        follows
    };
    assert!(follows("armax", "") && !follows("armax", "learn = false"));
    assert!(!follows("oe", "") && !follows("rls", ""));
    for told in [&none.out, &some.out] {
        assert!(told.contains("constant, so without effect: in.v"), "{told}");
    }
}

#[test]
fn what_was_constant_in_the_fit_is_not_missed_by_a_prediction() {
    let rows: String = (0..300)
        .map(|row| (row, noise(row, 1)))
        .map(|(row, u)| format!("{row},{u},5,{}\n", 3.0 * u + noise(row, 3)))
        .collect();
    let scratch = Scratch::new("doubtful-constant");
    let data = scratch.file("data.csv", format!("s,u,v,y\n{rows}"));
    let dead = rows.replace(",5,", ",,");
    let without = scratch.file("dead.csv", format!("s,u,v,y\n{dead}"));
    for kind in [
        "\"linear\"",
        "\"linear\"\nsolver = { type = \"ols\" }",
        "\"linear\"\nsolver = { type = \"sgd\" }",
        "\"huber\"",
        "\"rls\"",
    ] {
        let text = graph(&format!("type = {kind}\n{FEATURES}"));
        let (graph, model) = (
            scratch.file("graph.toml", &text),
            scratch.path("model.json"),
        );
        athermal(&[&"fit", &graph, &"--data", &data, &"-o", &model]).ended(0);
        let run = |data| athermal(&[&"run", &model, &"-i", data]).ended(0).out;
        let (whole, dead) = (run(&data), run(&without));
        assert_eq!(
            whole.lines().filter(|line| !line.ends_with(',')).count(),
            301,
            "{whole}"
        );
        assert_eq!(whole, dead, "{kind}");
    }
}

#[test]
fn orders_stand_with_their_inputs_where_one_is_left_out() {
    let scratch = Scratch::new("doubtful-orders");
    let rows: String = (0..200)
        .map(|row| format!("{row},5,{},{}\n", noise(row, 2), noise(row - row.min(1), 2)))
        .collect();
    let data = scratch.file("data.csv", format!("s,u,v,y\n{rows}"));
    let graph = scratch.file(
        "graph.toml",
        graph(&format!(
            "type = \"armax\"\n{FEATURES}\nnb = [4, 1]\nnk = [3, 1]"
        )),
    );
    let model = scratch.path("model.json");
    athermal(&[&"fit", &graph, &"--data", &data, &"-o", &model]).ended(0);
    let told = athermal(&[&"show", &model, &"--format", &"coefficients"]).ended(0);
    let of_inputs = told
        .out
        .lines()
        .filter(|line| line.trim().starts_with("B "));
    let of_inputs: Vec<&str> = of_inputs.collect();
    assert_eq!(of_inputs.len(), 1, "{}", told.out);
    assert!(of_inputs[0].contains("B in.v q⁻¹ "), "{}", told.out);
}

#[test]
fn a_stack_keeps_a_voter_that_always_says_the_same() {
    let node = format!(
        "type = \"stack\"\ninputs.voters = [\"a\", \"b\"]\n\
         [nodes.a]\ntype = \"linear\"\n{FEATURES}\ninputs.truth = \"out.y\"\nahead = \"0 samples\"\n\
         [nodes.b]\ntype = \"zero\"\ninputs.truth = \"out.y\"\nahead = \"0 samples\""
    );
    let told = fit("stack", &node, &explained(90), &["--format", "json"]).ended(0);
    let told = told.json();
    let fits = told["estimators"].as_array().unwrap();
    let stack = fits.iter().find(|fit| fit["node"] == "m").unwrap();
    assert!(stack["figures"].get("constant").is_none(), "{stack:#}");
    let weights = stack["figures"]["weights"].as_object().unwrap();
    assert_eq!(weights["b.y"], 0.0);
    assert!(weights["a.y"].as_f64().unwrap() > 0.9);
}

#[test]
fn the_square_of_what_is_on_or_off_is_no_term() {
    let scratch = Scratch::new("doubtful-square");
    let row = |row: usize| {
        let (on, v) = (row % 2, noise(row, 2));
        format!("{row},{on},{v},{}\n", 2.0 * on as f64 + 3.0 * v)
    };
    let rows: String = (0..200).map(row).collect();
    let data = scratch.file("data.csv", format!("s,u,v,y\n{rows}"));
    let node = format!(
        "type = \"polynomial\"\n{FEATURES}\nselection = {{ method = \"forward\", by = \"sensor\" }}"
    );
    let graph = scratch.file("graph.toml", graph(&node));
    let model = scratch.path("model.json");
    athermal(&[&"fit", &graph, &"--data", &data, &"-o", &model]).ended(0);
    let told = athermal(&[&"show", &model, &"--format", &"coefficients"]).ended(0);
    assert!(told.out.contains("in.v²"), "{}", told.out);
    assert!(!told.out.contains("in.u²"), "{}", told.out);
}

#[test]
fn a_fit_that_is_worse_than_the_mean_of_its_rows_is_doubted() {
    let node = format!(
        "type = \"linear\"\n{FEATURES}\nsolver = {{ type = \"sgd\", eta0 = 1.2, power = 0.0, epochs = 1 }}"
    );
    let told = fit("worse", &node, &explained(60), &[]).ended(0);
    assert!(
        told.out
            .contains("times that of predicting their mean, so this fit is of no use"),
        "{}",
        told.out
    );
}

#[test]
fn a_single_row_is_not_fitted_by_any_kind() {
    let lags = "lags = [\"1 sample\"]";
    for node in [
        format!("type = \"linear\"\n{FEATURES}"),
        format!("type = \"linear\"\n{FEATURES}\nsolver = {{ type = \"sgd\" }}"),
        format!("type = \"lasso\"\n{FEATURES}\nalpha = 0.1"),
        format!("type = \"huber\"\n{FEATURES}"),
        format!("type = \"rls\"\n{FEATURES}"),
        format!("type = \"polynomial\"\n{FEATURES}"),
        format!("type = \"arx\"\n{FEATURES}\n{lags}"),
        format!("type = \"narx\"\n{FEATURES}\n{lags}"),
        "type = \"arma\"".to_owned(),
        "type = \"kalman\"".to_owned(),
    ] {
        let fit = fit("single", &node, &explained(1), &[]).ended(1);
        fit.tells(&["1 complete row, and at least 2 are needed"]);
    }
}

#[test]
fn orders_that_fit_few_rows_without_error_are_not_ranked() {
    let lags = "lags = [\"1 sample\"]\nfeature_lags = [\"0s\", \"1 sample\"]";
    let node = |orders: &str| format!("type = \"arx\"\n{FEATURES}\n{lags}\norder = {orders}");
    let both = node("{ by = \"aic\", nb = \"1..2\" }");
    let some = fit("ranked", &both, &explained(60), &[]).ended(0).out;
    assert!(
        !some.contains("to be ranked") && some.contains("nb 2"),
        "{some}"
    );
    // Nine rows have a row before them, and the larger order has seven coefficients with a third feature.
    let three = graph(&both).replace("[\"u\", \"v\"]", "[\"u\", \"v\", \"w\"]");
    let mut rows = String::from("s,u,v,y,w\n");
    for (row, line) in explained(10).lines().skip(1).enumerate() {
        let _ = writeln!(rows, "{line},{}", noise(row, 4));
    }
    let few = fit_graph("ranked", &three, &rows, &[]).ended(0).out;
    assert!(
        few.contains("1 of 2 orders have too many coefficients to be ranked on 9 rows"),
        "{few}"
    );
    assert!(
        few.contains("nb 1") && !few.contains("nb 2") && !few.contains("inf"),
        "{few}"
    );
    let none = fit("ranked", &both, &explained(5), &[]).ended(1);
    none.tells(&["5 complete rows, and at least 6 are needed"]);
    let without = node("{ by = \"aic\", na = \"1..1\", nb = \"0..0\" }");
    let without = fit("ranked", &without, &explained(4), &[]).ended(1);
    without.tells(&["none of the lags to compare has a value in enough of the 4 rows"]);
}

#[test]
fn a_model_whose_past_takes_all_rows_says_so() {
    let node = "type = \"arma\"\nna = 50\nnc = 2";
    let fit = fit("past", node, &explained(30), &[]).ended(1);
    fit.tells(&[
        "0 of 30 rows have all the past",
        "at least",
        "smaller orders",
    ]);
}

#[test]
fn a_truth_without_a_value_is_not_blamed_on_the_features() {
    let node = format!("type = \"linear\"\n{FEATURES}");
    let none = data(50, |_, _, _| f64::NAN).replace("NaN", "");
    let fit_none = fit("truth", &node, &none, &[]).ended(1);
    fit_none.tells(&["`out.y` has no value in the data"]);
    assert!(!fit_none.out.contains("left out in."), "{}", fit_none.out);
    let limited = format!("{node}\ntrain.abs_truth = {{ above = \"100 nm\" }}");
    let outside = fit("truth", &limited, &explained(50), &[]).ended(1);
    outside.tells(&["no value within the limits of `train.abs_truth`, and 50 outside"]);
}

#[test]
fn a_truth_that_is_never_whole_names_what_it_lacks() {
    let slope = "type = \"linear\"\ninputs.features = \"in\"\n\
                 [nodes.drift]\ntype = \"slope\"\ninputs.signal = \"out\"\nwindows = [\"100s\"]";
    let text = graph(slope).replace("inputs.truth = \"out.y\"", "inputs.truth = \"drift.y\"");
    let short = fit_graph("whole", &text, &explained(60), &[]).ended(1);
    short.tells(&[
        "`drift.y` has no value in the data, though `out.y` has some: it looks back 100s, and nowhere do they fill that",
    ]);
    let none = data(200, |_, _, _| f64::NAN).replace("NaN", "");
    let none = fit_graph("whole", &text, &none, &[]).ended(1);
    none.tells(&["`drift.y` has no value in the data, since `out.y` has none"]);
}

#[test]
fn sensors_without_a_value_are_named_and_the_truth_is_not_blamed() {
    let without = |channel: usize| {
        let rows = explained(50);
        let mut lines = rows.lines();
        let mut text = format!("{}\n", lines.next().unwrap());
        for line in lines {
            let mut cells: Vec<&str> = line.split(',').collect();
            cells[1] = "";
            cells[channel] = "";
            let _ = writeln!(text, "{}", cells.join(","));
        }
        text
    };
    let node = format!("type = \"linear\"\n{FEATURES}");
    let both = fit("silent", &node, &without(2), &[]).ended(1);
    both.tells(&["m could not be fitted: `in.u`, `in.v` have no value in the data"]);
    assert!(
        !both.told.contains("out.y") && !both.out.contains("too early"),
        "{}{}",
        both.told,
        both.out
    );
    // One of two is left out, and the fit goes on without it; a sum of both has no value without it.
    fit("silent", &node, &without(1), &[]).ended(0);
    let sum = "type = \"linear\"\ninputs.features = \"both\"\n\
               [nodes.both]\ntype = \"sum\"\ninputs.signal = [\"in.u\", \"in.v\"]";
    let of_sum = fit("silent", sum, &without(1), &[]).ended(1);
    of_sum.tells(&["`both.sum` never has a value, since `in.u` has none in the data"]);
    // Where the truth has none either, that is why.
    fit("silent", &node, &without(3), &[])
        .ended(1)
        .tells(&["`out.y` has no value in the data"]);
}

#[test]
fn a_truth_that_never_changes_is_told() {
    const NOTE: &str = "the truth never changes in these rows";
    let node = format!("type = \"linear\"\n{FEATURES}");
    let constant = fit(
        "constant",
        &node,
        &data(50, |_, _, _| 5.0),
        &["--format", "json"],
    )
    .ended(0);
    let constant = constant.json();
    let fitted = &constant["estimators"][0];
    assert_eq!(fitted["figures"]["constant_truth"], 5.0);
    let notes = fitted["notes"].as_array().unwrap();
    assert!(
        notes
            .iter()
            .any(|note| note.as_str().unwrap().starts_with(NOTE)),
        "{notes:?}"
    );
    let once = data(50, |row, _, _| if row == 49 { 5.1 } else { 5.0 });
    let once = fit("constant", &node, &once, &[]).ended(0);
    assert!(!once.out.contains(NOTE), "{}", once.out);
}

#[test]
fn as_many_rows_as_coefficients_are_told() {
    let node = format!("type = \"linear\"\n{FEATURES}");
    let told = "3 rows for 3 coefficients, so the error on these rows says nothing of others";
    let three = fit("exact", &node, &explained(3), &[]).ended(0);
    assert!(three.out.contains(told), "{}", three.out);
    let four = fit("exact", &node, &explained(4), &[]).ended(0);
    assert!(!four.out.contains("says nothing of others"), "{}", four.out);
}

#[test]
fn gradients_on_collinear_features_are_not_said_to_be_solved_by_singular_values() {
    let mut text = String::from("s,u,v,y\n");
    for row in 0..100 {
        let u = noise(row, 1);
        let _ = writeln!(text, "{row},{u},{},{}", 2.0 * u, 3.0 * u + noise(row, 3));
    }
    let node =
        |solver: &str| format!("type = \"linear\"\n{FEATURES}\nsolver = {{ type = \"{solver}\" }}");
    let gradients = fit("collinear", &node("sgd"), &text, &[]).ended(0).out;
    assert!(
        gradients.contains("nearly a combination of the others: in.v"),
        "{gradients}"
    );
    assert!(!gradients.contains("singular values"), "{gradients}");
    let squares = fit("collinear", &node("ols"), &text, &[]).ended(0).out;
    assert!(squares.contains("singular values"), "{squares}");
}

#[test]
fn folds_that_cannot_be_cut_name_their_cause() {
    let node = |folds: &str| {
        format!(
            "type = \"linear\"\n{FEATURES}\nselection = {{ method = \"forward\", folds = {folds} }}"
        )
    };
    let streamed = fit("folds", &node("3"), &explained(120), &["--memory", "0"]).ended(1);
    streamed.tells(&[
        "120 rows cannot be cut into 3 folds",
        "blocks of 256 rows",
        "`--memory`",
    ]);
    let apart = node("{ type = \"blocked\", count = 5, gap_rows = 200, embargo_rows = 300 }");
    let apart = fit("folds", &apart, &explained(300), &[]).ended(1);
    apart.tells(&[
        "of 300 rows none is left to train on",
        "a gap of 200 rows and an embargo of 300",
    ]);
    let few = fit("folds", &node("3"), &explained(2), &[]).ended(1);
    few.tells(&["2 rows cannot be cut into 3 folds; at least two folds and one row in each"]);
    let single = fit("folds", &node("40"), &explained(60), &[]).ended(1);
    single.tells(&[
        "in 40 folds of 60 rows some have one row",
        "at most 20 folds",
    ]);
}

#[test]
fn backwards_the_smallest_set_within_one_standard_error_is_looked_for_beyond_the_tolerance() {
    // Of the two features the second explains so little that folds differ by more, but more than the tolerance.
    let rows = data(60, |row, u, v| {
        3.0 * u + 0.6 * v + (0.2 + 2.0 * row as f64 / 60.0) * noise(row, 3)
    });
    let node = |rule: bool| {
        format!(
            "type = \"linear\"\n{FEATURES}\nselection = {{ method = \"backward\", one_standard_error = {rule} }}"
        )
    };
    let plain = fit("backward", &node(false), &rows, &[]).ended(0).out;
    assert!(plain.contains("no more: − in.v would make it"), "{plain}");
    let ruled = fit("backward", &node(true), &rows, &[]).ended(0).out;
    let told = "the set after the first step is the smallest within one standard error";
    assert!(ruled.contains(told), "{ruled}");
}

#[test]
fn a_selection_in_which_nothing_beats_the_mean_says_so() {
    const NOTE: &str =
        "no choice of regressors that was tried predicts the folds better than their mean";
    let node = |method: &str| {
        format!("type = \"linear\"\n{FEATURES}\nselection = {{ method = \"{method}\" }}")
    };
    for method in ["forward", "backward", "floating"] {
        // The level of the truth is another in each fold, and the features say nothing of it.
        let levels = data(90, |row, _, _| 5.0 * (row / 30) as f64 + noise(row, 3));
        let told = fit("no-better", &node(method), &levels, &["--format", "json"]).ended(0);
        let told = &told.json()["estimators"][0];
        let notes = told["notes"].as_array().unwrap();
        let note_of = |note: &&serde_json::Value| note.as_str().unwrap().starts_with(NOTE);
        assert_eq!(
            notes.iter().filter(note_of).count(),
            1,
            "{method}: {told:#}"
        );
        let best = told["figures"]["best_r2"].as_f64().unwrap();
        assert!(best < 0.0, "{best}");
        let good = fit("no-better", &node(method), &explained(90), &[])
            .ended(0)
            .out;
        assert!(!good.contains(NOTE), "{good}");
    }
}

#[test]
fn f_tests_that_take_nothing_tell_what_they_left() {
    let rows = data(100, |row, _, _| noise(row, 3));
    let node = format!(
        "type = \"linear\"\n{FEATURES}\nselection = {{ method = \"stepwise\", f_enter = 50.0 }}"
    );
    let told = fit("stepwise", &node, &rows, &[]).ended(1).out;
    assert!(told.contains("no more: in."), "{told}");
}

#[test]
fn a_narx_without_a_term_says_that_it_predicts_the_mean() {
    let rows = data(100, |row, _, _| 7.0 + noise(row, 3));
    let node = format!("type = \"narx\"\n{FEATURES}\nlags = [\"1 sample\"]\ntolerance = 0.9");
    let told = fit("narx", &node, &rows, &[]).ended(1).out;
    assert!(
        told.contains("the prediction is the mean of the rows"),
        "{told}"
    );
    assert!(!told.contains("error-reduction"), "{told}");
}

#[test]
fn values_whose_squares_overflow_are_told_with_their_name() {
    let text = explained(200) + "200,1e200,0,0\n" + "201,0,0,0\n";
    for node in [
        "type = \"linear\"",
        "type = \"kalman\"",
        "type = \"state_space\"",
        "type = \"linear\"\nselection = { method = \"forward\" }",
    ] {
        let told = fit("overflow", &format!("{node}\n{FEATURES}"), &text, &[]).ended(1);
        told.tells(&["values of `in.u` are as large as 1e200", "a `range`"]);
    }
    for size in [3e153, 1e160] {
        let rows = data(200, |row, u, v| size * (u + v + noise(row, 3)));
        for kind in ["kalman", "oe", "armax", "huber", "linear"] {
            let node = format!("type = \"{kind}\"\n{FEATURES}");
            let told = fit("overflow", &node, &rows, &[]).ended(1);
            told.tells(&["values of `out.y` are as large as", "a `range`"]);
        }
    }
}

#[test]
fn what_rows_that_do_not_fit_in_memory_change_is_told() {
    let linear = "solver = { type = \"ridge\", alpha = { by = \"cross_validation\", folds = 3 } }";
    let generalised =
        "solver = { type = \"ridge\", alpha = { by = \"generalised_cross_validation\" } }";
    let with = |kind: &str, more: &str| format!("type = \"{kind}\"\n{FEATURES}\n{more}");
    let lags = "lags = [\"1 sample\"]";
    let folds = "so folds end at multiples of 256 rows";
    let scales = "centred and scaled by the first 1 of 1,";
    let rows = explained(1500);
    for (node, told, times) in [
        (with("linear", linear), folds, 1),
        (
            with(
                "linear",
                &format!("{linear}\nselection = {{ method = \"forward\" }}"),
            ),
            folds,
            1,
        ),
        (with("linear", generalised), folds, 0),
        (with("linear", ""), folds, 0),
        (with("polynomial", ""), scales, 1),
        (with("narx", lags), scales, 1),
    ] {
        let streamed = fit("streamed", &node, &rows, &["--memory", "0"]).ended(0);
        assert_eq!(
            streamed.out.matches(told).count(),
            times,
            "{}",
            streamed.out
        );
        let kept = fit("streamed", &node, &rows, &[]).ended(0);
        assert!(!kept.out.contains("did not fit in memory"), "{}", kept.out);
    }
}

#[test]
fn the_scale_of_outliers_is_told_in_any_unit() {
    let node = format!("type = \"huber\"\n{FEATURES}");
    let small = data(60, |row, u, v| {
        1e-9 * (3.0 * u - 2.0 * v + 0.1 * noise(row, 3))
    });
    let small = fit("huber", &node, &small, &[]).ended(0);
    let (_, scale) = small.out.split_once("of the others is about ").unwrap();
    let scale: f64 = scale.split_once(' ').unwrap().0.parse().unwrap();
    assert!(scale > 1e-12 && scale < 1e-9, "{}", small.out);
}
