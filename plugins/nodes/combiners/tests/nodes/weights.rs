//! The weights of the auto-weighted vote against the oracle, and what absent and new voters do to them.

use std::path::{Path, PathBuf};

use athermal_combiners::{AutoWeighted, Memory, Weighting};
use athermal_core::node::{Combine, Combiner, Votes};
use athermal_core::time::{Duration, Instant};

fn s(seconds: i64) -> Instant {
    Instant::from_ns(seconds * 1_000_000_000)
}

fn vote(memory_s: i64, power: f64, weights: Weighting) -> AutoWeighted {
    AutoWeighted {
        memory: Memory::Time(Duration::from_ns(memory_s * 1_000_000_000)),
        power: Some(power),
        weights,
        shrinkage: 0.0,
        floor: 0.0,
    }
}

/// A table of the oracles as numbers, or nothing, with a remark, where this machine lacks it.
fn table(file: &str) -> Option<Vec<Vec<f64>>> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../../shared");
    let folder = std::env::var_os("ATHERMAL_SHARED").map_or_else(beside, PathBuf::from);
    let path = folder.join("oracles/ensemble_weights").join(file);
    let Ok(text) = std::fs::read_to_string(&path) else {
        eprintln!("skipped: no {}", path.display());
        return None;
    };
    let row = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect();
    Some(text.lines().skip(1).map(row).collect())
}

/// Follows the rows of the oracle with a memory of twelve of them, and compares each vote with a column.
fn follow(weights: Weighting, column: usize) {
    let (Some(input), Some(expected)) = (table("input.csv"), table("expected.csv")) else {
        return;
    };
    let mut running = vote(12, 2.0, weights).build(3);
    let mut compared = 0;
    for (row, values) in (0..).zip(&input) {
        running.advance(s(row - 1));
        if let Some(expected) = expected.iter().find(|expected| expected[0] == row as f64) {
            let found = running.combine(Votes(&values[1..]));
            let expected = expected[column];
            assert!(
                (found - expected).abs() <= 1e-12 * expected.abs().max(1.0),
                "row {row}: {found} for {expected}"
            );
            compared += 1;
        }
        running.observe(Votes(&values[1..]), values[0], s(row));
    }
    assert_eq!(compared, expected.len());
}

#[test]
fn oracle_of_the_inverse_square() {
    follow(Weighting::InversePower, 15);
}

#[test]
fn oracle_of_the_printed_formula() {
    follow(Weighting::AsPrintedRaw, 7);
}

#[test]
fn oracle_of_the_printed_formula_normalised() {
    follow(Weighting::AsPrinted, 11);
}

/// Errors of 1, 2 and 4 for voters of an earlier truth.
fn learned(parameters: &AutoWeighted, votes: &[f64]) -> Box<dyn Combine> {
    let mut running = parameters.build(votes.len());
    running.observe(Votes(votes), 0.0, s(0));
    running.advance(s(0));
    running
}

#[test]
fn an_absent_voter_drops_out_and_the_rest_are_renormalised() {
    let running = learned(&vote(900, 2.0, Weighting::InversePower), &[1.0, 2.0, 4.0]);
    let weights = [1.0, 1.0 / 4.0, 1.0 / 16.0];
    let all = running.combine(Votes(&[10.0, 20.0, 30.0]));
    let expected =
        (10.0 * weights[0] + 20.0 * weights[1] + 30.0 * weights[2]) / weights.iter().sum::<f64>();
    assert!((all - expected).abs() < 1e-12);
    let without = running.combine(Votes(&[f64::NAN, 20.0, 30.0]));
    let expected = (20.0 * weights[1] + 30.0 * weights[2]) / (weights[1] + weights[2]);
    assert!((without - expected).abs() < 1e-12);
    assert_eq!(running.combine(Votes(&[f64::NAN, f64::NAN, 30.0])), 30.0);
    assert!(running.combine(Votes(&[f64::NAN; 3])).is_nan());
}

#[test]
fn a_voter_without_errors_takes_the_mean_weight_of_the_others() {
    let running = learned(
        &vote(900, 2.0, Weighting::InversePower),
        &[1.0, 2.0, f64::NAN],
    );
    let weights = [1.0, 1.0 / 4.0, (1.0 + 1.0 / 4.0) / 2.0];
    let expected =
        (10.0 * weights[0] + 20.0 * weights[1] + 30.0 * weights[2]) / weights.iter().sum::<f64>();
    let found = running.combine(Votes(&[10.0, 20.0, 30.0]));
    assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
}

#[test]
fn without_any_errors_all_weights_are_equal_whatever_the_form() {
    for weights in [
        Weighting::InversePower,
        Weighting::AsPrinted,
        Weighting::AsPrintedRaw,
    ] {
        let running = vote(900, 2.0, weights).build(3);
        assert!(
            (running.combine(Votes(&[10.0, 20.0, 60.0])) - 30.0).abs() < 1e-12,
            "{weights:?}"
        );
        assert!(
            (running.combine(Votes(&[10.0, f64::NAN, 60.0])) - 35.0).abs() < 1e-12,
            "{weights:?}"
        );
    }
}

#[test]
fn without_any_vote_there_is_none_however_weights_are_kept_from_extremes() {
    for (shrinkage, floor) in [(0.0, 0.0), (0.3, 0.0), (0.0, 0.2), (0.3, 0.2)] {
        let parameters = AutoWeighted {
            shrinkage,
            floor,
            ..vote(900, 2.0, Weighting::InversePower)
        };
        let found = parameters.build(2).combine(Votes(&[f64::NAN; 2]));
        assert!(found.is_nan(), "{shrinkage} {floor}: {found}");
    }
}

#[test]
fn the_power_says_how_strongly_errors_count() {
    for power in [0.0, 1.0, 2.0, 3.5] {
        let running = learned(&vote(900, power, Weighting::InversePower), &[1.0, 2.0]);
        let weight = 0.5_f64.powf(power);
        let expected = (10.0 + 20.0 * weight) / (1.0 + weight);
        let found = running.combine(Votes(&[10.0, 20.0]));
        assert!(
            (found - expected).abs() < 1e-12,
            "{power}: {found} for {expected}"
        );
    }
}

#[test]
fn a_power_that_is_stated_is_for_inverse_powers() {
    for weights in [Weighting::AsPrinted, Weighting::AsPrintedRaw] {
        let mistakes = vote(900, 3.0, weights).mistakes();
        assert_eq!(mistakes.len(), 1, "{mistakes:?}");
        let without = AutoWeighted {
            power: None,
            ..vote(900, 3.0, weights)
        };
        assert!(without.mistakes().is_empty());
    }
    assert!(
        vote(900, 3.0, Weighting::InversePower)
            .mistakes()
            .is_empty()
    );
}

#[test]
fn memory_is_open_at_its_beginning_and_counts_from_the_newest_truth_let_through() {
    let mut running = vote(10, 2.0, Weighting::InversePower).build(2);
    running.observe(Votes(&[1.0, 100.0]), 0.0, s(0));
    running.advance(s(9));
    assert!(
        (running.combine(Votes(&[10.0, 20.0])) - 10.0).abs() < 0.01,
        "(−1 s, 9 s] holds the truth of 0 s"
    );
    running.advance(s(10));
    assert_eq!(
        running.combine(Votes(&[10.0, 20.0])),
        15.0,
        "(0 s, 10 s] does not"
    );
}

#[test]
fn errors_of_nothing_and_of_ten_to_the_hundred_leave_finite_weights() {
    let running = learned(&vote(900, 2.0, Weighting::InversePower), &[0.0, 1.0, 1e100]);
    assert!((running.combine(Votes(&[10.0, 20.0, 30.0])) - 10.0).abs() < 1e-9);
    let running = learned(&vote(900, 16.0, Weighting::InversePower), &[1e-30, 1e100]);
    assert_eq!(running.combine(Votes(&[10.0, 20.0])), 10.0);
    let running = learned(&vote(900, 2.0, Weighting::AsPrinted), &[0.0, 0.0]);
    assert_eq!(running.combine(Votes(&[10.0, 20.0])), 15.0);
}

#[test]
fn as_printed_voters_without_an_error_count_like_voters_with_the_same() {
    for errors in [[0.0, 0.0], [3.0, 3.0]] {
        let running = learned(&vote(900, 2.0, Weighting::AsPrintedRaw), &errors);
        // (1/2)² each.
        let found = running.combine(Votes(&[10.0, 20.0]));
        assert!((found - 7.5).abs() < 1e-12, "{errors:?}: {found}");
    }
}

#[test]
fn a_great_error_leaves_no_trace_once_it_is_forgotten() {
    let parameters = vote(10, 2.0, Weighting::InversePower);
    let (mut plain, mut shocked) = (parameters.build(2), parameters.build(2));
    shocked.observe(Votes(&[1e9, 3.0]), 0.0, s(0));
    plain.observe(Votes(&[1.0, 3.0]), 0.0, s(0));
    for running in [&mut plain, &mut shocked] {
        running.observe(Votes(&[1.1, 2.7]), 0.0, s(5));
        running.advance(s(10));
    }
    let votes = Votes(&[10.0, 20.0]);
    assert_eq!(
        plain.combine(votes).to_bits(),
        shocked.combine(votes).to_bits()
    );
}

/// Weights are kept from tick to tick; a node that has just been told all that there is has none that are kept.
#[test]
fn a_vote_that_has_run_for_long_weighs_as_one_that_has_just_begun() {
    for memory in [
        Memory::Time(Duration::from_ns(20_000_000_000)),
        serde_json::from_str(r#"{ "truths": 4 }"#).unwrap(),
        serde_json::from_str(r#"{ "half_life": "5s" }"#).unwrap(),
    ] {
        let parameters = AutoWeighted {
            memory,
            ..vote(1, 2.0, Weighting::InversePower)
        };
        let mut long = parameters.build(3);
        let mut told: Vec<(i64, [f64; 3])> = Vec::new();
        for t in 0..300_i64 {
            let number = |nth: i64| ((t * (nth + 3) * 7919) % 101) as f64 / 7.0;
            let votes = [0, 1, 2].map(|nth| match (t / 5 + nth) % 4 {
                0 => f64::NAN,
                _ => number(nth),
            });
            let mut short = parameters.build(3);
            for (at, votes) in &told {
                short.observe(Votes(votes), 1.0, s(*at));
            }
            for vote in [&mut long, &mut short] {
                vote.advance(s(t));
            }
            let [kept, anew] = [&long, &short].map(|vote| vote.combine(Votes(&votes)));
            assert_eq!(kept.to_bits(), anew.to_bits(), "at {t} s: {kept}, {anew}");
            if t % 3 == 0 && t % 100 < 60 {
                long.observe(Votes(&votes), 1.0, s(t));
                told.push((t, votes));
            }
        }
    }
}

#[test]
fn a_truth_so_large_that_its_squares_are_no_numbers_does_not_silence_the_vote() {
    for memory in [r#""10min""#, r#"{ "half_life": "5min" }"#] {
        let mut running = AutoWeighted {
            memory: serde_json::from_str(memory).unwrap(),
            ..vote(1, 2.0, Weighting::InversePower)
        }
        .build(2);
        running.observe(Votes(&[1.0, 2.0]), 1.0, s(0));
        running.observe(Votes(&[1.0, 2.0]), 1e200, s(10));
        running.observe(Votes(&[1.0, 2.0]), 1.1, s(20));
        let vote = running.combine(Votes(&[1.0, 2.0]));
        assert!((1.0..1.1).contains(&vote), "{memory}: {vote}");
    }
}
