//! What `evaluate` says of an output is what anybody works out from the rows that `run` writes and the truths of the log, whatever is
//! missing in it.

use std::fmt::Write as _;

use athermal::core::prng::Prng;

use crate::workbench::{Graph, Scratch, athermal, athermal_on};

/// Of a log what is there: a row of time in s, two temperatures and a position, each with a chance to be missing, and each for a while.
fn log(random: &mut Prng, missing: f64) -> String {
    let (mut time_s, mut walk) = (0.0, [0.0_f64; 2]);
    let mut text = "t,A,B,Z\n".to_owned();
    let dead: [[f64; 2]; 3] = std::array::from_fn(|_| {
        let from = random.between(100.0, 400.0);
        [from, from + random.between(0.0, 150.0) * missing * 5.0]
    });
    for row in 0..500 {
        time_s += random.between(10.0, 40.0).round();
        for at in &mut walk {
            *at += random.between(-0.05, 0.05);
        }
        let z = 3.0 * walk[0] + 2.0 * walk[1] + random.between(-0.02, 0.02);
        let _ = write!(text, "{time_s}");
        for (value, [from, to]) in [20.0 + walk[0], 21.0 + walk[1], z].into_iter().zip(dead) {
            let is_dead = (from..to).contains(&f64::from(row));
            let is_there = !is_dead && random.between(0.0, 1.0) >= missing;
            let _ = match is_there {
                true => write!(text, ",{value:.4}"),
                false => write!(text, ","),
            };
        }
        text.push('\n');
    }
    text
}

fn graph(ahead: &str, lag: &str) -> Graph {
    Graph::new()
        .time("t")
        .signal("temperature", "Cel", "A B", "2min")
        .signal("position", "um", "Z", "2min")
        .slope("drift", "position", "5min", "nm/min")
        .slope("gradients", "temperature", "5min", "mK/min")
        .model("one", "linear", "gradients.A", "drift.Z", ahead)
        .model("other", "linear", "gradients", "drift.Z", ahead)
        .vote("vote", "mean", "one other", "")
        .model("motion", "ar", "", "drift.Z", ahead)
        .with(&format!("lags = ['{lag}']"))
        .vote("result", "fallback", "vote motion", "")
        .outputs("result = 'result'; drift = 'drift'")
}

/// What persistence says of a truth at an instant: at the last row before it by the horizon, the newest truth that is older by its
/// window, or by what the horizon leaves of that. None where no truth came of the last position by then, or it is older than a window.
fn persistence(rows: &[[f64; 3]], measured: &[bool], at: f64, ahead_s: f64) -> f64 {
    let last = |by: f64, is: &dyn Fn(usize) -> bool| {
        let last = (0..rows.len())
            .rev()
            .find(|nth| rows[*nth][0] <= by && is(*nth));
        last.filter(|nth| by - rows[*nth][0] <= 300.0)
    };
    let run = last(at - ahead_s, &|_| true);
    let newest = run.and_then(|run| last(rows[run][0] - (300.0 - ahead_s), &|nth| measured[nth]));
    newest.map_or(f64::NAN, |nth| rows[nth][2])
}

#[test]
fn the_figures_of_an_output_are_those_of_the_rows_that_are_written() {
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    let scratch = Scratch::new("scored-outputs");
    for seed in 0..if is_long { 100 } else { 6 } {
        let random = &mut Prng::stream(seed, "rows");
        let (ahead_s, text) = match seed % 2 {
            0 => (0.0, graph("0s", "5min")),
            _ => (300.0, graph("5min", "0s")),
        };
        let graph = scratch.file("g.toml", text);
        let train = scratch.file("train.csv", log(random, 0.0));
        let test = scratch.file("test.csv", log(random, [0.0, 0.05, 0.2][seed as usize % 3]));
        let (model, out) = (scratch.path("m.json"), scratch.path("out.csv"));
        athermal_on("fit", &graph, &train, &[&"-o", &model]).ended(0);
        athermal(&[&"run", &model, &"--input", &test, &"--output", &out]).ended(0);
        let facts = athermal_on("evaluate", &model, &test, &[&"--format", &"json"]).ended(0);
        let facts = facts.json();
        let mut scores = facts["scores"].as_array().unwrap().iter();
        let score = scores.find(|score| score["node"] == "result").unwrap();
        let rows = std::fs::read_to_string(&out).unwrap();
        let rows: Vec<[f64; 3]> = rows
            .lines()
            .skip(1)
            .map(|line| {
                let mut cells = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN));
                std::array::from_fn(|_| cells.next().unwrap())
            })
            .collect();
        // The truth is computed wherever a position is measured.
        let log = std::fs::read_to_string(&test).unwrap();
        let is_measured = |line: &str| !line.ends_with(',');
        let measured: Vec<bool> = log.lines().skip(1).map(is_measured).collect();
        assert_eq!(measured.len(), rows.len());
        // A truth goes with what was put out last before it by the horizon, unless that is older than the truth's window.
        let (mut pairs, mut lasting, mut truths) = (Vec::new(), Vec::new(), 0);
        for [at, _, truth] in rows.iter().filter(|row| !row[2].is_nan()) {
            truths += 1;
            let asked = at - ahead_s;
            let last = rows
                .iter()
                .rev()
                .find(|row| row[0] <= asked && !row[1].is_nan());
            pairs.extend(
                last.filter(|row| asked - row[0] <= 300.0)
                    .map(|row| (row[1], *truth)),
            );
            if pairs.len() > lasting.len() {
                lasting.push(persistence(&rows, &measured, *at, ahead_s) - truth);
            }
        }
        let lasting: Vec<f64> = lasting.into_iter().filter(|of| !of.is_nan()).collect();
        let lasting_n = lasting.len() as f64;
        assert!(lasting_n > 50.0, "seed {seed}: {lasting_n}");
        let lasting: f64 = lasting.iter().map(|of| of * of).sum();
        let n = pairs.len() as f64;
        let sum = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>();
        let mean = sum(&|(_, y)| *y) / n;
        let squared = sum(&|(p, y)| (p - y).powi(2));
        assert!(score["own_instants"].as_bool().unwrap());
        for (figure, expected) in [
            ("n", n),
            ("rmse", (squared / n).sqrt()),
            ("baseline_zero", (sum(&|(_, y)| y * y) / n).sqrt()),
            ("r2_zero", 1.0 - squared / sum(&|(_, y)| y * y)),
            ("r2_mean", 1.0 - squared / sum(&|(_, y)| (y - mean).powi(2))),
            ("persistence_n", lasting_n),
            ("baseline_persistence", (lasting / lasting_n).sqrt()),
            ("bias", sum(&|(p, y)| p - y) / n),
            (
                "max_abs",
                pairs.iter().map(|(p, y)| (p - y).abs()).fold(0.0, f64::max),
            ),
            ("valid", n / f64::from(truths)),
        ] {
            let found = score[figure].as_f64().unwrap();
            let scale = expected.abs().max(1e-3);
            assert!(
                (found - expected).abs() < 1e-8 * scale,
                "seed {seed}, {figure}: {found}, not {expected}"
            );
        }
    }
}
