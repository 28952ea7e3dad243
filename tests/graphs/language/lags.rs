//! Lags count back from the instant of the run; the value is the last one at or before.

use super::{samples, slopes};
use crate::workbench::{Bench, Graph, linear};

fn endogenous(truth: &str, ahead: &str, lag: &str) -> Graph {
    slopes()
        .model("motion", "ar", "", truth, ahead)
        .with(&format!("lags = ['{lag}']"))
        .model("same", "persistence", "", truth, ahead)
        .outputs("out = ['motion']; same = 'same'; also = 'gradients'")
}

/// Instants of positions: irregular, from 40 s to 230 s apart, none on a whole ten seconds after the first.
fn measured() -> Vec<f64> {
    let mut times = vec![0.0];
    while times[times.len() - 1] < 4000.0 {
        let n = times.len();
        times.push(times[n - 1] + 40.0 + (n * 67 % 191) as f64 + 0.5);
    }
    times
}

/// Steps every ten seconds and at every position, and hands each instant to `check`.
fn walk(bench: &mut Bench, mut check: impl FnMut(&Bench, f64, &[(f64, f64)])) {
    let positions = measured();
    let mut instants: Vec<f64> = (0..400).map(|tick| 10.0 * f64::from(tick)).collect();
    instants.extend(&positions);
    instants.sort_by(f64::total_cmp);
    instants.dedup();
    let mut known = Vec::new();
    for now in instants {
        if positions.contains(&now) {
            let value = 5.0 + now.sqrt();
            known.push((now, value));
            bench.tick(now, &[("position.Z", value)]);
        } else {
            bench.tick(now, &[("temperature.room", 21.0)]);
        }
        check(bench, now, &known);
    }
}

/// The last position at or before an instant that is not older, counted from there, than the signal's `max_age`.
fn last(known: &[(f64, f64)], asked: f64) -> Option<(f64, f64)> {
    let found = known.iter().copied().rfind(|(at, _)| *at <= asked);
    found.filter(|(at, _)| asked - at <= 180.0)
}

#[test]
fn a_lag_counts_from_the_instant_of_the_run_and_takes_the_last_value_at_or_before() {
    let fit = linear(&[("position.Z lag 5min", 1.0)], 0.0);
    let mut bench = Bench::new(&endogenous("position.Z", "0s", "5min"), &[("motion", fit)]);
    let (mut there, mut absent) = (0, 0);
    walk(&mut bench, |bench, now, known| {
        let expected = last(known, now - 300.0);
        let found = bench.value("motion.Z");
        match expected {
            Some((at, value)) => {
                assert_eq!(found, value, "at {now}");
                assert_eq!(
                    bench.stamp("motion.Z"),
                    at + 300.0,
                    "the stamp moves with the value"
                );
                there += 1;
            }
            None => {
                assert!(found.is_nan(), "at {now}: {found}");
                absent += 1;
            }
        }
    });
    assert!(there > 200 && absent > 30, "{there} and {absent}");
}

#[test]
fn persistence_of_plain_samples_is_the_sample_before() {
    let mut bench = Bench::new(&endogenous("position.Z", "0s", "5min"), &[]);
    walk(&mut bench, |bench, now, known| {
        let before: Vec<_> = known.iter().copied().filter(|(at, _)| *at < now).collect();
        let expected = last(&before, now - 1e-9);
        assert_eq!(
            bench.value("same.Z").to_bits(),
            expected.map_or(f64::NAN, |(_, value)| value).to_bits(),
            "at {now}"
        );
    });
}

/// Persistence of a slope over five minutes is the slope at this lag.
fn check_persistence(ahead: &str, lag_s: f64) {
    let fit = linear(&[], 0.0);
    let mut bench = Bench::new(&endogenous("drift.Z", ahead, "30min"), &[("motion", fit)]);
    let mut drifts: Vec<(f64, f64)> = Vec::new();
    let mut compared = 0;
    walk(&mut bench, |bench, now, _| {
        if bench.ran("drift.Z") {
            drifts.push((now, bench.value("drift.Z")));
        }
        let asked = now - lag_s;
        let held = drifts.iter().copied().rfind(|(at, _)| *at <= asked);
        let expected = held
            .filter(|(at, _)| asked - at <= 300.0)
            .map_or(f64::NAN, |(_, value)| value);
        let found = bench.value("same.Z");
        assert!(
            found == expected || (found.is_nan() && expected.is_nan()),
            "at {now}: {found} for {expected}"
        );
        compared += usize::from(!expected.is_nan());
    });
    assert!(compared > 100, "{compared}");
}

#[test]
fn persistence_of_a_slope_is_the_one_at_the_smallest_lag_that_shares_nothing() {
    check_persistence("0s", 300.0);
    check_persistence("150s", 150.0);
    check_persistence("5min", 0.0);
    check_persistence("10min", 0.0);
}

/// A spike filter gives nothing at 40 s for the room. Nodes behind it hear of it, whether the chuck has a sample there or not.
#[test]
fn what_becomes_of_a_channel_does_not_depend_on_whether_another_is_fresh() {
    let text = samples()
        .node("calm", "hampel", "temperature")
        .with("window = '2min'; floor = '100 mK'")
        .node("past", "lag", "calm")
        .with("lags = ['10s']")
        .node("step", "difference", "calm")
        .node("over", "difference", "calm")
        .with("over = '10s'")
        .node("scaled", "scale", "calm")
        .with("factor = 2.0")
        .node("kept", "minimum_difference", "calm")
        .with("difference = '1 nK'")
        .node("again", "hampel", "calm")
        .with("window = '2min'")
        .outputs("past = 'past'; step = 'step'; over = 'over'; scaled = 'scaled'; kept = 'kept'")
        .with("again = 'again'");
    for beside in [false, true] {
        let mut bench = Bench::new(&text, &[]);
        for tick in 0..=6 {
            let now = 10.0 * f64::from(tick);
            let room = if tick == 4 { 95.0 } else { 20.0 + 0.001 * now };
            let both = [("temperature.room", room), ("temperature.chuck", 5.0)];
            let there = if beside || tick != 4 { 2 } else { 1 };
            bench.tick(now, &both[..there]);
            assert_eq!(bench.value("calm.room").is_nan(), tick == 4, "at {now}");
            for channel in ["past.room", "step.room", "over.room"] {
                let expected = bench.ran(channel) && !bench.value(channel).is_nan();
                let at = format!("{channel} at {now}, beside {beside}");
                assert_eq!(expected, ![0, 4, 5].contains(&tick), "{at}");
            }
            for channel in ["scaled.room", "kept.room", "again.room"] {
                let at = format!("{channel} at {now}, beside {beside}");
                assert!(bench.ran(channel), "{at}");
                assert_eq!(bench.value(channel).is_nan(), tick == 4, "{at}");
            }
        }
    }
}
