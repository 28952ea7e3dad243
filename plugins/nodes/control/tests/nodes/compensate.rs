//! The correction: its integral, its limits, and when it does not move.

use super::machine::{Machine, NONE, compiled, goes_on_alike};
use proptest::prelude::*;

const GRAPH: &str = r#"
[signals.rate]
unit = "nm/min"
channels = ["Z"]
max_age = "5s"
[signals.mark]
unit = "1"
channels = ["again"]
[signals.stability]
unit = "1"
channels = ["Z"]
max_age = "1h"
[nodes.compensate]
type = "compensate"
inputs = { rate = "rate", state = "stability", realigned = "mark" }
range = "100 nm"
max_rate = "600 nm/min"
max_slew = "10 nm/s"
stop_in = ["stable"]
stop = { below = "3 nm/min", above = "6 nm/min" }
deadband = "4 nm/min"
[outputs]
c = "compensate"
why = "compensate:why"
"#;

/// Steps with a rate alone.
fn rate(machine: &mut Machine, time_s: f64, rate: f64) -> (f64, f64) {
    machine.step(time_s, &[rate, NONE, NONE]);
    (machine.get("c.Z"), machine.get("why.Z"))
}

#[test]
fn it_is_minus_the_trapezoidal_integral_of_the_rate() {
    let mut machine = Machine::new(GRAPH);
    assert_eq!(rate(&mut machine, 0.0, 30.0), (0.0, 0.0));
    // 10 s at 30 nm/min are 5 nm; then 10 s at 45 nm/min on average 7.5 nm.
    assert_eq!(rate(&mut machine, 10.0, 30.0).0, -5.0);
    assert_eq!(rate(&mut machine, 20.0, 60.0).0, -12.5);
}

#[test]
fn without_a_prediction_it_is_frozen_and_does_not_make_up_for_it() {
    let mut machine = Machine::new(GRAPH);
    rate(&mut machine, 0.0, 60.0);
    let (before, _) = rate(&mut machine, 4.0, 60.0);
    assert_eq!(before, -4.0);
    assert_eq!(rate(&mut machine, 8.0, NONE), (-8.0, 0.0), "held for 5 s");
    assert_eq!(rate(&mut machine, 12.0, NONE), (-8.0, 1.0));
    assert_eq!(
        rate(&mut machine, 40.0, 60.0).0,
        -8.0,
        "nothing is known of the time between"
    );
    assert_eq!(rate(&mut machine, 41.0, 60.0).0, -9.0);
    assert_eq!(
        rate(&mut machine, 141.0, 60.0).0,
        -9.0,
        "a pause beyond max_gap"
    );
}

#[test]
fn it_stops_at_its_range_and_leaves_it_at_once() {
    let mut machine = Machine::new(GRAPH);
    for t in 0..60 {
        rate(&mut machine, f64::from(t), 600.0);
    }
    assert_eq!(rate(&mut machine, 60.0, 600.0), (-100.0, 5.0));
    // The trapezium from +600 to −600 is nothing; the next second takes 10 nm off.
    rate(&mut machine, 61.0, -600.0);
    assert_eq!(rate(&mut machine, 62.0, -600.0).0, -90.0);
}

#[test]
fn a_rate_beyond_belief_is_cut() {
    let mut machine = Machine::new(GRAPH);
    rate(&mut machine, 0.0, 60_000.0);
    assert_eq!(rate(&mut machine, 1.0, 60_000.0), (-10.0, 4.0));
}

#[test]
fn it_rests_below_its_deadband_and_stops_with_hysteresis() {
    let mut machine = Machine::new(GRAPH);
    rate(&mut machine, 0.0, 3.5);
    assert_eq!(rate(&mut machine, 10.0, 3.5), (0.0, 3.0));
    assert_eq!(rate(&mut machine, 20.0, 2.0), (0.0, 2.0));
    assert_eq!(
        rate(&mut machine, 30.0, 5.9).1,
        2.0,
        "not yet above 6 nm/min"
    );
    assert_eq!(rate(&mut machine, 40.0, 6.1).1, 0.0);
    assert_eq!(rate(&mut machine, 50.0, 5.0).1, 0.0, "not below 3 nm/min");
}

#[test]
fn it_stops_in_a_stated_state() {
    let mut machine = Machine::new(GRAPH);
    rate(&mut machine, 0.0, 60.0);
    machine.step(1.0, &[60.0, NONE, 0.0]);
    let stood = machine.get("c.Z");
    assert_eq!(machine.get("why.Z"), 2.0);
    assert_eq!(rate(&mut machine, 3.0, 60.0), (stood, 2.0));
    machine.step(4.0, &[60.0, NONE, 1.0]);
    assert_eq!(rate(&mut machine, 5.0, 60.0).0, machine.get("c.Z"));
    assert!(rate(&mut machine, 6.0, 60.0).0 < stood);
}

#[test]
fn a_re_alignment_starts_it_from_zero() {
    let mut machine = Machine::new(GRAPH);
    rate(&mut machine, 0.0, 60.0);
    assert_eq!(rate(&mut machine, 5.0, 60.0).0, -5.0);
    machine.step(10.0, &[60.0, 0.0, NONE]);
    assert_eq!(machine.get("c.Z"), -10.0, "a zero is no re-alignment");
    machine.step(11.0, &[60.0, 1.0, NONE]);
    assert_eq!(machine.get("c.Z"), 0.0);
    assert_eq!(rate(&mut machine, 13.0, 60.0).0, -2.0);
}

#[test]
fn it_goes_on_from_a_snapshot_with_the_same_bits() {
    let rows: Vec<_> = (0..200)
        .map(|i| {
            (
                f64::from(i),
                vec![f64::from(i % 37) * 9.7 - 150.0, NONE, f64::from(i % 3)],
            )
        })
        .collect();
    goes_on_alike(GRAPH, &rows);
}

#[test]
fn limits_that_do_not_fit_are_refused() {
    let told = compiled(&GRAPH.replace("10 nm/s", "1 nm/s")).0.unwrap_err();
    assert!(told.contains("slower than `max_rate`"), "{told}");
    let told = compiled(&GRAPH.replace("\"100 nm\"", "\"100 K\""))
        .0
        .unwrap_err();
    assert!(told.contains("its integral cannot be in K"), "{told}");
    let told = compiled(&GRAPH.replace(", state = \"stability\"", ""))
        .0
        .unwrap_err();
    assert!(told.contains("`stop_in` needs to know the state"), "{told}");
}

proptest! {
    #[test]
    fn whatever_comes_it_stays_in_its_limits_and_never_moves_on_invalid_data(
        rates in prop::collection::vec(
            prop_oneof![4 => -2000.0..2000.0_f64, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY)], 2..120),
        gaps in prop::collection::vec(0.1..20.0_f64, 120),
    ) {
        let mut machine = Machine::new(GRAPH);
        let (mut time, mut before) = (0.0, 0.0);
        for (value, gap) in rates.iter().zip(&gaps) {
            time += gap;
            let (now, why) = rate(&mut machine, time, *value);
            prop_assert!(now.abs() <= 100.0);
            prop_assert!((now - before).abs() <= 10.0 * gap + 1e-6);
            prop_assert!(why != 1.0 || now == before);
            before = now;
        }
    }
}

#[test]
fn a_range_of_something_else_hides_no_other_mistake() {
    let text = GRAPH
        .replace("\"100 nm\"", "\"200 K\"")
        .replace("600 nm/min", "2000 K/min");
    let told = compiled(&text).0.unwrap_err();
    assert!(told.contains("its integral cannot be in K"), "{told}");
    let told_of_rate = "`max_rate` is in K/min, which cannot be in nm/min";
    assert!(told.contains(told_of_rate), "{told}");
    assert_eq!(told.matches("error[").count(), 2, "{told}");
    // A parameter out of its range comes first.
    let text = text.replace("\"4 nm/min\"", "\"-1 nm/min\"");
    let told = compiled(&text).0.unwrap_err();
    let deadband = "`deadband` is -1 nm/min and must be 0 or more";
    assert!(told.contains(deadband), "{told}");
    assert_eq!(told.matches("error[").count(), 1, "{told}");
}

#[test]
fn a_position_in_the_place_of_its_rate_is_one_mistake() {
    let text = GRAPH.replacen("unit = \"nm/min\"", "unit = \"nm\"", 1);
    let told = compiled(&text).0.unwrap_err();
    assert!(told.contains("its integral cannot be in nm"), "{told}");
    assert_eq!(told.matches("error[").count(), 1, "{told}");
}
