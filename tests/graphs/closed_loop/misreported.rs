//! A machine that misreports what it applied: its own correction must not be learned as drift, and never do harm. `ATHERMAL_LONG=1` runs
//! twenty seeds.

use std::collections::VecDeque;

use super::die_tester;
use super::looped::{Looped, Run, output};
use crate::workbench::{Scratch, graph};
use athermal::Engine;
use athermal::core::time::Instant;
use athermal::core::unit::Unit;
use athermal::trial::machine::{Row, SECOND_NS, Setup, Simulated};

/// What is reported of what was applied to an axis, by what was at each of the last rows, the newest last.
type Report = fn(&VecDeque<f64>) -> f64;

const REPORTS: [(&str, Report); 4] = [
    ("missing", |_| f64::NAN),
    ("doubled", |of| 2.0 * of.back().unwrap()),
    ("of the wrong sign", |of| -of.back().unwrap()),
    // Rows are ten seconds apart.
    ("30 s late", |of| of[of.len().saturating_sub(4)]),
];

/// Half a day under correction, in which an hour is misreported; without a correction where there is no report.
fn run(looped: &Looped, seed: u64, report: Option<Report>) -> Run {
    run_seen(looped, seed, report, |_, _| ())
}

/// The same; `look` sees the engine after each row, and the instant in s.
fn run_seen(
    looped: &Looped,
    seed: u64,
    report: Option<Report>,
    mut look: impl FnMut(&Engine, f64),
) -> Run {
    let setup = Setup {
        days: 0.5,
        seed,
        ..Setup::default()
    };
    let mut simulation = Simulated::new(looped.machine, setup).start().unwrap();
    let mut engine = looped.model.engine().unwrap();
    let channels = looped.machine.channels();
    let temperatures = channels.len() - looped.axes.len();
    let axis_of = |name: &str, of: &str| {
        let axis = name.strip_prefix(of)?;
        looped.axes.iter().position(|known| *known == axis)
    };
    let names: Vec<String> = engine
        .plan()
        .sources
        .iter()
        .map(|of| of.name.clone())
        .collect();
    let nm = Unit::parse("nm").unwrap();
    let plan = engine.plan();
    let asks = plan.outputs.iter().map(|of| {
        let unit = &plan.channels[of.slot].channel.unit;
        Some((axis_of(&of.name, "correction.")?, unit.factor_to(&nm)?))
    });
    let asks: Vec<Option<(usize, f64)>> = asks.collect();
    let mut before = vec![VecDeque::from([0.0]); looped.axes.len()];
    let (mut applied, mut asked) = (
        vec![0.0; looped.axes.len()],
        vec![f64::NAN; looped.axes.len()],
    );
    let (mut row, mut run) = (Row::empty(channels), Run::default());
    while simulation.next(&mut row) {
        let time_s = row.time_ns as f64 / SECOND_NS as f64;
        let is_wrong = (6.0 * 3600.0..7.0 * 3600.0).contains(&time_s);
        for (of, applied) in before.iter_mut().zip(&applied) {
            of.push_back(*applied);
        }
        let samples = names.iter().map(|name| match axis_of(name, "applied.") {
            Some(axis) if is_wrong => report.map_or(0.0, |report| report(&before[axis])),
            Some(axis) => applied[axis],
            None => channels
                .iter()
                .position(|of| of.reference() == *name)
                .map_or(f64::NAN, |nth| row.values[nth]),
        });
        let samples: Vec<f64> = samples.collect();
        let given = engine
            .step(Instant::from_ns(row.time_ns), &samples)
            .unwrap();
        for (ask, value) in asks.iter().zip(given) {
            if let Some((axis, factor)) = ask {
                asked[*axis] = value * factor;
            }
        }
        look(&engine, time_s);
        if report.is_some() {
            simulation.correct(&asked, &mut applied);
        }
        let positions = &row.values[temperatures..];
        if positions.iter().any(|position| !position.is_nan()) {
            run.aligned.push((time_s, positions.to_vec()));
        }
        if !row.true_drift[0].is_nan() {
            run.true_drift.push((time_s, row.true_drift.clone()));
        }
    }
    run
}

#[test]
fn what_is_misreported_as_applied_does_no_harm() {
    let looped = die_tester();
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    let seeds = 300..if is_long { 320 } else { 304 };
    let alone: Vec<Run> = seeds.map(|seed| run(&looped, seed, None)).collect();
    for (name, report) in REPORTS {
        let mut worst = (0.0_f64, String::new());
        for (alone, seed) in alone.iter().zip(300..) {
            let run = run(&looped, seed, Some(report));
            // X and Y barely move.
            for axis in [2, 5] {
                for (from, to) in [(6.0, 7.0), (7.0, 8.0), (6.0, 12.0)] {
                    let share = run.left(axis, from, to) / alone.left(axis, from, to);
                    if share > worst.0 {
                        let name = looped.axes[axis];
                        worst = (share, format!("seed {seed}, {name}, {from} h to {to} h"));
                    }
                }
            }
        }
        println!(
            "{name}: at worst {:.2} of the drift is left ({})",
            worst.0, worst.1
        );
        assert!(worst.0 < 1.0, "{name}: {worst:?}");
    }
}

/// The shipped graph, in which a position does not count that was not corrected as commanded.
const COMMANDED: &str = r#"
[nodes.asked]
type = "delay"
each = "axis"
inputs.signal = "compensate.{axis}"
delay = "1 tick"
unit = "nm"
[nodes.uncorrected]
each = "axis"
inputs.position = "position.{axis}"
inputs.applied = "applied.{axis}"
inputs.commanded = { from = "asked.{axis}", max_age = "1min" }
differs = "60 nm"
[outputs]
unlike = "uncorrected:reason"
drift = "drift"
"#;

#[test]
fn a_position_that_was_not_corrected_as_commanded_makes_no_drift_and_says_why() {
    let scratch = Scratch::new("commanded");
    let base = graph("die-tester-control");
    let text = format!(
        "schema = 1\nextends = \"{}\"\nname = \"commanded\"\n{COMMANDED}",
        base.display()
    );
    let path = scratch.path("commanded.toml");
    std::fs::write(&path, text).unwrap();
    let looped = Looped::new("die-tester", &path, 200_000.0, 50.0);
    for (name, report) in REPORTS {
        let (mut withheld, mut learned, mut before) = (0, 0, 0);
        run_seen(&looped, 300, Some(report), |engine, time_s| {
            let (unlike, drift) = (output(engine, "unlike.Z1"), output(engine, "drift.Z1"));
            // Of five minutes each, so the first hold positions of before.
            match time_s {
                7200.0..21_600.0 => before += usize::from(unlike > 0.0),
                21_900.0..25_200.0 => {
                    withheld += usize::from(unlike > 0.0);
                    learned += usize::from(!drift.is_nan());
                }
                _ => {}
            }
        });
        println!(
            "{name}: {withheld} positions withheld, {learned} drifts of the hour, {before} withheld before"
        );
        assert_eq!(before, 0, "{name}");
        assert!(
            name == "30 s late" || withheld > 30 && learned == 0,
            "{name}: {withheld} withheld, {learned} drifts"
        );
    }
}
