//! Optical loss and settle time, by hand.

use super::machine::{Machine, NONE, compiled, goes_on_alike};

const LOSS: &str = r#"
[signals.drift]
unit = "nm/min"
channels = ["X1", "Y1", "Z1"]
max_age = "5min"
[nodes.loss]
type = "optical_loss"
inputs.drift = "drift"
preset = "mandelli"
[outputs]
loss = "loss"
share = "loss:share"
"#;

#[test]
fn the_loss_is_the_sum_over_the_axes_with_the_published_coefficients() {
    let mut machine = Machine::new(LOSS);
    machine.step(0.0, &[20.0, 20.0, 20.0]);
    // oracles/paper_constants: loss_dB_at_20nm_per_min_each_axis.
    for (axis, expected) in [
        ("X1", 0.000_836_236),
        ("Y1", 0.023_786_32),
        ("Z1", 0.053_519_2),
    ] {
        let share = machine.get(&format!("share.{axis}"));
        assert!((share / expected - 1.0).abs() < 1e-9, "{axis} {share}");
    }
    let sum = 0.000_836_236 + 0.023_786_32 + 0.053_519_2;
    assert!((machine.get("loss.loss") / sum - 1.0).abs() < 1e-9);
}

#[test]
fn own_radii_and_windows_count_and_an_absent_axis_leaves_no_loss() {
    let own = LOSS.replace(
        "preset = \"mandelli\"",
        "radii = [\"2 um\"]\nover = \"10min\"",
    );
    let mut machine = Machine::new(&own);
    // 30 nm/min for 10 min are 0.3 µm: 8.685889638 × (0.3 / 2)² = 0.195432517 dB.
    machine.step(0.0, &[0.0, 0.0, -30.0]);
    assert!((machine.get("loss.loss") - 0.195_432_516_9).abs() < 1e-9);
    assert!(
        Machine::new(&own)
            .step(0.0, &[1.0, NONE, 1.0])
            .get("loss.loss")
            .is_nan()
    );
}

#[test]
fn a_beam_needs_exactly_one_description() {
    let both = LOSS.replace("preset", "radii = [\"2 um\"]\npreset");
    assert!(compiled(&both).0.unwrap_err().contains("both say how wide"));
    let none = LOSS.replace("preset = \"mandelli\"", "");
    assert!(
        compiled(&none)
            .0
            .unwrap_err()
            .contains("nothing says how wide")
    );
    let two = LOSS.replace("preset = \"mandelli\"", "radii = [\"2 um\", \"1 um\"]");
    assert!(
        compiled(&two)
            .0
            .unwrap_err()
            .contains("2 `radii` for 3 axes")
    );
    let zero = LOSS.replace("preset = \"mandelli\"", "radii = [\"0 um\"]");
    let told = compiled(&zero).0.unwrap_err();
    let radii = "`radii` is 0 um and must be greater than 0";
    assert!(told.contains(radii), "{told}");
    let named = LOSS.replace("\"X1\"", "\"roll\"");
    assert!(
        compiled(&named)
            .0
            .unwrap_err()
            .contains("no radius for an axis named `roll`")
    );
}

const SETTLED: &str = r#"
[signals.loss]
unit = "dB"
channels = ["loss"]
max_age = "5min"
[signals.chuck]
unit = "Cel"
channels = ["chuck"]
[nodes.settled]
type = "settled"
inputs = { loss = "loss", set_point = "chuck" }
below = "0.2 dB"
change = "5 K"
[outputs]
time = "settled"
since = "settled:since"
"#;

#[test]
fn the_settle_time_runs_from_the_change_to_the_start_of_ten_stable_minutes() {
    let mut machine = Machine::new(SETTLED);
    let mut found = Vec::new();
    for minute in 0..60 {
        let chuck = if minute < 5 { 20.0 } else { 30.0 };
        // Low from minute 12, for eight minutes only; low again from minute 25 on.
        let loss = if minute < 5 || (12..20).contains(&minute) || minute >= 25 {
            0.1
        } else {
            0.5
        };
        machine.step(60.0 * f64::from(minute), &[loss, chuck]);
        if !machine.get("time.settle_time").is_nan() {
            found.push((minute, machine.get("time.settle_time")));
        }
        let waiting = (5..35).contains(&minute);
        assert_eq!(
            machine.get("since.since"),
            if waiting { f64::from(minute - 5) } else { 0.0 }
        );
    }
    assert_eq!(found, [(35, 20.0)]);
}

#[test]
fn a_small_wobble_is_no_change_and_a_pause_is_no_stable_time() {
    let mut machine = Machine::new(SETTLED);
    for minute in 0..40 {
        machine.step(
            60.0 * f64::from(minute),
            &[0.1, 20.0 + f64::from(minute % 2) * 4.9],
        );
        assert!(machine.get("time.settle_time").is_nan());
    }
    machine.step(2460.0, &[0.1, 40.0]);
    machine.step(2460.0 + 700.0, &[0.1, NONE]);
    assert!(
        machine.get("time.settle_time").is_nan(),
        "nobody looked for eleven minutes"
    );
}

#[test]
fn settling_goes_on_from_a_snapshot() {
    let rows: Vec<_> = (0..80)
        .map(|i| {
            (
                f64::from(i) * 60.0,
                vec![
                    if i % 23 == 0 { 0.3 } else { 0.1 },
                    f64::from(20 + i / 20 * 10),
                ],
            )
        })
        .collect();
    goes_on_alike(SETTLED, &rows);
}

#[test]
fn an_input_that_does_not_fit_hides_no_mistake_of_a_limit() {
    let text = LOSS.replace("preset = \"mandelli\"", "radii = [\"-2 um\"]");
    let told = compiled(&text).0.unwrap_err();
    let expected = "`radii` is -2 um and must be greater than 0";
    assert!(told.contains(expected), "{told}");
    let text = SETTLED
        .replace("[\"loss\"]", "[\"loss\", \"more\"]")
        .replace("5 K", "5 nm");
    let told = compiled(&text).0.unwrap_err();
    assert!(told.contains("takes one channel and is given 2"), "{told}");
    assert!(told.contains("`change` is in nm"), "{told}");
}
