//! What a sensor that is stuck, or a truth that is elsewhere for a while or for good, leaves behind in what learns.

use athermal::core::engine::Engine;
use athermal::core::prng::Prng;

use super::world::{fitted_on, run};
use crate::workbench::Graph;

const LEARNED: f64 = 0.0;
const OUTLIER: f64 = 3.0;
const OUTSIDE: f64 = 4.0;

const KALMAN: &str = "type = \"kalman\"";
const RETURNING: &str = "type = \"kalman\"\nnoises = { observation = \"1 nm\", level = \"0.4 nm\", per = \"10s\", returns = \"5min\" }";
const TREND: &str = "type = \"kalman\"\ntrend = true\nnoises = { observation = \"1 nm\", level = \"0.1 nm\", trend = \"0.001 nm\", per = \"10s\" }";
const RLS: &str = "type = \"rls\"";
const SGD: &str = "type = \"linear\"\nsolver = { type = \"sgd\" }\nlearn = true";

fn graph(node: &str) -> Graph {
    Graph::new()
        .signal("temperature", "K", "a b", "10s")
        .signal("shift", "nm", "Z", "10s")
        .section("nodes.model", node)
        .with("inputs.features = 'temperature'; inputs.truth = 'shift'; ahead = '0s'")
        .outputs("out = 'model'; deviation = 'model:std_dev'; learning = 'model:learning'")
}

/// A tick every 10 s: two temperatures, and `3a + b/2` with noise of 1.
fn rows(seed: u64, count: usize) -> Vec<[f64; 3]> {
    let mut random = Prng::stream(seed, "leaps");
    let mut a = 0.0;
    let row = |_| {
        a = 0.9 * a + 0.4 * random.normal();
        let b = random.normal();
        [a, b, 3.0 * a + 0.5 * b + random.normal()]
    };
    (0..count).map(row).collect()
}

/// What a model of a kind gives on some rows, after a fit on others.
fn outputs(node: &str, rows_run: &[[f64; 3]]) -> Vec<Vec<f64>> {
    let mut text = graph(node).to_string();
    if node == SGD {
        text = text.replace("deviation = \"model:std_dev\"", "again = \"model\"");
    }
    let (plan, fitted) = fitted_on(&text, &rows(1, 1500));
    run(&mut Engine::new(plan, &fitted).unwrap(), 0, rows_run)
}

/// The root mean square by which predictions from a row on miss.
fn error(rows: &[[f64; 3]], outputs: &[Vec<f64>], from: usize) -> f64 {
    let pairs = rows.iter().zip(outputs).skip(from);
    let squares = pairs.map(|(row, output)| (row[2] - output[0]).powi(2));
    (squares.sum::<f64>() / (rows.len() - from) as f64).sqrt()
}

/// By how much a prediction moves with the first temperature, from a row on.
fn slope(rows: &[[f64; 3]], outputs: &[Vec<f64>], from: usize) -> f64 {
    let pairs = || rows.iter().zip(outputs).skip(from);
    let (x, y) = (|row: &[f64; 3]| row[0], |output: &Vec<f64>| output[0]);
    let count = (rows.len() - from) as f64;
    let mean_x = pairs().map(|(row, _)| x(row)).sum::<f64>() / count;
    let mean_y = pairs().map(|(_, output)| y(output)).sum::<f64>() / count;
    let both = pairs().map(|(row, output)| (x(row) - mean_x) * (y(output) - mean_y));
    let own = pairs().map(|(row, _)| (x(row) - mean_x).powi(2));
    both.sum::<f64>() / own.sum::<f64>()
}

#[test]
fn a_sensor_that_was_stuck_far_away_for_a_while_leaves_coefficients_as_they_were() {
    for stuck in [10.0, 50.0, 1000.0] {
        for lasting in [3, 40] {
            let mut rows = rows(2, 1500);
            let clean = outputs(KALMAN, &rows);
            rows[500..500 + lasting]
                .iter_mut()
                .for_each(|row| row[0] = stuck);
            let found = outputs(KALMAN, &rows);
            // What became of a truth is told at the next tick.
            let told = &found[501..501 + lasting];
            assert!(
                told.iter()
                    .all(|of| [OUTSIDE, OUTLIER].contains(&(of[2] % 10.0)))
            );
            let (was, is) = (error(&rows, &clean, 700), error(&rows, &found, 700));
            assert!(is < 1.03 * was, "{stuck} for {lasting}: {is} after {was}");
            assert!((slope(&rows, &found, 700) - 3.0).abs() < 0.1);
        }
    }
}

#[test]
fn a_level_goes_on_while_a_sensor_is_dead_and_tells_that_nothing_else_is_learned() {
    let mut rows = rows(3, 600);
    rows[100..].iter_mut().for_each(|row| row[0] = 50.0);
    let found = outputs(KALMAN, &rows);
    // What the dead sensor told before is noise now.
    assert!(error(&rows, &found, 200) < 4.0);
    assert!(found[300..].iter().all(|of| of[2] % 10.0 == OUTSIDE));
    let wider = outputs(&format!("{KALMAN}\nlearn.margin = inf"), &rows);
    assert!(wider[300..].iter().any(|of| of[2] % 10.0 == LEARNED));
}

#[test]
fn truths_that_were_elsewhere_for_a_while_leave_nothing_behind() {
    for node in [KALMAN, RETURNING, TREND, RLS, SGD] {
        for size in [1e3, 1e6] {
            for lasting in [15, 20, 21, 25, 40] {
                let mut rows = rows(2, 1500);
                let clean = outputs(node, &rows);
                rows[500..500 + lasting]
                    .iter_mut()
                    .for_each(|row| row[2] += size);
                let found = outputs(node, &rows);
                let (was, is) = (error(&rows, &clean, 700), error(&rows, &found, 700));
                // Stochastic gradients hardly mend what a truth or two missed by when they told the level.
                let most = if node == SGD { 3.0 } else { 1.05 };
                assert!(
                    is < most * was,
                    "{node}: {size} for {lasting}: {is} after {was}"
                );
            }
        }
    }
}

#[test]
fn after_a_leap_the_deviation_is_large_until_the_next_truths_tell_where_the_level_is() {
    for node in [KALMAN, RETURNING, TREND] {
        let mut rows = rows(4, 600);
        rows[300..].iter_mut().for_each(|row| row[2] += 1e4);
        let found = outputs(node, &rows);
        // Of a leap of 1e4, a tenth is that of a mean whose level is gone at once.
        let large: Vec<usize> = (300..600).filter(|&nth| found[nth][1] > 3.0).collect();
        let first = large[0];
        assert!(first <= 321 && found[first][1] > 500.0, "{node}: {first}");
        assert!(found[301..first].iter().all(|of| of[2] % 10.0 == OUTLIER));
        // A trend, or a mean apart from its level, is told by one or two truths more.
        assert!(large.len() <= 3, "{node}: {large:?}");
    }
}

#[test]
fn an_offset_that_came_to_stay_is_the_mean_that_a_level_returns_to() {
    for size in [30.0, 1e3, 1e5] {
        let mut rows = rows(5, 1500);
        let clean = outputs(RETURNING, &rows);
        let was = error(&rows, &clean, 400);
        rows[300..].iter_mut().for_each(|row| row[2] += size);
        let found = outputs(RETURNING, &rows);
        let is = error(&rows, &found, 400);
        assert!(is < 1.05 * was, "{size}: {is} after {was}");
        // While no truth comes it returns to where truths are now.
        rows[800..1400].iter_mut().for_each(|row| row[2] = f64::NAN);
        let found = outputs(RETURNING, &rows);
        let off = found[1390][0] - 3.0 * rows[1390][0] - 0.5 * rows[1390][1] - size;
        assert!(off.abs() < 1.0, "{size}: {off}");
    }
}
