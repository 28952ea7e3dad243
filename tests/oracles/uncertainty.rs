//! Predictions tell how sure they are: deviations by theory, carried by votes, and intervals that hold as often as they say.
//!
//! Decides within which tolerance a share of truths has to be covered on the recorded machines.

use std::path::Path;
use std::sync::Arc;

use crate::workbench::{Bench, Graph, Read, Scratch, athermal, data, plan, problems, secs, slot};
use athermal::core::compile::{Plan, Wanted};
use athermal::core::node::Predictor;
use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::Table;
use athermal::run::score::{Score, ScoreOptions, score};
use athermal::{Engine, Instant};

/// The plan of a graph that gives all intervals it can.
fn telling(text: &str) -> Arc<Plan> {
    let wanted = Wanted {
        intervals: true,
        ..Wanted::default()
    };
    let mut read = Read::wanting(text, wanted);
    let plan = read.plan.take();
    Arc::new(plan.unwrap_or_else(|| panic!("{}", read.told())))
}

/// A machine's virtual sensor, with followers of the level beside it and intervals about all.
fn graph(extends: &str) -> Graph {
    Graph::extending(extends)
        .model("level", "kalman", "gradients", "drift.{axis}", "0s")
        .with("each = 'axis'")
        .section("nodes.safe", "type = 'conformal'")
        .with("each = 'axis'; inputs.prediction = 'vote.{axis}'")
        .with("inputs.truth = 'drift.{axis}'; memory = '1d'")
        .section("nodes.safe_level", "type = 'conformal'; each = 'axis'")
        .with("inputs.prediction = 'level.{axis}'; inputs.truth = 'drift.{axis}'")
        .with("memory = '1d'; coverage = 0.8")
        .outputs("predicted = 'vote'; level = 'level'; safe = 'safe'; safe_level = 'safe_level'")
}

fn scored(text: &str, folder: &Path) -> Vec<Score> {
    let plan = telling(text);
    let recording = |file: &str| Dataset::new(vec![folder.join(file)], Options::default());
    let train = recording("train.csv");
    let (fitted, _) = fit(&plan, &train, &FitOptions::default(), &mut |_| {}).unwrap();
    let options = ScoreOptions {
        abs_truth_below: Some("250 nm/min".parse().unwrap()),
        ..ScoreOptions::default()
    };
    let test = recording("test.csv");
    score(&plan, &fitted, &test, &options, &mut |_| {})
        .unwrap()
        .scores
}

#[test]
fn conformal_intervals_cover_what_they_state_on_both_machines() {
    let Some(data) = data() else { return };
    for (machine, sensor) in [
        ("die-tester", "die-tester-sensor.toml"),
        ("linear-axis", "linear-axis-sensor.toml"),
    ] {
        let text = graph(sensor);
        let scores = scored(&text, &data.join(machine));
        let mut compared = 0;
        for score in &scores {
            let within = match score.node.as_str() {
                "safe" | "safe_level" => 0.02,
                _ => continue,
            };
            let interval = score.interval.as_ref().unwrap();
            let off = (interval.covered - interval.stated).abs();
            assert!(off <= within, "{}: {interval:?}", score.output);
            compared += 1;
        }
        assert!(compared >= 6, "{compared}");
        for score in &scores {
            eprintln!(
                "{machine} {} {:?} {:?}",
                score.output, score.rmse, score.interval
            );
        }
    }
}

fn one_axis() -> Graph {
    Graph::new()
        .signal("temperature", "K", "room chuck", "1min")
        .signal("drift", "nm/min", "Z1", "1min")
}

fn linear(intercept: f64, noise: f64, root: f64) -> Arc<dyn Predictor> {
    let written = serde_json::json!({
        "type": "linear",
        "regressors": ["temperature.room"],
        "coefficients": [0.0],
        "intercept": intercept,
        "variance": { "noise": noise, "rows": 100, "centre": [20.0], "root": [root] },
    });
    let read: Box<dyn Predictor> = serde_json::from_value(written).unwrap();
    Arc::from(read)
}

fn voting(vote: &str, of: &[&str]) -> Graph {
    let outputs = of.iter().enumerate();
    let outputs: Vec<_> = outputs
        .map(|(nth, of)| format!("out{nth} = '{of}'"))
        .collect();
    one_axis()
        .model("one", "linear", "temperature.room", "drift", "0s")
        .model("other", "linear", "temperature.room", "drift", "0s")
        .vote("vote", vote, "one other", "")
        .outputs(&outputs.join("; "))
}

#[test]
fn a_deviation_is_that_of_the_fit_at_the_present_features() {
    let text = voting("fallback", &["one", "one:std_dev"]);
    let fitted = [
        ("one", linear(5.0, 4.0, 0.1)),
        ("other", linear(7.0, 9.0, 0.0)),
    ];
    let mut bench = Bench::new(&text, &fitted);
    let found = bench.tick(0.0, &[("temperature.room", 30.0)]);
    let leverage = 1.0 / 100.0 + (0.1_f64 * (30.0 - 20.0)).powi(2);
    assert_eq!(found, [5.0, (4.0 * (1.0 + leverage)).sqrt()]);
}

#[test]
fn a_choice_has_the_deviation_of_what_it_chose() {
    let text = voting("fallback", &["vote", "vote:std_dev"]);
    let fitted = [
        ("one", linear(5.0, 4.0, 0.0)),
        ("other", linear(7.0, 9.0, 0.0)),
    ];
    let mut bench = Bench::new(&text, &fitted);
    let found = bench.tick(0.0, &[("temperature.room", 30.0)]);
    assert_eq!(found[0], 5.0);
    assert!(
        (found[1] - (4.0_f64 * 1.01).sqrt()).abs() < 1e-12,
        "{found:?}"
    );
}

#[test]
fn a_watch_passes_the_deviation_of_what_it_watches_on() {
    for watch in ["page_hinkley", "adwin"] {
        let text = voting(
            &format!("{watch}\"\ninputs.truth = \"drift"),
            &["vote", "vote:std_dev", "vote:reason"],
        )
        .replace("[\"one\", \"other\"]", "\"one\"");
        let fitted = [
            ("one", linear(5.0, 4.0, 0.0)),
            ("other", linear(7.0, 9.0, 0.0)),
        ];
        let mut bench = Bench::new(&text, &fitted);
        let found = bench.tick(0.0, &[("temperature.room", 30.0)]);
        assert_eq!(found[0], 5.0);
        assert!(
            (found[1] - (4.0_f64 * 1.01).sqrt()).abs() < 1e-12,
            "{watch}: {found:?}"
        );
        assert_eq!(found[2], 3.0, "not yet known");
    }
}

#[test]
fn a_vote_is_unsure_of_what_its_voters_are_and_of_what_they_disagree_about() {
    let vote = r#"auto_weighted"
        inputs.truth = "drift"
        memory = "15min"
        power = 0.0
        weights = "inverse_power"#;
    let text = voting(vote, &["vote", "vote:std_dev"]);
    let fitted = [
        ("one", linear(5.0, 4.0, 0.0)),
        ("other", linear(9.0, 10.0, 0.0)),
    ];
    let mut bench = Bench::new(&text, &fitted);
    let found = bench.tick(0.0, &[("temperature.room", 30.0)]);
    let variance = 0.5 * (4.0 * 1.01 + 2.0 * 2.0) + 0.5 * (10.0 * 1.01 + 2.0 * 2.0);
    assert_eq!(found[0], 7.0);
    assert!((found[1] - f64::sqrt(variance)).abs() < 1e-12, "{found:?}");
}

#[test]
fn where_theory_says_nothing_there_is_no_deviation_to_refer_to() {
    let text = voting("fallback", &["one:std_dev"]).replacen(
        r#"inputs.features"#,
        r#"solver = { type = "sgd" }
            inputs.features"#,
        1,
    );
    let told = problems(&text);
    assert!(told.contains("std_dev"), "{told}");
}

#[test]
fn a_deviation_that_nobody_reads_is_not_computed() {
    let text = voting("fallback", &["vote"]);
    let plan = plan(&text);
    assert!(plan.nodes.iter().all(|node| node.role.std_dev().is_none()));
    let wanted = telling(&text);
    assert!(
        wanted
            .nodes
            .iter()
            .all(|node| node.role.std_dev().is_some())
    );
}

/// A level that is at 10 for half an hour and then at 50, told every 30 s with a span of none.
fn following(noises: &str, more: &str) -> Graph {
    one_axis()
        .model("level", "kalman", "", "drift", "0s")
        .with(&format!("noises = {noises}"))
        .with(more)
        .outputs("level = 'level'; deviation = 'level:std_dev'")
}

fn recorded(rows: usize, of: impl Fn(usize) -> f64) -> Table {
    let mut table = Table::default();
    for row in 0..rows {
        let values = [f64::NAN, f64::NAN, of(row)];
        table.push(Instant::from_ns(row as i64 * 30_000_000_000), &values);
    }
    table
}

#[test]
fn a_level_is_followed_by_the_textbook_recursion() {
    let noises = r#"{ observation = "2 nm/min", level = "3 nm/min", per = "1min" }"#;
    let plan = plan(&following(noises, ""));
    let train = recorded(200, |row| 5.0 * (row as f64 / 9.0).sin());
    let (fitted, _) = fit(&plan, &train, &FitOptions::default(), &mut |_| {}).unwrap();
    let mut engine = Engine::new(Arc::clone(&plan), &fitted).unwrap();
    let written = serde_json::to_value(&*fitted["level"]).unwrap();
    let start = &written["at_large"][0];
    let (mut level, mut variance) = (start[0].as_f64().unwrap(), start[1].as_f64().unwrap());
    // The level is told about the mean of the truths of the fit.
    level += written["scaling"]["truth"].as_f64().unwrap();
    let (observation, gained_per_s) = (4.0, 9.0 / 60.0);
    let mut last = None::<f64>;
    for tick in 0..60_usize {
        let now = 10.0 * tick as f64;
        let truth = if tick % 7 == 3 {
            10.0 + tick as f64
        } else {
            f64::NAN
        };
        let out = engine
            .step(secs(now), &[20.0, 20.0, truth])
            .unwrap()
            .to_vec();
        // The truth of this tick cannot touch its outputs.
        let ahead = last.map_or(0.0, |last| gained_per_s * (now - last));
        assert!(
            (out[0] - level).abs() < 1e-9,
            "tick {tick}: {out:?} and {level}"
        );
        let deviation = (variance + ahead + observation).sqrt();
        assert!(
            (out[1] - deviation).abs() < 1e-9,
            "tick {tick}: {out:?} and {deviation}"
        );
        if !truth.is_nan() {
            variance += ahead;
            let gain = variance / (variance + observation);
            level += gain * (truth - level);
            variance *= 1.0 - gain;
            last = Some(now);
        }
    }
    assert!(last.is_some());
}

#[test]
fn with_learn_off_the_level_stays_where_the_fit_has_it() {
    let noises = r#"{ observation = "2 nm/min", level = "3 nm/min", per = "1min" }"#;
    let plan = plan(&following(noises, "learn = false"));
    let train = recorded(200, |row| 20.0 + (row as f64 / 9.0).sin());
    let (fitted, _) = fit(&plan, &train, &FitOptions::default(), &mut |_| {}).unwrap();
    let mut engine = Engine::new(Arc::clone(&plan), &fitted).unwrap();
    let first = engine
        .step(secs(0.0), &[20.0, 20.0, 90.0])
        .unwrap()
        .to_vec();
    let later = engine
        .step(secs(60.0), &[20.0, 20.0, 90.0])
        .unwrap()
        .to_vec();
    assert!(
        (first[0] - 20.0).abs() < 1.0 && first == later,
        "{first:?} {later:?}"
    );
}

#[test]
fn a_new_segment_starts_from_the_level_at_large() {
    let noises = r#"{ observation = "2 nm/min", level = "3 nm/min", per = "1min" }"#;
    let plan = plan(&following(noises, ""));
    let train = recorded(200, |row| 20.0 + (row as f64 / 9.0).sin());
    let (fitted, _) = fit(&plan, &train, &FitOptions::default(), &mut |_| {}).unwrap();
    let mut engine = Engine::new(Arc::clone(&plan), &fitted).unwrap();
    let at_large = engine
        .step(secs(0.0), &[20.0, 20.0, 90.0])
        .unwrap()
        .to_vec();
    let followed = engine
        .step(secs(60.0), &[20.0, 20.0, 90.0])
        .unwrap()
        .to_vec();
    assert!(followed[0] > 40.0, "{followed:?}");
    engine.segment();
    let again = engine
        .step(secs(0.0), &[20.0, 20.0, f64::NAN])
        .unwrap()
        .to_vec();
    assert_eq!(again, at_large);
}

#[test]
fn the_most_likely_noises_are_told_as_a_graph_takes_them() {
    let text = following("{}", "").replace("noises = {}", "trend = true");
    let plan = plan(&text);
    let mut state = 1_u64;
    let mut uniform = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut level = 0.0;
    let truths: Vec<f64> = (0..500)
        .map(|_| {
            level += uniform();
            level + 10.0 * uniform()
        })
        .collect();
    let train = recorded(500, |row| truths[row]);
    let (_, report) = fit(&plan, &train, &FitOptions::default(), &mut |_| {}).unwrap();
    let athermal::run::fit::Outcome::Fitted(told) = &report.estimators[0].outcome else {
        panic!("{:?}", report.estimators[0].outcome)
    };
    let mut notes = told.notes.iter();
    let noises = notes.find_map(|note| note.strip_prefix("most likely are noises = "));
    let noises = noises.unwrap();
    // A uniform number of width 10 has a variance of 100/12; the level gains 120 times 1/12 in an hour.
    let observation: f64 = noises
        .split('"')
        .nth(1)
        .unwrap()
        .trim_end_matches(" nm/min")
        .parse()
        .unwrap();
    assert!(
        (observation / (100.0_f64 / 12.0).sqrt() - 1.0).abs() < 0.1,
        "{noises}"
    );
    let again = text.replace("trend = true", &format!("trend = true\nnoises = {noises}"));
    assert_eq!(crate::workbench::plan(&again).nodes.len(), 1);
}

#[test]
fn noises_in_another_unit_than_the_truth_are_told() {
    let noises = r#"{ observation = "2 K", level = "3 um/h", per = "1min" }"#;
    let told = problems(&following(noises, ""));
    assert!(
        told.contains("`observation` is in K, and the truth in nm/min"),
        "{told}"
    );
    assert!(!told.contains("`level` is in"), "{told}");
}

#[test]
fn noises_and_intervals_out_of_range_are_reported_all_at_once() {
    let noises =
        r#"{ observation = "0 nm/min", level = "-3 nm/min", trend = "1 nm/min", per = "0s" }"#;
    let told = problems(&following(noises, "penalty = -1.0"));
    for part in [
        "`observation` is 0 nm/min and must be greater than 0",
        "`level` is -3 nm/min and must be 0 or more",
        "`per` is 0s and must be greater than 0",
        "`penalty` is -1 and must be 0 or more",
    ] {
        assert!(told.contains(part), "{part} in {told}");
    }
    let trend =
        r#"{ observation = "5 nm/min", level = "3 nm/min", trend = "1 nm/min", per = "1min" }"#;
    let told = problems(&following(trend, ""));
    assert!(told.contains("the level has no trend"), "{told}");
    let safe = one_axis()
        .section("nodes.safe", "type = 'conformal'")
        .with("inputs.prediction = 'drift'")
        .with("inputs.truth = 'drift'; memory = '0s'; coverage = 1.0; gain = nan")
        .outputs("out = 'safe'");
    let told = problems(&safe);
    for part in ["`memory` is 0s", "`coverage` is 1", "`gain` is NaN"] {
        assert!(told.contains(part), "{part} in {told}");
    }
}

#[test]
fn evaluate_tells_how_often_intervals_hold() {
    let scratch = Scratch::new("intervals");
    let text = one_axis()
        .model("yesterday", "persistence", "", "drift", "0s")
        .section("nodes.safe", "type = 'conformal'")
        .with("inputs.prediction = 'yesterday'")
        .with("inputs.truth = 'drift'; memory = '1h'; coverage = 0.8")
        .outputs("safe = 'safe'; lower = 'safe:lower'; upper = 'safe:upper'")
        .time("time_s");
    let graph = scratch.file("graph.toml", text);
    let mut csv = String::from("time_s,room,chuck,Z1\n");
    let mut state = 1_u64;
    for row in 0..400_u32 {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let noise = (state >> 11) as f64 / (1_u64 << 53) as f64;
        csv += &format!("{},20,20,{noise}\n", 30 * row);
    }
    let log = scratch.file("log.csv", csv);
    let table = athermal(&[&"evaluate", &graph, &"--data", &log]).ended(0);
    assert!(
        table.out.contains("to cover") && table.out.contains("80.0%"),
        "{}",
        table.out
    );
    let widest = table.out.lines().map(|line| line.chars().count()).max();
    assert!(widest <= Some(80), "{}", table.out);
    let json = athermal(&[&"evaluate", &graph, &"--data", &log, &"--format", &"json"]);
    let json = json.ended(0).json();
    let interval = json["scores"]
        .as_array()
        .unwrap()
        .iter()
        .find(|score| score["output"] == "safe.Z1")
        .map(|score| &score["interval"])
        .unwrap();
    assert_eq!(interval["stated"], 0.8);
    assert!(
        (interval["covered"].as_f64().unwrap() - 0.8).abs() < 0.04,
        "{interval}"
    );
}

#[test]
fn intervals_know_only_of_truths_that_the_embargo_lets_through() {
    let graph = |span: &str| {
        one_axis()
            .slope("trend", "temperature.room", span, "K/min")
            .model("none", "zero", "", "trend", "0s")
            .section("nodes.safe", "type = 'conformal'")
            .with("inputs.prediction = 'none'; inputs.truth = 'trend'")
            .with("memory = '1h'; coverage = 0.5; gain = 0.0")
            .outputs("out = 'safe:upper'")
    };
    let mut bench = Bench::new(&graph("5min"), &[]);
    let plan = Arc::clone(bench.engine.plan());
    let trend = slot(&plan, "trend.room");
    let mut truths: Vec<(f64, f64)> = Vec::new();
    let mut compared = 0;
    for tick in 0..120_u32 {
        let now = f64::from(tick) * 30.0;
        let wave = 20.0 + f64::from(tick * tick % 17);
        let upper = bench.tick(now, &[("temperature.room", wave)])[0];
        // Half of the errors are to be covered: of n known ones, the ⌈(n + 1)/2⌉-th smallest.
        let mut known: Vec<f64> = truths
            .iter()
            .filter(|(at, _)| *at <= now - 300.0)
            .map(|(_, truth)| truth.abs())
            .collect();
        known.sort_by(f64::total_cmp);
        let rank = (known.len() + 1).div_ceil(2);
        let expected = known.get(rank - 1).copied().unwrap_or(f64::NAN);
        assert!(
            upper == expected || upper.is_nan() && expected.is_nan(),
            "at {now}: {upper} and {expected}"
        );
        compared += usize::from(!expected.is_nan());
        let truth = bench.engine.value(trend);
        if !truth.is_nan() {
            truths.push((now, truth));
        }
    }
    assert!(compared > 80);
}
