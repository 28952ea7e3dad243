//! When nothing is learned, and what the port `learning` says of it.

use super::world::{RLS, Row, SGD, engine, error, graph, rows, run, same};
use crate::workbench::secs;

const NAN: f64 = f64::NAN;

#[test]
fn what_learns_follows_a_change_and_what_does_not_stays_wrong() {
    let rows = rows(2, 1500, 300);
    for node in [RLS, SGD] {
        let mut learning = engine(&graph(node));
        let learned = run(&mut learning, 0, &rows);
        assert!(
            error(&rows[..300], &learned[..298], 0) < 0.12,
            "{node} before the change"
        );
        let after = error(&rows, &learned, 900);
        let mut frozen = engine(&graph(node));
        frozen.freeze(true);
        let stayed = run(&mut frozen, 0, &rows);
        let wrong = error(&rows, &stayed, 900);
        // Of one that goes back to a tenth of its fit an eleventh of the change is left.
        let most = if node == RLS { 0.12 * wrong } else { 0.13 };
        assert!(wrong > 1.0 && after < most, "{node}: {after} of {wrong}");
        let off = node.replace("learn = { outliers = 6.0, margin = 0.5 }", "learn = false");
        let text = graph(&off).replace("learning = \"model:learning\"\n", "");
        let never = run(&mut engine(&text), 0, &rows);
        let same_prediction = |(a, b): (&Vec<f64>, &Vec<f64>)| (a[0] - b[0]).abs() < 1e-12;
        assert!(
            stayed.iter().zip(&never).all(same_prediction),
            "{node}: frozen is as fitted"
        );
    }
}

#[test]
fn predicting_changes_nothing_that_was_learned() {
    let all = rows(3, 400, 200);
    let mut quiet: Vec<Row> = all.clone();
    quiet[250..350].iter_mut().for_each(|row| row[2] = NAN);
    let mut gap = engine(&graph(RLS));
    run(&mut gap, 0, &quiet[..260]);
    let probe = quiet[260];
    // The same row asked again and again, without a truth: the same answer, once what was on its way has arrived.
    let answers = run(&mut gap, 260, &[probe; 30]);
    let late = &answers[10..];
    assert!(
        late.iter()
            .all(|answer| answer[0].to_bits() == late[0][0].to_bits())
    );
}

#[test]
fn learning_freezes_on_command_and_goes_on_after_it() {
    let rows = rows(4, 900, 300);
    let mut engine = engine(&graph(&RLS.replace("6.0", "inf")));
    run(&mut engine, 0, &rows[..300]);
    engine.freeze(true);
    let before = engine.snapshot();
    let frozen = run(&mut engine, 300, &rows[300..600]);
    assert_ne!(engine.snapshot(), before);
    assert!(
        frozen[3..].iter().all(|outputs| outputs[1] % 10.0 == 1.0),
        "the port says so"
    );
    assert!(error(&rows[300..600], &frozen[..298], 0) > 1.0);
    engine.freeze(false);
    let thawed = run(&mut engine, 600, &rows[600..]);
    // Nothing that was seen while frozen is learned afterwards: neither rows nor truths.
    let codes: Vec<f64> = thawed.iter().map(|outputs| outputs[1] % 10.0).collect();
    assert_eq!(&codes[..6], [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    let wrong = error(&rows[300..600], &frozen[..298], 0);
    assert!(error(&rows[600..], &thawed, 200) < 0.15 * wrong);
}

#[test]
fn a_channel_freezes_learning_while_it_is_not_zero_or_not_there() {
    let node = format!("{RLS}\ninputs.freeze = \"hold\"");
    let mut held = rows(5, 700, 200);
    let open = run(&mut engine(&graph(&node)), 0, &held);
    assert!(
        open[10..]
            .iter()
            .all(|outputs| outputs[1] % 10.0 == 0.0 || outputs[1] % 10.0 == 3.0)
    );
    for door in [1.0, -1.0, NAN] {
        held[200..].iter_mut().for_each(|row| row[3] = door);
        let outputs = run(&mut engine(&graph(&node)), 0, &held);
        // A door that is silent counts as it was for its maximum age of 30 s.
        assert!(
            outputs[210..]
                .iter()
                .all(|outputs| outputs[1] % 10.0 == 2.0)
        );
        assert!(error(&held, &outputs, 400) > 1.0);
    }
}

#[test]
fn outliers_strange_rows_and_gaps_are_told_and_leave_no_trace() {
    let clean = rows(6, 400, usize::MAX);
    let text = graph(&format!(
        "{RLS}\ntrain.abs_truth = {{ below = \"100 nm\" }}"
    ));
    // A truth that has no value at this tick is the row that the others are compared with.
    let without = |at: usize| {
        let mut rows = clean.clone();
        rows[at][2] = NAN;
        run(&mut engine(&text), 0, &rows)
    };
    for (code, at, spoil) in [
        (3.0, 200, (2, 30.0)),
        (5.0, 200, (2, 150.0)),
        (4.0, 198, (0, 50.0)),
        (6.0, 198, (1, NAN)),
    ] {
        let mut rows = clean.clone();
        rows[at][spoil.0] = spoil.1;
        if code == 6.0 {
            // Nor a value to be held.
            rows[190..=at].iter_mut().for_each(|row| row[1] = NAN);
        }
        let outputs = run(&mut engine(&text), 0, &rows);
        // The truth of row 200 is told at the next tick.
        assert_eq!(outputs[201][1] % 10.0, code);
        if code != 6.0 {
            assert!(
                same_predictions(&outputs[201..], &without(200)[201..]),
                "{code}"
            );
        }
    }
}

#[test]
fn an_outlier_among_the_first_truths_is_held_off_by_what_the_fit_was_off_by() {
    let mut rows = rows(6, 60, usize::MAX);
    rows[4][2] = 1e6;
    for node in [RLS, SGD] {
        let outputs = run(&mut engine(&graph(node)), 0, &rows);
        let told: Vec<f64> = outputs[3..8]
            .iter()
            .map(|outputs| outputs[1] % 10.0)
            .collect();
        assert_eq!(told, [0.0, 0.0, 3.0, 0.0, 0.0], "{node}");
        assert!(error(&rows, &outputs, 20) < 0.3, "{node}");
    }
}

/// The same predictions but where the input itself was spoilt.
fn same_predictions(a: &[Vec<f64>], b: &[Vec<f64>]) -> bool {
    let only = |run: &[Vec<f64>]| {
        run.iter()
            .map(|outputs| vec![outputs[0]])
            .collect::<Vec<_>>()
    };
    same(&only(a), &only(b))
}

#[test]
fn a_segment_break_keeps_what_was_learned_and_pairs_nothing_across() {
    let rows = rows(7, 1200, 300);
    let mut engine = engine(&graph(RLS));
    run(&mut engine, 0, &rows[..900]);
    engine.segment();
    // The clock begins again.
    let mut step = |tick: usize| {
        engine
            .step(secs(10.0 * tick as f64), &rows[900 + tick])
            .unwrap()
            .to_vec()
    };
    let outputs: Vec<_> = (0..300).map(&mut step).collect();
    // An eleventh of a change by ten is left.
    assert!(error(&rows[900..], &outputs, 0) < 1.5);
    assert!(outputs[0][1].is_nan() && outputs[1][1].is_nan() && outputs[2][1].is_nan());
}
