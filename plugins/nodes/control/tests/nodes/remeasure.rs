//! The uncertainty of what has been accumulated, and when it asks for a measurement.

use super::machine::{Machine, NONE, compiled, goes_on_alike};

fn graph(parameters: &str, measured: bool) -> String {
    let input = if measured {
        "inputs.measured = \"position\""
    } else {
        ""
    };
    format!(
        r#"
[signals.std_dev]
unit = "nm/min"
channels = ["X", "Z"]
max_age = "30s"
[signals.position]
unit = "nm"
channels = ["Z"]
[nodes.again]
type = "remeasure"
inputs.std_dev = "std_dev"
{input}
{parameters}
[outputs]
ask = "again"
due = "again:due"
why = "again:why"
uncertainty = "again:uncertainty"
position = "position"
"#
    )
}

const USUAL: &str =
    "tolerance = \"20 nm\"\nlead = \"2min\"\nleast = \"1min\"\nlongest = \"1h\"\nsigmas = 1.0";

/// The standard deviation of an integrated Ornstein–Uhlenbeck process, in nm: of the rate in nm/min, times in min.
fn accumulated(rate: f64, memory: f64, after: f64) -> f64 {
    rate * memory * (2.0 * (after / memory - 1.0 + (-after / memory).exp())).sqrt()
}

/// The output `ask` has one channel, of the same name.
fn asks(machine: &Machine) -> bool {
    machine.get("ask.ask") == 1.0
}

#[test]
fn the_uncertainty_is_that_of_an_integrated_rate_whose_errors_are_forgotten() {
    let text = graph(USUAL, true);
    let mut machine = Machine::new(&text);
    machine.step(0.0, &[3.0, 1.0, 500.0]);
    for second in 1..=900 {
        machine.step(f64::from(second), &[3.0, 1.0, NONE]);
        let minutes = f64::from(second) / 60.0;
        for (axis, rate) in [("X", 3.0), ("Z", 1.0)] {
            let expected = accumulated(rate, 5.0, minutes);
            let found = machine.get(&format!("uncertainty.{axis}"));
            assert!(
                (found - expected).abs() < 1e-6 * expected.max(1e-3),
                "{axis} after {minutes} min: {found}, {expected}"
            );
        }
    }
}

#[test]
fn a_measurement_is_asked_for_the_lead_before_the_tolerance_is_reached() {
    let text = graph(USUAL, true);
    let mut machine = Machine::new(&text);
    machine.step(0.0, &[3.0, 1.0, 500.0]);
    let due = machine.get("due.due");
    assert!(
        (accumulated(3.0, 5.0, due + 2.0) / 20.0 - 1.0).abs() < 0.02,
        "due in {due} min"
    );
    let mut second = 0.0;
    while !asks(&machine) {
        second += 10.0;
        machine.step(second, &[3.0, 1.0, NONE]);
        let left = due - second / 60.0;
        // A clock of a thousandth of an hour.
        assert!(
            (machine.get("due.due") - left.max(0.0)).abs() < 0.2,
            "{second} s"
        );
    }
    let minutes = second / 60.0 + 2.0;
    assert!(accumulated(3.0, 5.0, minutes) > 20.0);
    assert!(accumulated(3.0, 5.0, minutes - 0.25) < 20.0);
    assert_eq!(machine.get("why.why"), 1.0);
    // It goes on asking until something is measured, and asks no sooner than `least` after that.
    assert!(asks(machine.step(second + 10.0, &[3.0, 1.0, NONE])));
    assert!(!asks(machine.step(second + 20.0, &[3.0, 1.0, 480.0])));
    assert_eq!(
        (machine.get("why.why"), machine.get("uncertainty.X")),
        (0.0, 0.0)
    );
}

#[test]
fn a_rate_that_becomes_uncertain_brings_the_measurement_forward() {
    let mut machine = Machine::new(&graph(USUAL, true));
    machine.step(0.0, &[1.0, 1.0, 500.0]);
    let before = machine.step(10.0, &[1.0, 1.0, NONE]).get("due.due");
    let after = machine.step(20.0, &[1.0, 6.0, NONE]).get("due.due");
    assert!(after < 0.5 * before, "{after} and {before} min");
    assert!(
        !asks(machine.step(30.0, &[1.0, 100.0, NONE])),
        "sooner than `least`"
    );
    assert!(asks(machine.step(60.0, &[1.0, 100.0, NONE])));
}

#[test]
fn the_longest_interval_ends_in_a_measurement_however_certain_it_is() {
    let text = graph("tolerance = \"20 nm\"\nlongest = \"5min\"", true);
    let mut machine = Machine::new(&text);
    machine.step(0.0, &[0.01, 0.01, 500.0]);
    for second in (10..300).step_by(10) {
        machine.step(f64::from(second), &[0.01, 0.01, NONE]);
        assert!(!asks(&machine), "{second} s");
        let due = machine.get("due.due");
        assert!((due - (5.0 - f64::from(second) / 60.0)).abs() < 1e-9);
    }
    assert!(asks(machine.step(300.0, &[0.01, 0.01, NONE])));
    assert_eq!(machine.get("why.why"), 2.0);
}

#[test]
fn what_is_not_known_is_measured() {
    let mut machine = Machine::new(&graph(USUAL, true));
    machine.step(0.0, &[1.0, 1.0, NONE]);
    assert!(asks(&machine), "nothing has been measured yet");
    assert_eq!(machine.get("why.why"), 3.0);
    assert!(!asks(machine.step(10.0, &[1.0, 1.0, 500.0])));
    // The standard deviation of Z is held for 30 s, and then it is absent.
    for second in (20..=60).step_by(10) {
        machine.step(f64::from(second), &[1.0, NONE, NONE]);
    }
    assert!(machine.get("uncertainty.Z").is_nan() && machine.get("uncertainty.X") > 0.0);
    assert!(!asks(&machine), "sooner than `least`");
    assert!(asks(machine.step(70.0, &[1.0, NONE, NONE])));
    assert_eq!(machine.get("why.why"), 3.0);
    // That it is known again does not say what was accumulated meanwhile.
    assert!(asks(machine.step(80.0, &[1.0, 1.0, NONE])));
    assert!(!asks(machine.step(90.0, &[1.0, 1.0, 500.0])));
    // And neither is known what happened in a long pause.
    assert!(asks(machine.step(400.0, &[1.0, 1.0, NONE])));
}

#[test]
fn without_a_word_of_measurements_each_one_counts_as_made_when_it_is_asked_for() {
    let mut machine = Machine::new(&graph(USUAL, false));
    let mut asked = Vec::new();
    for second in (0..7200).step_by(10) {
        machine.step(f64::from(second), &[3.0, 1.0, NONE]);
        if asks(&machine) {
            asked.push(second);
        }
    }
    let gaps: Vec<_> = asked.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let first = gaps[0];
    assert!(
        gaps.len() > 10 && gaps.iter().all(|gap| *gap == first),
        "{asked:?}"
    );
    let reached = accumulated(3.0, 5.0, f64::from(first) / 60.0 + 2.0);
    assert!((20.0..23.0).contains(&reached), "{reached} nm");
}

#[test]
fn a_snapshot_goes_on_alike() {
    let rows: Vec<(f64, Vec<f64>)> = (0..200)
        .map(|row| {
            let rate = 1.0 + f64::from(row % 17);
            let position = if row % 41 == 3 { 500.0 } else { NONE };
            (10.0 * f64::from(row), vec![rate, 1.0, position])
        })
        .collect();
    goes_on_alike(&graph(USUAL, true), &rows);
    goes_on_alike(&graph(USUAL, false), &rows);
}

#[test]
fn what_cannot_be_is_refused_in_words() {
    for (parameters, expected) in [
        (
            "tolerance = \"20 mK\"\nlongest = \"1h\"",
            "the integral of nm/min cannot be in mK",
        ),
        (
            "tolerance = \"20 nm\"\nleast = \"2h\"\nlongest = \"1h\"",
            "`longest` (1h) is below `least` (2h)",
        ),
        (
            "tolerance = \"20 nm\"\nlongest = \"1h\"\nsigmas = 0.0",
            "sigmas",
        ),
    ] {
        let told = compiled(&graph(parameters, true)).0.unwrap_err();
        assert!(told.contains(expected), "{told}");
    }
}
