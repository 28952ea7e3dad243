//! How predictions are scored is told beside the scores, and the horizon that was really scored.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Value, json};

use crate::compare::scored_together;
use crate::workbench::{Finished, Graph, Scratch, athermal, athermal_on};

/// What reads past truths, what follows them, what reads none, and a vote of two.
fn in_modes() -> Graph {
    Graph::named("modes")
        .time("s")
        .signal("x", "K", "u", "2s")
        .with("column = 'u'")
        .signal("y", "nm", "y", "2s")
        .with("column = 'y'")
        .model("own", "ar", "", "y.y", "2s")
        .with("lags = ['0s', '2s']")
        .model("level", "kalman", "x", "y.y", "2s")
        .model("features", "linear", "x", "y.y", "2s")
        .vote("vote", "mean", "own features", "")
        .outputs("vote = 'vote'; level = 'level'")
}

/// A scratch folder with the graph, a log, another, and a model fitted on the first.
fn modes(test: &str) -> (Scratch, PathBuf, [PathBuf; 2], PathBuf) {
    let scratch = Scratch::new(&format!("command-line-{test}"));
    let graph = scratch.file("modes.toml", in_modes());
    let log = |name: &str, from: u32| {
        let (mut text, mut y) = ("s,u,y\n".to_owned(), 0.0);
        for nth in from..from + 400 {
            let t = f64::from(nth);
            let u = (0.2 * t).sin() + (0.07 * t * t).cos();
            y = 0.8 * y + u + 0.3 * (1.3 * t * t).sin();
            writeln!(text, "{},{u:.4},{y:.4}", 2 * nth).unwrap();
        }
        scratch.file(name, text)
    };
    let logs = [log("one.csv", 0), log("two.csv", 400)];
    let model = scratch.path("model.json");
    athermal(&[&"fit", &graph, &"--data", &logs[0], &"-o", &model, &"-q"]).ended(0);
    (scratch, graph, logs, model)
}

fn with(command: &[&dyn AsRef<OsStr>], more: &[&str]) -> Finished {
    let mut all = command.to_vec();
    all.extend(more.iter().map(|of| of as &dyn AsRef<OsStr>));
    athermal(&all).ended(0)
}

#[test]
fn how_predictions_are_scored_is_told_beside_the_scores() {
    let (_scratch, graph, [one, two], model) = modes("scored");
    let evaluate: [&dyn AsRef<OsStr>; 4] = [&"evaluate", &model, &"--data", &two];
    let compare: [&dyn AsRef<OsStr>; 6] = [&"compare", &graph, &"--data", &one, &"--on", &two];
    let asked = ["--abs-truth-below", "6 nm", "--frozen"];
    for command in [&evaluate[..], &compare[..]] {
        let plain = with(command, &["--format", "json"]).json();
        let given = ["mode", "steps", "abs_truth_below", "frozen"].map(|key| plain[key].clone());
        let usual = [json!("one-step"), Value::Null, Value::Null, json!(false)];
        assert_eq!(given, usual);
        let facts = with(command, &[&asked[..], &["--format", "json"]].concat()).json();
        assert_eq!(
            (&facts["abs_truth_below"], &facts["frozen"]),
            (&json!("6 nm"), &json!(true))
        );
        let told = with(command, &asked).out;
        assert!(
            told.starts_with(
                "only truths whose absolute value is below 6 nm count\nno estimator learns on the way\n\n"
            ),
            "{told}"
        );
        let told = with(command, &[]).out;
        assert!(
            !told.contains("count\n") && !told.contains("learns"),
            "{told}"
        );
    }
    let own = with(&evaluate, &["--each-on-its-own", "--format", "json"]);
    assert_eq!(own.json()["each_on_its_own"], true);
    let facts = with(&compare, &["--format", "json"]).json();
    let named = |path: &PathBuf| json!([path.display().to_string()]);
    assert_eq!((&facts["data"], &facts["on"]), (&named(&one), &named(&two)));
}

#[test]
fn several_steps_ahead_the_horizon_that_was_scored_is_told() {
    let (_scratch, _, [_, two], model) = modes("horizon");
    let evaluate: [&dyn AsRef<OsStr>; 4] = [&"evaluate", &model, &"--data", &two];
    let horizons = |mode: &[&str]| {
        let told = with(&evaluate, &[mode, &["--format", "json"]].concat()).json();
        let scores = told["scores"].as_array().unwrap().clone();
        assert!(scores.iter().all(|of| of["ahead_s"] == 2.0));
        ["own", "level", "features", "vote"].map(|node| {
            let score = scores.iter().find(|of| of["node"] == node).unwrap();
            score["horizon_s"].as_f64()
        })
    };
    assert_eq!(horizons(&[]), [Some(2.0); 4]);
    // A step is two seconds, of what may read the truth of now and predicts the next.
    let ten = ["--mode", "k-step", "--steps", "10"];
    let reached = Some(20.0);
    assert_eq!(horizons(&ten), [reached, reached, Some(2.0), reached]);
    let free = ["--mode", "free-run"];
    assert_eq!(horizons(&free), [None, None, Some(2.0), None]);
    let ahead = |mode: &[&str], node: &str| {
        let told = with(&evaluate, mode).out;
        let mut lines = told.lines();
        let line = lines.find(|line| line.trim_start().starts_with(node));
        let cells = line.unwrap_or_else(|| panic!("{told}")).split_whitespace();
        cells.map(str::to_owned).nth(1).unwrap()
    };
    assert_eq!(ahead(&ten, "own"), "20s");
    assert_eq!(ahead(&ten, "features"), "2s");
    assert_eq!(ahead(&free, "own"), "free");
}

#[test]
fn graphs_are_compared_in_the_mode_that_is_asked_for() {
    let (scratch, graph, [one, two], model) = modes("compared");
    let together = scored_together(&scratch, &graph, &["vote", "level"], "y.y");
    athermal(&[&"fit", &together, &"--data", &one, &"-o", &model, &"-q"]).ended(0);
    let compare: [&dyn AsRef<OsStr>; 6] = [&"compare", &graph, &"--data", &one, &"--on", &two];
    let evaluate: [&dyn AsRef<OsStr>; 4] = [&"evaluate", &model, &"--data", &two];
    let mut before = Vec::new();
    for mode in [
        &["--mode", "one-step"][..],
        &["--mode", "k-step", "--steps", "3"],
        &["--mode", "free-run"],
    ] {
        let all = [mode, &["--format", "json"]].concat();
        let compared = with(&compare, &all).json();
        let scores = with(&evaluate, &all).json()["scores"].clone();
        assert_eq!(compared["mode"], mode[1]);
        let table = &compared["comparisons"][0];
        let rows = table["rows"].as_array().unwrap();
        assert_eq!(rows.len(), 4);
        let mut errors = Vec::new();
        for row in rows {
            let mut scores = scores.as_array().unwrap().iter();
            let score = scores.find(|of| of["node"] == row["node"]).unwrap();
            let (here, there) = (row["rmse"][0].as_f64().unwrap(), score["rmse"].as_f64());
            assert!((here / there.unwrap() - 1.0).abs() < 1e-12, "{row} {score}");
            let persistence = &table["truths"][0]["persistence"];
            assert_eq!(persistence.is_null(), score["persistence"].is_null());
            errors.push(here);
        }
        assert_ne!(errors, before, "the mode changes nothing");
        before = errors;
    }
    let told = with(&compare, &["--mode", "free-run"]).out;
    assert!(told.starts_with("free run: no measured truth"), "{told}");
    assert!(
        told.lines().all(|line| line.chars().count() <= 80),
        "{told}"
    );
    athermal(&[
        &compare[0],
        &graph,
        &"--data",
        &one,
        &"--on",
        &two,
        &"--steps",
        &"3",
    ])
    .ended(2)
    .tells(&["--mode k-step"]);
}

#[test]
fn persistence_that_is_there_at_a_few_of_the_instants_is_told_with_their_number() {
    let scratch = Scratch::new("few-persistent");
    let graph = scratch.file(
        "bursts.toml",
        r#"schema = 1
signals.position = { unit = "nm", channels = ["z"], max_age = "3min" }
nodes.drift = { type = "slope", inputs.signal = "position", windows = ["5min"], unit = "nm/min" }
nodes.nothing = { type = "zero", inputs.truth = "drift", ahead = "5min" }
outputs.nothing = "nothing"
"#,
    );
    // Eight minutes of positions in each hour.
    let burst = |minute: &i32| minute % 60 < 9;
    let position = |minute: i32| f64::from(minute * minute % 97);
    let lines = (0..3000).filter(burst);
    let lines = lines.map(|minute| format!("{},{}\n", 60 * minute, position(minute)));
    let data = scratch.file(
        "bursts.csv",
        format!("time_s,z\n{}", lines.collect::<String>()),
    );
    let told = athermal_on("evaluate", &graph, &data, &[]).ended(0);
    let json = athermal_on("evaluate", &graph, &data, &[&"--format", &"json"]).ended(0);
    let score = &json.json()["scores"][0];
    let (n, few) = (&score["n"], &score["persistence_n"]);
    assert!(
        few.as_u64() > Some(0) && few.as_u64() < n.as_u64().map(|n| n / 2),
        "{score}"
    );
    assert!(
        told.out.contains(&format!(" on {few} of them,")),
        "{}",
        told.out
    );
    let compared = athermal(&[
        &"compare",
        &graph,
        &"--data",
        &data,
        &"--on",
        &data,
        &"--format",
        &"json",
    ]);
    let column = &compared.ended(0).json()["comparisons"][0]["truths"][0];
    assert_eq!((&column["n"], &column["persistence_n"]), (n, few));
}
