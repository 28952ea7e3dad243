//! Where times start again: windows and lags start afresh, what was learned stays.

use std::sync::Arc;

use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::Table;
use athermal::run::score::{ScoreOptions, score};

use super::{samples, slopes};
use crate::workbench::{Bench, Graph, linear, plan, secs};

fn graph() -> Graph {
    slopes()
        .model("ten", "linear", "temperature.room", "drift.Z", "5min")
        .model("still", "zero", "", "drift.Z", "5min")
        .model("motion", "ar", "", "drift.Z", "5min")
        .with("lags = ['1min']")
        .vote("vote", "auto_weighted", "ten still", "drift.Z")
        .with("memory = '15min'")
        .node("late", "delay", "position")
        .with("delay = '60s'")
        .outputs("out = 'vote'; motion = 'motion'; late = 'late'; also = 'gradients'")
}

fn fits() -> [(
    &'static str,
    std::sync::Arc<dyn athermal::core::node::Predictor>,
); 2] {
    [
        ("ten", linear(&[], 10.0)),
        ("motion", linear(&[("drift.Z lag 1min", 1.0)], 0.0)),
    ]
}

/// A stage that drifts at 10 nm/min, from an instant on.
fn drift(bench: &mut Bench, from: f64, ticks: u32, mut look: impl FnMut(&Bench, f64)) {
    for tick in 0..ticks {
        let since = 10.0 * f64::from(tick);
        bench.tick(
            from + since,
            &[("temperature.room", 21.0), ("position.Z", since / 6.0)],
        );
        look(bench, since);
    }
}

#[test]
fn windows_lags_and_delays_start_afresh_in_a_segment() {
    let mut bench = Bench::new(&graph(), &fits());
    drift(&mut bench, 5000.0, 100, |_, _| {});
    assert!(!bench.value("drift.Z").is_nan());
    bench.engine.segment();
    drift(&mut bench, 5.0, 60, |bench, since| {
        assert_eq!(bench.value("drift.Z").is_nan(), since < 300.0, "at {since}");
        assert_eq!(
            bench.value("motion.Z").is_nan(),
            since < 360.0,
            "at {since}"
        );
        assert_eq!(
            bench.value("gradients.room").is_nan(),
            since < 150.0,
            "at {since}"
        );
        let expected = if since < 60.0 {
            f64::NAN
        } else {
            (since - 60.0) / 6.0
        };
        assert_eq!(
            bench.value("late.Z").to_bits(),
            expected.to_bits(),
            "at {since}"
        );
    });
}

#[test]
fn the_memory_of_a_vote_stays_and_goes_on_ageing_from_the_new_clock() {
    let mut bench = Bench::new(&graph(), &fits());
    drift(&mut bench, 5000.0, 200, |_, _| {});
    assert!(
        (bench.value("vote.Z") - 10.0).abs() < 1e-9,
        "the voter without error has all weight"
    );
    bench.engine.segment();
    // In the new segment no drift is measured for a while. Truths of the last 15 min before the break count until they
    // are that old; with none left, the voters weigh alike.
    for tick in 0..120 {
        let now = 7.0 + 10.0 * f64::from(tick);
        bench.tick(now, &[("temperature.room", 21.0)]);
        let learned = now - 7.0 < 900.0;
        let expected = if learned { 10.0 } else { 5.0 };
        assert!(
            (bench.value("vote.Z") - expected).abs() < 1e-9,
            "at {now}: {}",
            bench.value("vote.Z")
        );
    }
}

#[test]
fn a_truth_never_belongs_to_a_run_of_another_segment() {
    let mut bench = Bench::new(&graph(), &fits());
    drift(&mut bench, 0.0, 100, |_, _| {});
    let mut other = Bench::new(&graph(), &fits());
    // Twenty minutes in the second segment are the same whatever the first one's last runs were, but for the memory.
    drift(&mut other, 0.0, 100, |_, _| {});
    bench.engine.segment();
    other.tick(995.0, &[("temperature.room", 150.0)]);
    other.engine.segment();
    let mut seen = Vec::new();
    drift(&mut bench, 0.0, 120, |bench, _| {
        seen.push(bench.value("vote.Z").to_bits())
    });
    let mut nth = 0;
    drift(&mut other, 0.0, 120, |other, _| {
        assert_eq!(other.value("vote.Z").to_bits(), seen[nth]);
        nth += 1;
    });
}

/// A prediction of a position a minute ahead, and a vote that tells the newest truth it was told of. No window has to warm
/// up, so that nothing but the break keeps a truth from a run before it.
fn a_minute_ahead() -> Graph {
    samples()
        .model("warm", "linear", "temperature.room", "position.Z", "60s")
        .vote("vote", "test_newest_arrival", "warm", "position.Z")
        .outputs("out = 'vote'")
}

/// Two segments of twenty ticks, the second of which goes on by the clock where the first ends.
const SEGMENT: u32 = 20;
/// Ticks within the horizon of a minute.
const AHEAD: u32 = 6;

#[test]
fn no_truth_after_a_break_is_told_for_a_run_before_it_though_the_clock_goes_on() {
    let warm = linear(&[("temperature.room", 1.0)], 0.0);
    let mut bench = Bench::new(&a_minute_ahead(), &[("warm", warm)]);
    let mut told = Vec::new();
    for tick in 0..2 * SEGMENT {
        if tick == SEGMENT {
            bench.engine.segment();
        }
        let samples = [("temperature.room", 21.0), ("position.Z", 3.0)];
        told.push(bench.tick(10.0 * f64::from(tick), &samples)[0]);
    }
    // A truth counts from the tick after the one that measured it; the first of a segment that has a run is the seventh.
    let expected = (0..2 * SEGMENT).map(|tick| {
        let newest = tick.saturating_sub(1);
        let in_segment = |newest: u32| newest % SEGMENT >= AHEAD;
        let newest = (0..=newest).rev().find(|&newest| in_segment(newest));
        newest.map_or(-1.0, |newest| 10.0 * f64::from(newest))
    });
    assert_eq!(told, expected.collect::<Vec<_>>());
}

#[test]
fn neither_fits_nor_scores_pair_over_a_break() {
    let plan = plan(&a_minute_ahead());
    let mut table = Table::default();
    for tick in 0..2 * SEGMENT {
        if tick == SEGMENT {
            table.segment();
        }
        let wave = (0.7 * f64::from(tick)).sin();
        let values = [21.0 + wave, f64::NAN, 100.0 * wave];
        table.push(secs(10.0 * f64::from(tick)), &values);
    }
    let (fitted, report) = fit(&plan, &table, &FitOptions::default(), &mut |_| {}).unwrap();
    let within = u64::from(2 * (SEGMENT - AHEAD));
    assert_eq!(report.estimators[0].rows, within);
    assert_eq!(
        report.estimators[0].dropped.without_run,
        u64::from(2 * AHEAD)
    );
    let plan = Arc::clone(&plan);
    let scores = score(
        &plan,
        &fitted,
        &table,
        &ScoreOptions::default(),
        &mut |_| {},
    )
    .unwrap();
    for score in scores.scores {
        assert_eq!(score.n as u64, within, "{}", score.output);
    }
}

#[test]
fn a_tick_out_of_order_is_refused_and_leaves_the_engine_as_it_was() {
    let run = |disturbed: bool| {
        let mut bench = Bench::new(&graph(), &fits());
        let mut bits = Vec::new();
        for tick in 0..150 {
            let now = 10.0 * f64::from(tick);
            let samples = [
                ("temperature.room", 21.0 + now.sin()),
                ("position.Z", now / 6.0),
            ];
            bits.extend(
                bench
                    .tick(now, &samples)
                    .iter()
                    .map(|value| value.to_bits()),
            );
            if disturbed && tick % 5 == 0 {
                let wrong = [("temperature.room", 999.0), ("position.Z", 1e6)];
                assert!(bench.try_tick(now, &wrong).is_err(), "the same time again");
                assert!(bench.try_tick(now - 3.0, &wrong).is_err(), "a time before");
            }
        }
        (
            bits,
            bench.engine.refused(),
            bench.engine.rejected().to_vec(),
        )
    };
    let (plain, disturbed) = (run(false), run(true));
    assert_eq!((plain.1, disturbed.1), (0, 60));
    assert_eq!(plain.0, disturbed.0);
    assert_eq!(plain.2, disturbed.2);
}
