//! What exponential weights promise: to lose little to the best voter, whatever comes and in whatever unit.

use athermal_combiners::Hedge;
use athermal_core::node::{Combine, Combiner, Restored, State, Votes};
use athermal_core::time::{Duration, Instant};

fn hedge(rate: Option<f64>, half_life: Option<Duration>, floor: f64) -> Hedge {
    Hedge {
        rate,
        half_life,
        floor,
    }
}

fn s(seconds: i64) -> Instant {
    Instant::from_ns(seconds * 1_000_000_000)
}

/// A small generator, so that the series are the same on every machine.
struct Random(u64);

impl Random {
    /// From 0 to below 1.
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// What a vote lost in squared errors beyond the best voter, and what it may.
struct Regret {
    found: f64,
    allowed: f64,
}

/// Votes of four voters for truths of zero, each known before the next vote.
fn regret(parameters: &Hedge, rows: impl IntoIterator<Item = [f64; 4]>) -> Regret {
    let mut running = parameters.build(4);
    let (mut lost, mut of_each) = (0.0, [0.0; 4]);
    let (mut widest, mut variances): (f64, f64) = (0.0, 0.0);
    for (row, votes) in rows.into_iter().enumerate() {
        let mut weights = [0.0; 4];
        running.weights(Votes(&votes), &mut weights);
        let losses = votes.map(|vote| vote * vote);
        let mean: f64 = weights.iter().zip(losses).map(|(w, l)| w * l).sum();
        let variance = weights
            .iter()
            .zip(losses)
            .map(|(w, l)| w * (l - mean).powi(2));
        variances += variance.sum::<f64>();
        let most = losses.iter().copied().fold(0.0, f64::max);
        let least = losses.iter().copied().fold(f64::INFINITY, f64::min);
        widest = widest.max(most - least);
        lost += running.combine(Votes(&votes)).powi(2);
        for (sum, loss) in of_each.iter_mut().zip(losses) {
            *sum += loss;
        }
        running.observe(Votes(&votes), 0.0, s(row as i64));
    }
    let best = of_each.iter().copied().fold(f64::INFINITY, f64::min);
    let n = 4.0_f64.ln();
    Regret {
        found: lost - best,
        allowed: 2.0 * (variances * n).sqrt() + widest * (4.0 / 3.0 * n + 2.0),
    }
}

/// Votes made to mislead: whoever has lost least so far is wrong next, all to one side, so that no mean helps.
fn misleading(rows: usize, size: f64) -> Vec<[f64; 4]> {
    let mut lost = [0.0_f64, 0.1, 0.2, 0.3];
    let mut all = Vec::new();
    for _ in 0..rows {
        let best = (0..4).min_by(|&a, &b| lost[a].total_cmp(&lost[b])).unwrap();
        let votes = std::array::from_fn(|i| if i == best { size } else { 0.0 });
        lost[best] += 1.0;
        all.push(votes);
    }
    all
}

fn wild(rows: usize, size: f64) -> Vec<[f64; 4]> {
    let mut random = Random(7);
    let mut vote =
        |i: usize| size * (1.0 + 0.02 * i as f64) * random.next() / (0.01 + random.next());
    (0..rows).map(|_| std::array::from_fn(&mut vote)).collect()
}

#[test]
fn what_is_lost_to_the_best_voter_is_within_the_stated_bound_whatever_the_unit() {
    for size in [1e-9, 1.0, 1e9] {
        for (name, rows) in [
            ("misleading", misleading(3000, size)),
            ("wild", wild(3000, size)),
        ] {
            let Regret { found, allowed } = regret(&hedge(None, None, 0.0), rows);
            assert!(found <= allowed, "{name} {size}: {found} beyond {allowed}");
        }
    }
}

#[test]
fn following_the_leader_is_beyond_the_bound_so_that_the_bound_means_something() {
    let Regret { found, allowed } = regret(&hedge(Some(100.0), None, 0.0), misleading(3000, 1.0));
    assert!(found > allowed, "{found} is within {allowed}");
}

#[test]
fn a_stated_rate_keeps_its_own_bound_once_the_size_of_errors_has_shown() {
    let (rows, rate) = (2000_usize, 0.05);
    let Regret { found, .. } = regret(&hedge(Some(rate), None, 0.0), misleading(rows, 1.0));
    let allowed = 4.0_f64.ln() / rate + rate * rows as f64 / 8.0;
    assert!(found <= allowed, "{found} beyond {allowed}");
}

#[test]
fn the_unit_of_errors_leaves_the_weights_as_they_are() {
    let after = |size: f64| {
        let mut running = hedge(None, None, 0.0).build(4);
        for (row, votes) in wild(200, size).into_iter().enumerate() {
            running.observe(Votes(&votes), 0.0, s(row as i64));
        }
        let mut weights = [0.0; 4];
        running.weights(Votes(&[1.0; 4]), &mut weights);
        weights
    };
    for (a, b) in after(1.0).iter().zip(after(1e7)) {
        assert!((a - b).abs() < 1e-9, "{a} and {b}");
    }
}

#[test]
fn before_the_first_truth_all_weights_are_equal_and_add_up_to_one() {
    let running = hedge(None, None, 0.0).build(4);
    assert_eq!(running.combine(Votes(&[1.0, 2.0, 3.0, f64::NAN])), 2.0);
    assert!(running.combine(Votes(&[f64::NAN; 4])).is_nan());
}

#[test]
fn a_voter_that_was_away_is_owed_what_it_was() {
    let mut running = hedge(Some(1.0), None, 0.0).build(3);
    running.observe(Votes(&[1.0, 2.0, 3.0]), 0.0, s(0));
    let weights = |running: &dyn Combine| {
        let mut weights = [0.0; 3];
        running.weights(Votes(&[0.0; 3]), &mut weights);
        weights
    };
    let before = weights(&*running);
    for row in 1..50 {
        running.observe(Votes(&[1.0, 2.0, f64::NAN]), 0.0, s(row));
    }
    let after = weights(&*running);
    assert!((after[2] - before[2]).abs() < 1e-12, "{before:?} {after:?}");
    assert!(after[0] > before[0] + 0.05, "{before:?} {after:?}");
}

#[test]
fn a_voter_that_was_away_when_all_others_were_wrong_comes_back() {
    let mut running = hedge(None, None, 0.0).build(3);
    for row in 0..1500 {
        running.observe(Votes(&[1.0, 100.0, 3.0]), 0.0, s(row));
    }
    running.observe(Votes(&[20_000.0, 100.0, f64::NAN]), 0.0, s(1500));
    assert_eq!(running.combine(Votes(&[f64::NAN, f64::NAN, 5.0])), 5.0);
    for row in 1501..3000 {
        running.observe(Votes(&[20_000.0, 100.0, 3.0]), 0.0, s(row));
    }
    let mut weights = [0.0; 3];
    running.weights(Votes(&[0.0; 3]), &mut weights);
    assert!(weights[2] > 0.5, "{weights:?}");
}

#[test]
fn losses_that_cannot_have_been_are_not_taken_up() {
    let parameters = hedge(None, None, 0.0);
    let mut running = parameters.build(3);
    running.observe(Votes(&[1.0, 2.0, 3.0]), 0.0, s(0));
    let kept = serde_json::to_string(&running.snapshot().unwrap()).unwrap();
    for wrong in ["-3.0", "-1e-9"] {
        let broken = kept.replacen("\"sums\":[0.0", &format!("\"sums\":[{wrong}"), 1);
        assert_ne!(broken, kept);
        let broken: serde_json::Value = serde_json::from_str(&broken).unwrap();
        let state = <dyn State>::read(&rmp_serde::to_vec_named(&broken).unwrap()).unwrap();
        let restored = parameters.build(3).restore(state);
        assert!(matches!(restored, Restored::Cold { .. }), "{restored:?}");
    }
}

#[test]
fn forgetting_lets_a_voter_take_its_turn() {
    let minute = Duration::from_ns(60_000_000_000);
    let turned = |half_life: Option<Duration>| {
        let mut running = hedge(None, half_life, 0.0).build(2);
        for row in 0..400 {
            let votes = if row < 300 { [0.1, 1.0] } else { [1.0, 0.1] };
            running.observe(Votes(&votes), 0.0, s(10 * row));
        }
        let mut weights = [0.0; 2];
        running.weights(Votes(&[0.0; 2]), &mut weights);
        weights[1]
    };
    assert!(turned(Some(minute)) > 0.9, "{}", turned(Some(minute)));
    assert!(turned(None) < 0.1, "{}", turned(None));
}

#[test]
fn errors_of_nothing_and_beyond_all_numbers_leave_finite_weights() {
    for rate in [None, Some(1.0)] {
        let mut running = hedge(rate, None, 0.05).build(3);
        for votes in [
            [0.0; 3],
            [1e-200, 0.0, 1e100],
            [1e200, 0.0, 1.0],
            [0.0, 1.0, 1e-30],
        ] {
            running.observe(Votes(&votes), 0.0, s(0));
            let mut weights = [0.0; 3];
            running.weights(Votes(&[1.0; 3]), &mut weights);
            let sum: f64 = weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-12, "{rate:?} {weights:?}");
            assert!(weights.iter().all(|&weight| weight >= 0.05), "{weights:?}");
        }
    }
}

#[test]
fn what_was_lost_goes_on_after_a_restart_with_the_same_bits() {
    let parameters = hedge(None, None, 0.0);
    let (mut first, mut second) = (parameters.build(4), parameters.build(4));
    let rows = wild(100, 3.0);
    for (row, votes) in rows.iter().enumerate() {
        if row == 50 {
            second.restore(first.snapshot().unwrap());
        }
        if row >= 50 {
            second.observe(Votes(votes), 0.0, s(row as i64));
        }
        first.observe(Votes(votes), 0.0, s(row as i64));
    }
    let votes = Votes(&[1.0, 2.0, 3.0, 4.0]);
    assert_eq!(
        first.combine(votes).to_bits(),
        second.combine(votes).to_bits()
    );
}
