//! A correction on a simulated machine, as a loop: bounded, still where it knows nothing, and as good as before once a fault is over.

#![allow(clippy::unwrap_used)]

use std::path::Path;

use athermal::core::fit::{FitOptions, fit};
use athermal::core::machine::{
    ClosedLoop, Machine, Row, SECOND_NS, Schedule, Setup, Simulated, Simulation, machine,
};
use athermal::core::prng::Prng;
use athermal::{Engine, Model};

const RANGE_NM: f64 = 200_000.0;
const SLEW_NM_PER_S: f64 = 50.0;
/// The number in `why` of a correction without a valid prediction.
const INVALID: f64 = 1.0;
/// In the order of the machine's axes; X and Y barely move.
const AXES: [&str; 6] = ["X1", "Y1", "Z1", "X2", "Y2", "Z2"];

fn die_tester() -> &'static dyn Machine {
    machine("die-tester").unwrap().machine
}

fn fitted() -> Model {
    let graph = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/die-tester-control.toml");
    let mut model = Model::load(graph).unwrap();
    let setup = Setup {
        days: 3.0,
        seed: 1,
        schedule: None,
    };
    let recording = Simulated::new(die_tester(), setup);
    model.fitted = fit(&model.plan, &recording, &FitOptions::default(), &mut |_| {})
        .unwrap()
        .0;
    model
}

fn output(engine: &Engine, name: &str) -> f64 {
    let place = engine
        .plan()
        .outputs
        .iter()
        .position(|output| output.name == name);
    engine.outputs()[place.unwrap()]
}

/// A run under correction.
struct Run {
    /// Instants in s and positions of each alignment.
    aligned: Vec<(f64, [f64; 6])>,
    /// Ticks of all axes without a valid prediction, once the windows are full.
    invalid: usize,
    largest_step: f64,
    true_drift: Vec<(f64, [f64; 6])>,
}

fn run(model: &Model, schedule: &Schedule, seed: u64, fault: Option<&str>) -> Run {
    let setup = Setup {
        days: 1.0,
        seed,
        schedule: Some(schedule.clone()),
    };
    let faults = fault.iter().map(|fault| fault.parse().unwrap()).collect();
    let recording = Simulated::new(die_tester(), setup).with_faults(faults);
    let simulation = recording.start().unwrap();
    let mut simulation =
        ClosedLoop::new(die_tester(), simulation, model.engine().unwrap()).unwrap();
    let mut row = Row::empty(die_tester().channels());
    let mut run = Run {
        aligned: Vec::new(),
        invalid: 0,
        largest_step: 0.0,
        true_drift: Vec::new(),
    };
    let mut before = [0.0; 6];
    while simulation.next(&mut row) {
        let time_s = row.time_ns as f64 / SECOND_NS as f64;
        let asked: [f64; 6] = simulation.asked().try_into().unwrap();
        for (axis, name) in AXES.iter().enumerate() {
            let step = (asked[axis] - before[axis]).abs();
            assert!(
                asked[axis].abs() <= RANGE_NM,
                "{fault:?}: {} nm on {name}",
                asked[axis]
            );
            assert!(
                step <= SLEW_NM_PER_S * 10.0 + 1e-6,
                "{fault:?}: a step of {step} nm on {name}"
            );
            run.largest_step = run.largest_step.max(step);
            if output(simulation.engine(), &format!("why.{name}")) == INVALID {
                run.invalid += usize::from(time_s > 7200.0);
                assert!(
                    step == 0.0,
                    "{fault:?}: {name} moved by {step} nm without a prediction at {time_s} s"
                );
            }
        }
        before = asked;
        let positions: [f64; 6] = row.values[6..].try_into().unwrap();
        if positions.iter().any(|position| !position.is_nan()) {
            run.aligned.push((time_s, positions));
        }
        if !row.true_drift[0].is_nan() {
            run.true_drift
                .push((time_s, row.true_drift.clone().try_into().unwrap()));
        }
    }
    run
}

impl Run {
    /// Root mean square in nm/min of the drift over five minutes that an axis still has between two instants in h.
    fn left(&self, axis: usize, from_h: f64, to_h: f64) -> f64 {
        let inside = |time_s: f64| (from_h * 3600.0..to_h * 3600.0).contains(&time_s);
        let mut squares = Vec::new();
        for (nth, (time_s, _)) in self.aligned.iter().enumerate() {
            if !inside(*time_s) {
                continue;
            }
            let window: Vec<(f64, f64)> = self.aligned[nth.saturating_sub(5)..=nth]
                .iter()
                .filter(|(t, p)| *t > time_s - 300.0 && !p[axis].is_nan())
                .map(|(t, p)| (t / 60.0, p[axis]))
                .collect();
            if window.len() < 3 {
                continue;
            }
            let count = window.len() as f64;
            let mean = window
                .iter()
                .fold((0.0, 0.0), |m, w| (m.0 + w.0 / count, m.1 + w.1 / count));
            let above: f64 = window.iter().map(|w| (w.0 - mean.0) * (w.1 - mean.1)).sum();
            let below: f64 = window.iter().map(|w| (w.0 - mean.0).powi(2)).sum();
            squares.push((above / below).powi(2));
        }
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }

    fn true_rms(&self, axis: usize, from_h: f64, to_h: f64) -> f64 {
        let inside = |time_s: f64| (from_h * 3600.0..to_h * 3600.0).contains(&time_s);
        let squares: Vec<f64> = self
            .true_drift
            .iter()
            .filter(|d| inside(d.0))
            .map(|d| d.1[axis].powi(2))
            .collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }
}

#[test]
fn over_random_faults_and_schedules_the_loop_is_bounded_and_recovers() {
    let model = fitted();
    let mut prng = Prng::stream(11, "cases");
    let channels = ["plate1", "holder1", "plate2", "holder2", "room", "chuck"];
    let kinds = ["missing", "stuck", "offset", "spike", "noise", "drift"];
    let (mut invalid, mut largest_step) = (0, 0.0_f64);
    for case in 0..12_usize {
        let levels: Vec<f64> = (0..4).map(|_| prng.between(20.0, 70.0).round()).collect();
        let schedule = Schedule::cycle("chuck", &levels, 3 * 3600);
        let (from, length) = (prng.between(4.0, 12.0), prng.between(0.5, 5.0));
        let lost = if case % 4 == 3 {
            format!("position.{}", AXES[case % 6])
        } else {
            format!("temperature.{}", channels[prng.between(0.0, 6.0) as usize])
        };
        let kind = if case % 4 == 3 {
            "missing"
        } else {
            kinds[case % 6]
        };
        let fault = format!(
            "{lost}={kind},from={:.0}s,for={:.0}s",
            from * 3600.0,
            length * 3600.0
        );
        let seed = 100 + case as u64;
        let (good, bad) = (
            run(&model, &schedule, seed, None),
            run(&model, &schedule, seed, Some(&fault)),
        );
        invalid += bad.invalid;
        largest_step = largest_step.max(bad.largest_step);
        // Half an hour: the longest window is 23 minutes.
        let after = from + length + 0.5;
        for axis in [2, 5] {
            let (undisturbed, recovered) =
                (good.left(axis, after, 24.0), bad.left(axis, after, 24.0));
            assert!(
                recovered <= 1.1 * undisturbed,
                "{fault}, {}: {undisturbed} → {recovered}",
                AXES[axis]
            );
            let alone = good.true_rms(axis, 1.0, 24.0);
            let corrected = good.left(axis, 1.0, 24.0);
            assert!(
                corrected < 0.6 * alone,
                "seed {seed}, {}: {alone} → {corrected}",
                AXES[axis]
            );
        }
    }
    println!(
        "{invalid} axis-ticks without a prediction; the largest step was {largest_step:.1} nm"
    );
    assert!(
        invalid > 0,
        "no case took the prediction away, so nothing was shown"
    );
}

#[test]
fn what_the_machine_applies_is_what_the_graph_is_told() {
    let model = fitted();
    let setup = Setup {
        days: 0.2,
        seed: 5,
        schedule: None,
    };
    let simulation = Simulated::new(die_tester(), setup).start().unwrap();
    let mut simulation =
        ClosedLoop::new(die_tester(), simulation, model.engine().unwrap()).unwrap();
    let mut row = Row::empty(die_tester().channels());
    let mut asked = vec![0.0; 6];
    while simulation.next(&mut row) {
        for (asked, applied) in asked.iter().zip(simulation.applied()) {
            assert!(asked == applied || asked.is_nan());
        }
        asked.copy_from_slice(simulation.asked());
    }
    assert!(
        asked.iter().any(|asked| asked.abs() > 10.0),
        "nothing was ever corrected: {asked:?}"
    );
}
