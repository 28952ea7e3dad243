//! A correction stands where the axis does: no other graph moves it by more than its slew.

use athermal::Model;
use athermal::core::engine::Carry;
use athermal::run::live::{LiveOptions, Stepper, pair};

use super::model::{d, model, s};
use crate::workbench::Graph;

/// A predicted rate, what it is integrated into, and what is put out of that.
fn corrected() -> Graph {
    Graph::new()
        .time("t")
        .signal("temperature", "Cel", "plate room chuck", "1min")
        .signal("position", "nm", "Z", "1min")
        .slope("drift", "position", "5min", "nm/min")
        .model("rate", "linear", "temperature", "drift.Z", "150s")
        .section("nodes.compensate", "type = 'compensate'")
        .with("inputs.rate = 'rate'; range = '50 um'")
        .with("max_rate = '3000 nm/min'; max_slew = '50 nm/s'")
        .node("safe", "safe_state", "compensate")
        .with("when_lost = 'hold'; max_slew = '50 nm/s'")
        .outputs("correction = 'compensate'; safe = 'safe'")
}

/// What is put out at a row every 10 s from `from` on, in nm.
fn go(stepper: &mut Stepper, from: i64, count: i64) -> Vec<Vec<f64>> {
    let row = |tick: i64| {
        let samples = [20.0, 21.0, 60.0, f64::NAN];
        let stepped = stepper.step(s(10 * tick), &samples).unwrap();
        let outputs = stepped.plan.outputs.iter().zip(stepped.outputs);
        let in_nm = |(output, value): (&athermal::core::compile::PlannedOutput, &f64)| {
            let unit = &stepped.plan.channels[output.slot].channel.unit;
            value * unit.factor_to(&"nm".parse().unwrap()).unwrap()
        };
        outputs.map(in_nm).collect()
    };
    (from..from + count).map(row).collect()
}

/// What was put out before and after another graph took over, and what its report says of the correction.
fn swapped(new: &Model) -> (Vec<f64>, Vec<f64>, Carry) {
    let options = LiveOptions {
        retain: d(600),
        ..LiveOptions::default()
    };
    let (mut stepper, mut control) = pair(&model(&corrected(), "0"), options).unwrap();
    let before = go(&mut stepper, 0, 1000).pop().unwrap();
    assert!(before[0].abs() > 1000.0, "{before:?}");
    let staged = control.stage(new, false).unwrap();
    let node = |node: &&athermal::core::engine::NodeCarry| node.node == "compensate";
    let told = staged.carry().iter().find(node).unwrap().outcome.clone();
    control.commit().unwrap();
    let after = go(&mut stepper, 1000, 1).pop().unwrap();
    (before, after, told)
}

#[test]
fn a_correction_goes_on_from_where_it_stands_when_its_rate_is_fitted_anew() {
    let (before, after, told) = swapped(&model(&corrected(), "1"));
    for (before, after) in before.iter().zip(&after) {
        assert!((after - before).abs() <= 500.0, "{before} to {after} nm");
    }
    let reason = "`rate.Z`, which it reads, changed".to_owned();
    assert_eq!(told, Carry::Adopted { reason });
}

#[test]
fn a_correction_goes_on_from_where_it_stands_when_it_follows_another_rate() {
    let other = corrected()
        .replace("[nodes.rate]", "[nodes.other]")
        .replace("inputs.rate = \"rate\"", "inputs.rate = \"other\"");
    let renamed = other.replace(
        "inputs.rate = \"other\"",
        "inputs.rate = { from = \"other\", max_age = \"30s\" }",
    );
    for text in [&other, &renamed] {
        let (before, after, told) = swapped(&model(text, "1"));
        for (before, after) in before.iter().zip(&after) {
            assert!((after - before).abs() <= 500.0, "{before} to {after} nm");
        }
        let reason = "its inputs changed".to_owned();
        assert_eq!(told, Carry::Adopted { reason });
    }
}

#[test]
fn a_correction_that_is_told_in_another_unit_stands_where_it_stood() {
    let other = corrected()
        .replace("50 um", "50000 nm")
        .replace("correction = ", "correction_nm = ")
        .replace("safe = ", "safe_nm = ");
    let (before, after, told) = swapped(&model(&other, "0"));
    for (before, after) in before.iter().zip(&after) {
        assert!((after - before).abs() <= 500.0, "{before} to {after} nm");
    }
    let reason = "the unit of its outputs changed".to_owned();
    assert_eq!(told, Carry::Adopted { reason });
}

#[test]
fn an_output_does_not_change_its_unit_under_its_name() {
    let options = LiveOptions::default();
    let (_, mut control) = pair(&model(&corrected(), "0"), options).unwrap();
    let other = model(&corrected().replace("50 um", "50000 nm"), "0");
    let refused = control.stage(&other, false).unwrap_err();
    assert!(
        refused.to_string().contains(
            "the output `correction.Z` in nm and what runs in um: give it in that, or another name"
        ),
        "{refused}"
    );
}
