//! A position that is zeroed, homed or pushed: truths whose windows hold the leap teach nothing, are no past and move no weight.

use athermal::core::engine::Engine;
use athermal::core::prng::Prng;
use athermal::run::fit::{FitOptions, Outcome, fit};
use athermal::run::recording::Table;

use super::world::{fitted_on, run};
use crate::workbench::{Graph, plan, secs};

/// A tick every 10 s, of which 30 are a window of the truth.
const WINDOW: usize = 30;

/// A model that learns, one of the past of the truth, and a vote.
fn graph(learner: &str) -> Graph {
    Graph::new()
        .signal("temperature", "K", "a b", "1min")
        .signal("position", "nm", "Z", "1min")
        .slope("gradient", "temperature", "5min", "K/min")
        .slope("drift", "position", "5min", "nm/min")
        .model("model", learner, "gradient", "drift.Z", "0s")
        .with("learn = true")
        .model("plain", "linear", "gradient", "drift.Z", "0s")
        .model("past", "ar", "", "drift.Z", "0s")
        .with("lags = ['5min', '10min']")
        .vote("vote", "auto_weighted", "['model', 'past', 'plain']", "drift.Z")
        .with("memory = '15min'")
        .outputs("model = 'model'; past = 'past'; vote = 'vote'; weights = 'vote:weights'; drift = 'drift'")
}

/// Two temperatures that wander, and a position that follows them with noise of 2 nm.
fn rows(seed: u64, count: usize) -> Vec<[f64; 3]> {
    let mut random = Prng::stream(seed, "leapt");
    let [mut a, mut b] = [0.0; 2];
    let row = |_| {
        a = 0.999 * a + 0.01 * random.normal();
        b = 0.999 * b + 0.01 * random.normal();
        [a, b, 2000.0 * a - 700.0 * b + 2.0 * random.normal()]
    };
    (0..count).map(row).collect()
}

/// The same of which the position is another from some rows on.
fn leaping(seed: u64, leap: impl Fn(usize) -> f64) -> Vec<[f64; 3]> {
    let mut rows = rows(seed, 1500);
    (rows.iter_mut().enumerate()).for_each(|(nth, row)| row[2] += leap(nth));
    rows
}

const AT: usize = 900;

fn zeroed(nth: usize) -> f64 {
    if nth < AT { 0.0 } else { 900.0 }
}

fn homed(nth: usize) -> f64 {
    if nth < AT { 0.0 } else { -60_000.0 }
}

fn pushed(nth: usize) -> f64 {
    if (AT..AT + 3).contains(&nth) {
        5_000.0
    } else {
        0.0
    }
}

#[test]
fn a_leap_teaches_nothing_is_no_past_and_moves_no_weight() {
    for learner in ["rls", "kalman"] {
        let (plan, fitted) = fitted_on(&graph(learner).to_string(), &rows(1, 1500));
        let run_on = |rows: &[[f64; 3]]| {
            let mut engine = Engine::new(plan.clone(), &fitted).unwrap();
            run(&mut engine, 0, rows)
        };
        let clean = run_on(&rows(2, 1500));
        let largest = |column: usize| {
            let sizes = clean.iter().map(|row| row[column].abs());
            sizes.filter(|of| !of.is_nan()).fold(0.0, f64::max)
        };
        for (name, leap) in [
            ("zeroed", zeroed as fn(usize) -> f64),
            ("homed", homed),
            ("pushed", pushed),
        ] {
            let found = run_on(&leaping(2, leap));
            let after = AT + WINDOW + 4;
            for nth in AT..1500 {
                let [now, then] = [&found[nth], &clean[nth]];
                // The model as the leap left it, and what comes of the past.
                let off = (now[0] - then[0]).abs();
                assert!(
                    off < 0.02 * largest(0),
                    "{learner} {name} {nth}: {now:?}, {then:?}"
                );
                assert!(
                    now[1].is_nan() || now[1].abs() <= largest(1),
                    "{learner} {name} {nth}: {now:?}"
                );
                assert!(
                    (now[2] - then[2]).abs() < 0.3 * largest(2),
                    "{learner} {name} {nth}: {now:?}, {then:?}"
                );
                if nth < after {
                    let held = &found[AT - 1][3..6];
                    assert!(
                        now[3..6]
                            .iter()
                            .zip(held)
                            .all(|(now, held)| now.is_nan() || (now - held).abs() < 0.4),
                        "{learner} {name} {nth}: {now:?}"
                    );
                    assert!(
                        now[6].is_nan() || nth >= AT + WINDOW,
                        "{learner} {name} {nth}: {now:?}"
                    );
                }
            }
            assert!(
                found[after][6] == clean[after][6] || name == "pushed" || !found[after][6].is_nan()
            );
        }
    }
}

#[test]
fn an_engine_that_is_restored_amid_a_leap_goes_on_with_the_same_bits() {
    let (plan, fitted) = fitted_on(&graph("rls").to_string(), &rows(1, 1500));
    let rows = leaping(2, zeroed);
    let mut engine = Engine::new(plan.clone(), &fitted).unwrap();
    for cut in [AT - 1, AT, AT + 1, AT + 10, AT + 40] {
        let mut through = Engine::new(plan.clone(), &fitted).unwrap();
        run(&mut through, 0, &rows[..cut]);
        engine = Engine::new(plan.clone(), &fitted).unwrap();
        engine.restore(&through.snapshot()).unwrap();
        let bits = |rows: Vec<Vec<f64>>| -> Vec<Vec<u64>> {
            let bits = |row: Vec<f64>| row.into_iter().map(f64::to_bits).collect();
            rows.into_iter().map(bits).collect()
        };
        let [one, other] = [&mut through, &mut engine].map(|of| bits(run(of, cut, &rows[cut..])));
        assert!(one == other, "{cut}");
    }
    assert!(engine.last().is_some());
}

#[test]
fn a_fit_leaves_out_the_truths_over_a_leap_and_is_that_of_a_sound_log() {
    let text = graph("rls").to_string();
    let report = |rows: &[[f64; 3]]| {
        let mut table = Table::default();
        for (tick, row) in rows.iter().enumerate() {
            table.push(secs(10.0 * tick as f64), row.as_ref());
        }
        fit(&plan(&text), &table, &FitOptions::default(), &mut |_| {})
            .unwrap()
            .1
    };
    let [sound, leapt] = [rows(2, 1500), leaping(2, zeroed)].map(|rows| report(&rows));
    for (sound, leapt) in sound.estimators.iter().zip(&leapt.estimators) {
        let error = |of: &athermal::run::fit::EstimatorFit| match &of.outcome {
            Outcome::Fitted(report) => report.in_sample_rmse.unwrap(),
            Outcome::Failed(error) => panic!("{error}"),
        };
        assert_eq!(
            (sound.dropped.leapt, leapt.dropped.leapt),
            (0, WINDOW as u64)
        );
        assert!(
            (error(leapt) / error(sound) - 1.0).abs() < 0.03,
            "{}",
            leapt.node
        );
    }
}
