//! What a learner is told, and when.

use crate::workbench::{Bench, Graph, compiled, problems};

/// A position every 30 s whose slope over `window` is predicted, and a temperature every 10 s that is the time in seconds.
fn graph(about: &str, window: &str, ahead: &str) -> Graph {
    Graph::new()
        .signal("temperature", "K", "a", "1min")
        .signal("position", "nm", "Z", "3min")
        .slope("drift", "position", window, "")
        .model("told", "test_told", "temperature", "drift", ahead)
        .with(&format!(
            "about = '{about}'; learn = {{ outliers = inf, margin = inf }}"
        ))
        .outputs("out = 'told'")
}

/// Runs for an hour; what was predicted at each tick, and the ticks that had a truth.
fn hour(graph: &str) -> (Vec<(f64, f64)>, Vec<f64>) {
    let mut bench = Bench::new(graph, &[]);
    let (mut predicted, mut truths) = (Vec::new(), Vec::new());
    for tick in 0..360 {
        let now = 10.0 * f64::from(tick);
        let mut samples = vec![("temperature.a", now)];
        if tick % 3 == 0 {
            samples.push(("position.Z", (0.001 * now).sin()));
        }
        predicted.push((now, bench.tick(now, &samples)[0]));
        if !bench.value("drift.Z").is_nan() {
            truths.push(now);
        }
    }
    (predicted, truths)
}

#[test]
fn a_learner_knows_of_no_truth_that_the_embargo_withholds_and_of_all_others() {
    for (window, span) in [("2min", 120.0), ("5min", 300.0)] {
        for (ahead, horizon) in [
            ("0s", 0.0),
            ("60s", 60.0),
            ("5min", 300.0),
            ("10min", 600.0),
        ] {
            let (predicted, truths) = hour(&graph("arrival", window, ahead));
            let first_run = truths.iter().find(|&&truth| truth >= horizon).unwrap();
            let mut told = 0;
            for (now, shown) in predicted {
                let newest = now + f64::min(0.0, horizon - span);
                // The truth of this very tick is told after its outputs have been made.
                let known = |&&truth: &&f64| truth >= *first_run && truth <= newest && truth < now;
                let expected = truths.iter().rev().find(known).copied().unwrap_or(-1.0);
                assert_eq!(shown, expected, "{window} {ahead} at {now} s");
                told += usize::from(shown >= 0.0);
            }
            assert!(told > 200, "{window} {ahead}: {told}");
        }
    }
}

#[test]
fn a_truth_meets_the_row_of_the_last_run_at_or_before_its_horizon() {
    for (ahead, horizon) in [("0s", 0.0), ("65s", 65.0), ("5min", 300.0)] {
        let (regressors, _) = hour(&graph("regressor", "5min", ahead));
        let (arrivals, _) = hour(&graph("arrival", "5min", ahead));
        let mut met = 0;
        for ((now, regressor), (_, arrival)) in regressors.into_iter().zip(arrivals) {
            if arrival >= 0.0 {
                // The temperature is the time, and runs are at multiples of 10 s.
                let run = ((arrival - horizon) / 10.0).floor() * 10.0;
                assert_eq!(regressor, run, "{ahead} at {now} s");
                met += 1;
            }
        }
        assert!(met > 200, "{ahead}: {met}");
    }
}

#[test]
fn an_estimator_that_cannot_learn_says_what_can() {
    let with = |line: &str| {
        let text = graph("arrival", "5min", "0s");
        let lines = text
            .lines()
            .filter(|line| !line.starts_with("about") && !line.starts_with("learn ="));
        let linear = "type = \"linear\"\n".to_owned() + line;
        let text = lines.collect::<Vec<_>>().join("\n");
        text.replace("type = \"test_told\"", &linear)
    };
    let told = problems(&with("learn = true\n"));
    assert!(
        told.contains("[A110]") && told.contains("`type = \"rls\"`"),
        "{told}"
    );
    let told = problems(&with(
        "solver = { type = \"sgd\" }\nlearn = { outliers = 0.5, margin = nan }\n",
    ));
    assert!(
        told.contains("`outliers` is 0.5 and must be above 1"),
        "{told}"
    );
    assert!(
        told.contains("`margin` is NaN and must be 0 or more"),
        "{told}"
    );
    let told = problems(&with(
        "solver = { type = \"sgd\" }\nlearn = { outlier = 3.0 }\n",
    ));
    assert!(told.contains("did you mean \"outliers\"?"), "{told}");
}

#[test]
fn a_margin_about_no_range_is_a_mistake() {
    let of = |kind: &str, limits: &str| {
        let text = graph("arrival", "5min", "0s");
        let lines = text
            .lines()
            .filter(|line| !line.starts_with("about") && !line.starts_with("learn ="));
        let text = lines.collect::<Vec<_>>().join("\n");
        let node = format!("type = \"{kind}\"\nlearn = {{ {limits} }}\n");
        let text = text.replace("type = \"test_told\"", &node);
        compiled(&text).err().unwrap_or_default()
    };
    for margin in ["0.0", "0.5"] {
        let told = of("armax", &format!("margin = {margin}, outliers = 4.0"));
        assert!(
            told.contains("its fit keeps no range of the regressors")
                && told.contains(&format!("{{ margin = {margin},")),
            "{told}"
        );
    }
    assert_eq!(of("armax", "outliers = 4.0"), "");
    for kind in ["rls", "kalman"] {
        assert_eq!(of(kind, "margin = 0.5"), "", "{kind}");
    }
}

#[test]
fn recursive_least_squares_without_any_regressor_is_a_mistake() {
    let text = graph("arrival", "5min", "0s").replace("type = \"test_told\"", "type = \"rls\"");
    let lines = text.lines().filter(|line| !line.starts_with("about"));
    let lines: Vec<_> = lines
        .filter(|line| !line.starts_with("inputs.features"))
        .collect();
    let told = problems(&lines.join("\n"));
    assert!(told.contains("`rls` needs the input `features`"), "{told}");
}
