//! What `run` puts out, scored by hand from the two CSV files alone, equals what `evaluate` prints. The pairing, the drift
//! and its noise are written here anew, from the words of the graph language, and share nothing with the program.

use std::collections::BTreeMap;

use crate::workbench::{Scratch, athermal, simulated};

const SPAN: f64 = 300.0;
const LIMIT: f64 = 250.0;

/// A CSV file without quotes: columns by name, NaN where a cell is empty.
fn columns(text: &str) -> BTreeMap<String, Vec<f64>> {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut columns: BTreeMap<String, Vec<f64>> = names
        .iter()
        .map(|&name| (name.to_owned(), Vec::new()))
        .collect();
    for line in lines {
        for (name, cell) in names.iter().zip(line.split(',')) {
            let value = if cell.is_empty() {
                f64::NAN
            } else {
                cell.parse().unwrap()
            };
            columns.get_mut(*name).unwrap().push(value);
        }
    }
    columns
}

/// The drift in nm/min at each position, and its standard error: line fits over the positions of the last five minutes.
struct Truth {
    at: f64,
    drift: f64,
    error: f64,
}

fn truths(times: &[f64], positions: &[f64]) -> Vec<Truth> {
    let measured: Vec<(f64, f64)> = times
        .iter()
        .copied()
        .zip(positions.iter().copied())
        .filter(|(_, position)| !position.is_nan())
        .collect();
    let mut truths = Vec::new();
    for &(now, _) in &measured {
        let window: Vec<_> = measured
            .iter()
            .filter(|(t, _)| *t > now - SPAN && *t <= now)
            .collect();
        let span = window[window.len() - 1].0 - window[0].0;
        if now - SPAN < measured[0].0 || window.len() < 3 || span < 0.5 * SPAN {
            continue;
        }
        let n = window.len() as f64;
        let (mt, my) = (
            window.iter().map(|w| w.0).sum::<f64>() / n,
            window.iter().map(|w| w.1).sum::<f64>() / n,
        );
        let squares: f64 = window.iter().map(|w| (w.0 - mt).powi(2)).sum();
        let slope = window.iter().map(|w| (w.0 - mt) * (w.1 - my)).sum::<f64>() / squares;
        let residual: f64 = window
            .iter()
            .map(|w| (w.1 - my - slope * (w.0 - mt)).powi(2))
            .sum();
        let error = (residual / (n - 2.0) / squares).sqrt();
        truths.push(Truth {
            at: now,
            drift: 60.0 * slope,
            error: 60.0 * error,
        });
    }
    truths
}

/// The value of the last run at or before an instant, if it is at most a span before it.
fn last(runs: &[(f64, f64)], at: f64) -> f64 {
    let before = runs.partition_point(|(t, _)| *t <= at);
    match before.checked_sub(1).map(|nth| runs[nth]) {
        Some((t, value)) if at - t <= SPAN => value,
        _ => f64::NAN,
    }
}

fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

fn check(name: &str, ahead: f64, graph: &str) {
    let scratch = Scratch::new(&format!("scores-{name}"));
    let train = simulated(&scratch, "train.csv", "linear-axis", 1.5, 5);
    let test = simulated(&scratch, "test.csv", "linear-axis", 1.0, 6);
    let own = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("graphs")
        .join(graph);
    let text = format!(
        "schema = 1\nextends = {:?}\n[outputs]\nthermal = \"thermal\"\nmotion = \"motion\"\nboth = \"both\"\nvote = \"vote\"\npredicted = \"vote\"\n",
        own
    );
    let graph = scratch.file("graph.toml", text);
    let model = scratch.path("model.json");
    athermal(&[&"fit", &graph, &"--data", &train, &"-o", &model, &"-q"]).ended(0);
    let run = athermal(&[&"run", &model, &"--input", &test, &"--output", &"-"]).ended(0);
    let printed = athermal(&[
        &"evaluate",
        &model,
        &"--data",
        &test,
        &"--abs-truth-below",
        &"250 nm/min",
        &"--format",
        &"json",
    ])
    .ended(0)
    .json();

    let given = columns(&std::fs::read_to_string(&test).unwrap());
    let out = columns(&run.out);
    let times = &given["time_s"];
    assert_eq!(times, &out["time_s"]);
    let warm: Vec<bool> = (0..times.len())
        .map(|row| {
            ["t1_degC", "t2_degC", "t3_degC", "t4_degC"]
                .iter()
                .any(|column| !given[*column][row].is_nan())
        })
        .collect();
    let mut compared = 0;
    for axis in ["X", "Y", "Z"] {
        let truths = truths(times, &given[&format!("{axis}_nm")]);
        let drifts: Vec<(f64, f64)> = truths.iter().map(|truth| (truth.at, truth.drift)).collect();
        let predicted: BTreeMap<&str, Vec<f64>> = ["thermal", "motion", "both", "vote"]
            .into_iter()
            .map(|node| {
                // `thermal` runs where a temperature is new; the others answer with time alone.
                let runs: Vec<(f64, f64)> = (0..times.len())
                    .filter(|&row| node != "thermal" || warm[row])
                    .map(|row| (times[row], out[&format!("{node}.{axis}")][row]))
                    .collect();
                (
                    node,
                    truths
                        .iter()
                        .map(|truth| last(&runs, truth.at - ahead))
                        .collect(),
                )
            })
            .collect();
        let counted: Vec<usize> = (0..truths.len())
            .filter(|&i| truths[i].drift.abs() < LIMIT)
            .collect();
        let ticks: Vec<(f64, f64)> = times.iter().map(|&t| (t, t)).collect();
        for (node, values) in &predicted {
            let score = printed["scores"]
                .as_array()
                .unwrap()
                .iter()
                .find(|score| score["output"] == format!("{node}.{axis}"))
                .unwrap();
            // What is put out is scored wherever it has a value.
            let own = counted.iter().copied().filter(|&i| !values[i].is_nan());
            let own: Vec<usize> = own.collect();
            assert_eq!(score["own_instants"], true);
            let y: Vec<f64> = own.iter().map(|&i| truths[i].drift).collect();
            let e: Vec<f64> = own.iter().map(|&i| values[i] - truths[i].drift).collect();
            let mean = y.iter().sum::<f64>() / y.len() as f64;
            let sse: f64 = e.iter().map(|e| e * e).sum();
            let lag = (SPAN - ahead).max(0.0);
            let persistence: Vec<f64> = own
                .iter()
                .map(|&i| last(&drifts, last(&ticks, truths[i].at - ahead) - lag) - truths[i].drift)
                .filter(|e| !e.is_nan())
                .collect();
            let noise: Vec<f64> = own.iter().map(|&i| truths[i].error).collect();
            let there = counted.iter().filter(|&&i| !values[i].is_nan()).count();
            let expected = [
                ("n", own.len() as f64),
                ("ahead_s", ahead),
                ("rmse", root_mean_square(&e)),
                ("r2_zero", 1.0 - sse / y.iter().map(|y| y * y).sum::<f64>()),
                (
                    "r2_mean",
                    1.0 - sse / y.iter().map(|y| (y - mean).powi(2)).sum::<f64>(),
                ),
                ("bias", e.iter().sum::<f64>() / e.len() as f64),
                ("max_abs", e.iter().map(|e| e.abs()).fold(0.0, f64::max)),
                ("valid", there as f64 / counted.len() as f64),
                ("baseline_zero", root_mean_square(&y)),
                ("baseline_persistence", root_mean_square(&persistence)),
                ("truth_noise", root_mean_square(&noise)),
            ];
            assert!(own.len() > 500, "{}", own.len());
            for (figure, value) in expected {
                let found = score[figure]
                    .as_f64()
                    .unwrap_or_else(|| panic!("{figure} in {score}"));
                let close = (found - value).abs() <= 1e-7 * value.abs().max(1.0);
                assert!(
                    close,
                    "{figure} of {node}.{axis} is {value} by hand, printed is {found}"
                );
                compared += 1;
            }
            assert_eq!(score["truth"], format!("drift.{axis}"));
            assert_eq!(score["unit"], "nm/min");
            assert_eq!(score["node"], *node);
        }
    }
    assert_eq!(compared, 3 * 4 * 11);
}

#[test]
fn a_forecast_scored_by_hand_is_what_evaluate_prints() {
    check("forecast", 300.0, "linear-axis.toml");
}

#[test]
fn a_virtual_sensor_scored_by_hand_is_what_evaluate_prints() {
    check("sensor", 0.0, "linear-axis-sensor.toml");
}

/// A prediction of a plain sample, whose input may have an age of its own, on a signal that may have one.
fn aged(signal: &str, input: &str) -> String {
    format!(
        "schema = 1\n[time]\ncolumn = \"t\"\n[signals.room]\nunit = \"Cel\"\nchannels = [\"room\"]\nmax_age = \"1min\"\n\
         [signals.position]\nunit = \"nm\"\nchannels = [\"Z\"]\n{signal}\n[nodes.still]\ntype = \"zero\"\nahead = \"10s\"\n\
         inputs.truth = {input}\n[outputs]\npredicted = \"still\"\n"
    )
}

#[test]
fn a_truth_is_scored_by_the_age_that_its_node_is_given_it_at_and_has_no_spread_where_rounding_makes_it()
 {
    let scratch = Scratch::new("scores-by-age");
    // The truth at 100 s is predicted at 40 s at the latest, 50 s before it had to be; the others in time.
    let rows = "t,room,Z\n0,20,\n20,20,\n30,20,0.1\n40,20,0.1\n100,20,0.1\n110,20,0.1\n";
    let data = scratch.file("data.csv", rows);
    let scored = |name: &str, text: String| {
        let graph = scratch.file(name, text);
        let arguments: [&dyn AsRef<std::ffi::OsStr>; 6] =
            [&"evaluate", &graph, &"--data", &data, &"--format", &"json"];
        let scores = athermal(&arguments).ended(0).json()["scores"].clone();
        assert_eq!(scores.as_array().unwrap().len(), 1, "{name}: {scores}");
        assert!(
            scores[0]["r2_mean"].is_null() && scores[0]["fit"].is_null(),
            "{scores}"
        );
        scores[0]["n"].as_u64().unwrap()
    };
    let own = "{ from = \"position.Z\", max_age = \"30s\" }";
    let long = "max_age = \"3min\"";
    assert_eq!(scored("long.toml", aged(long, "\"position.Z\"")), 4);
    assert_eq!(scored("own.toml", aged(long, own)), 3);
    assert_eq!(scored("only.toml", aged("", own)), 3);
}
