//! Two graphs that disagree by 200 nm pass over into each other at the stated rate.

use athermal::Model;
use athermal::run::live::{LiveOptions, Stepper, pair};

use super::model::{d, model, s};

/// A graph that puts out channel `from` of its signal, which passes over at 5 nm/s.
fn showing(from: &str) -> Model {
    let text = format!(
        "schema = 1\n[time]\ncolumn = \"t\"\n[signals.command]\nunit = \"nm\"\nchannels = [\"high\", \"low\"]\nmax_age = \"1min\"\n\
         [nodes.shown]\ntype = \"pick\"\ninputs.signal = \"command.{from}\"\nnames = [\"value\"]\n\
         [outputs]\ncorrection = {{ from = \"shown\", blend = \"5 nm/s\" }}\n"
    );
    model(&text, "0")
}

fn channels() -> LiveOptions {
    use athermal::run::live::Feed;
    let feed = |name: &str| Feed {
        name: format!("command.{name}"),
        column: name.to_owned(),
    };
    LiveOptions {
        channels: vec![feed("high"), feed("low")],
        retain: d(100),
        ..LiveOptions::default()
    }
}

/// Steps with 200 nm and 0 nm; the low one has no value where `late`.
fn step(stepper: &mut Stepper, t: i64, late: bool) -> f64 {
    let of = |name: &str| match name {
        "command.high" => 200.0,
        _ if late => f64::NAN,
        _ => 0.0,
    };
    let row: Vec<_> = stepper.feed().iter().map(|feed| of(&feed.name)).collect();
    stepper.step(s(t), &row).unwrap().outputs[0]
}

/// No step between two values shown is above 5 nm for each second between them.
fn no_step(shown: &[(i64, f64)]) {
    let present: Vec<_> = shown.iter().filter(|(_, value)| !value.is_nan()).collect();
    for pair in present.windows(2) {
        let [(before, a), (after, b)] = pair else {
            unreachable!()
        };
        let most = 5.0 * (after - before) as f64;
        assert!(
            (b - a).abs() <= most + 1e-9,
            "from {a} to {b} between {before} s and {after} s"
        );
    }
}

#[test]
fn the_way_there_and_back_is_without_a_step_and_as_fast_as_stated() {
    let (mut stepper, mut control) = pair(&showing("high"), channels()).unwrap();
    let mut shown = Vec::new();
    let mut t = 0;
    for tick in 0..200 {
        t += if tick % 17 == 0 { 9 } else { 1 };
        if tick == 20 {
            control.stage(&showing("low"), false).unwrap();
            control.commit().unwrap();
        }
        // In the middle of passing over, back; and forward again.
        if tick == 30 || tick == 37 || tick == 130 {
            control.rollback().unwrap();
        }
        shown.push((t, step(&mut stepper, t, false)));
    }
    no_step(&shown);
    assert_eq!(shown[20].1, 195.0);
    assert!(shown[29].1 < 200.0 - 9.0 * 5.0);
    assert_eq!(shown[129].1, 0.0);
    assert_eq!(shown[199].1, 200.0);
    let replica = control.pump();
    assert!(!replica.is_empty());
    assert_eq!(control.replica().unwrap().outputs(), [200.0]);
}

#[test]
fn a_value_that_comes_late_begins_where_the_last_one_was() {
    let (mut stepper, mut control) = pair(&showing("high"), channels()).unwrap();
    let mut shown = vec![(0, step(&mut stepper, 0, true))];
    control.stage(&showing("low"), false).unwrap();
    control.commit().unwrap();
    for t in 1..80 {
        shown.push((t, step(&mut stepper, t, t < 20)));
    }
    no_step(&shown);
    assert!(shown[19].1.is_nan());
    assert_eq!(shown[20].1, 100.0);
    assert_eq!(shown[79].1, 0.0);
}

#[test]
fn the_same_graph_again_changes_no_bit_even_in_the_middle_of_passing() {
    let run = |again: bool| {
        let (mut stepper, mut control) = pair(&showing("high"), channels()).unwrap();
        let mut bits = Vec::new();
        for t in 0..60 {
            if t == 10 || (again && t == 20) {
                control.stage(&showing("low"), false).unwrap();
                control.commit().unwrap();
            }
            bits.push(step(&mut stepper, t, false).to_bits());
        }
        bits
    };
    assert_eq!(run(false), run(true));
}

#[test]
fn a_snapshot_in_the_middle_of_passing_goes_on_with_it() {
    let (mut stepper, mut control) = pair(&showing("high"), channels()).unwrap();
    step(&mut stepper, 0, false);
    control.stage(&showing("low"), false).unwrap();
    control.commit().unwrap();
    step(&mut stepper, 1, false);
    let mut restored = showing("low").engine().unwrap();
    restored.restore(&stepper.engine().snapshot()).unwrap();
    let samples = vec![0.0; restored.plan().sources.len()];
    let of = restored.step(s(2), &samples).unwrap()[0];
    assert_eq!(of, 190.0);
    assert_eq!(step(&mut stepper, 2, false), of);
}
