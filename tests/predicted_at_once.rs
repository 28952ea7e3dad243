//! Estimators that read the same values are predicted at once, to the bits and stamps that each has alone, whatever is missing.

#![allow(clippy::unwrap_used)]

mod workbench;

use athermal::Engine;
use athermal::core::channel::ABSENT;
use athermal::core::compile::PlannedRole;
use athermal::core::fit::{FitOptions, fit};
use athermal::core::prng::Prng;
use athermal::core::recording::Table;
use workbench::{Bench, linear, plan, secs, slot};

const AXES: [&str; 3] = ["X", "Y", "Z"];
/// Eleven are eight whose products are summed at once and three that are left.
const SENSORS: [&str; 11] = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k"];
const KINDS: [&str; 4] = ["thermal", "few", "motion", "both"];

/// `of_each` are more keys of each estimator.
fn graph(axes: &[&str], of_each: &str) -> String {
    format!(
        r#"
schema = 1
sets.axis = {axes:?}
signals.temperature = {{ unit = "Cel", channels = {SENSORS:?}, max_age = "20s" }}
signals.position = {{ unit = "nm", channels = "axis", max_age = "40s" }}
[nodes.thermal]
type = "linear"
each = "axis"
inputs.features = "temperature"
inputs.truth = "position.{{axis}}"
ahead = "10s"
{of_each}
[nodes.few]
type = "linear"
each = "axis"
inputs.features = ["temperature.a", "temperature.c"]
inputs.truth = "position.{{axis}}"
ahead = "10s"
{of_each}
[nodes.motion]
type = "ar"
each = "axis"
inputs.truth = "position.{{axis}}"
ahead = "10s"
{of_each}
lags = ["0s", "10s"]
[nodes.both]
type = "arx"
each = "axis"
inputs.features = "temperature"
inputs.truth = "position.{{axis}}"
ahead = "10s"
{of_each}
lags = ["0s", "10s"]
[outputs]
thermal = "thermal"
few = "few"
motion = "motion"
both = "both"
"#
    )
}

/// Coefficients of all estimators, of one axis the same whatever others there are.
fn bench(axes: &[&str]) -> Bench {
    let text = graph(axes, "");
    let fitted = plan(&text).nodes.clone().into_iter().map(|node| {
        let PlannedRole::Estimator { regressors, .. } = &node.role else {
            panic!("all nodes are estimators");
        };
        let name = node.instance();
        let mut random = Prng::stream(7, &name);
        let terms: Vec<_> = regressors
            .iter()
            .map(|regressor| (&*regressor.name, random.normal()))
            .collect();
        let fit = linear(&terms, random.normal());
        (name, fit)
    });
    let fitted: Vec<_> = fitted.collect();
    let named: Vec<_> = fitted
        .iter()
        .map(|(name, fit)| (&**name, std::sync::Arc::clone(fit)))
        .collect();
    Bench::new(&text, &named)
}

/// A row every few seconds: now and then a sensor is silent, a position more often, and all of them for a while.
fn rows() -> Vec<(f64, Vec<(String, f64)>)> {
    let mut random = Prng::stream(7, "samples");
    let mut seconds = 0.0;
    let mut row = |nth: usize| {
        seconds += random.between(1.0, 4.0);
        let mut samples = Vec::new();
        let sensors = SENSORS.map(|name| ("temperature", name, 0.05));
        let axes = AXES.map(|name| ("position", name, 0.5));
        for (signal, name, silent) in sensors.into_iter().chain(axes) {
            let sample = random.normal();
            let pauses = (200..215).contains(&(nth % 400)) || nth % 100 < 20 && name == "c";
            if random.between(0.0, 1.0) >= silent && !pauses {
                samples.push((format!("{signal}.{name}"), sample));
            }
        }
        (seconds, samples)
    };
    (0..1600).map(&mut row).collect()
}

/// How often each kind of estimator gave a value, and how often it gave none.
#[derive(Debug, Default)]
struct Seen {
    there: [u32; KINDS.len()],
    missing: [u32; KINDS.len()],
}

impl Seen {
    /// Steps an engine of all axes, and one of each, to the same instant and compares what they give.
    fn step(&mut self, all: &mut Bench, alone: &mut [Bench; 3], row: &(f64, Vec<(String, f64)>)) {
        let (seconds, samples) = row;
        let of = |names: &[&str]| -> Vec<(&str, f64)> {
            let known = samples.iter().filter(|(name, _)| {
                names.iter().any(|axis| *name == format!("position.{axis}"))
                    || name.starts_with("temperature")
            });
            known.map(|(name, value)| (&**name, *value)).collect()
        };
        all.tick(*seconds, &of(&AXES));
        for (axis, alone) in AXES.iter().zip(alone) {
            alone.tick(*seconds, &of(&[axis]));
            for (nth, kind) in KINDS.iter().enumerate() {
                let name = format!("{kind}.{axis}");
                let (one, other) = (all.value(&name), alone.value(&name));
                assert_eq!(one.to_bits(), other.to_bits(), "{name} at {seconds} s");
                assert_eq!(all.ran(&name), alone.ran(&name), "{name} at {seconds} s");
                assert_eq!(
                    all.stamp(&name),
                    alone.stamp(&name),
                    "{name} at {seconds} s"
                );
                *(if one.is_nan() {
                    &mut self.missing
                } else {
                    &mut self.there
                })
                .get_mut(nth)
                .unwrap() += 1;
            }
        }
    }

    fn is_telling(&self) -> bool {
        self.there
            .iter()
            .chain(&self.missing)
            .all(|&count| count > 50)
    }
}

#[test]
fn estimators_that_share_regressors_predict_the_bits_that_each_predicts_alone() {
    let mut all = bench(&AXES);
    let mut alone = AXES.map(|axis| bench(&[axis]));
    let mut seen = Seen::default();
    for row in rows() {
        seen.step(&mut all, &mut alone, &row);
    }
    assert!(seen.is_telling(), "{seen:?}");
}

/// Frozen now and then, over a break in the data, and from a snapshot on.
#[test]
fn estimators_that_go_on_learning_predict_at_once_what_each_predicts_alone() {
    let learning = "learn = true\nsolver = { type = \"sgd\" }";
    let rows = rows();
    let of_all = plan(&graph(&AXES, learning));
    let mut table = Table::default();
    for (seconds, samples) in &rows[..800] {
        let mut values = vec![ABSENT; of_all.sources.len()];
        for (name, value) in samples {
            values[slot(&of_all, name)] = *value;
        }
        table.push(secs(*seconds), &values);
    }
    let fitted = fit(&of_all, &table, &FitOptions::default(), &mut |_| ()).unwrap();
    let bench = |axes: &[&str], learning: &str| {
        let named = fitted.0.iter().filter(|(name, _)| {
            let of = |axis: &&str| name.ends_with(&format!(".{axis}"));
            axes.iter().any(of)
        });
        let named: Vec<_> = named.map(|(name, fit)| (&**name, fit.clone())).collect();
        Bench::new(&graph(axes, learning), &named)
    };
    let mut all = bench(&AXES, learning);
    let mut alone = AXES.map(|axis| bench(&[axis], learning));
    let mut as_fitted = bench(&["X"], "");
    let (mut seen, mut learned) = (Seen::default(), [0; KINDS.len()]);
    for (nth, row) in rows.iter().enumerate() {
        for bench in alone.iter_mut().chain([&mut all]) {
            bench.engine.freeze(nth % 300 > 250);
            match nth {
                700 => bench.engine.segment(),
                1100 => {
                    let snapshot = bench.engine.snapshot();
                    let (plan, fitted) = (bench.engine.plan(), bench.engine.fitted());
                    bench.engine = Engine::new(plan.clone(), fitted).unwrap();
                    bench.engine.restore(&snapshot).unwrap();
                }
                _ => {}
            }
        }
        seen.step(&mut all, &mut alone, row);
        let samples: Vec<_> = row
            .1
            .iter()
            .map(|(name, value)| (&**name, *value))
            .collect();
        let known = samples
            .iter()
            .filter(|(name, _)| name.starts_with("temperature") || *name == "position.X");
        as_fitted.tick(row.0, &known.copied().collect::<Vec<_>>());
        for (learned, kind) in learned.iter_mut().zip(KINDS) {
            let name = format!("{kind}.X");
            let (one, other) = (all.value(&name), as_fitted.value(&name));
            *learned += u32::from((one - other).abs() > 1e-6);
        }
    }
    assert!(seen.is_telling(), "{seen:?}");
    assert!(learned.iter().all(|&count| count > 50), "{learned:?}");
}

#[test]
fn an_absent_regressor_silences_those_that_use_it_and_no_others() {
    let mut bench = bench(&AXES);
    let samples: Vec<_> = SENSORS
        .iter()
        .map(|name| format!("temperature.{name}"))
        .collect();
    let mut row: Vec<(&str, f64)> = samples.iter().map(|name| (&**name, 1.0)).collect();
    row.extend([("position.X", 1.0), ("position.Z", 1.0)]);
    bench.tick(0.0, &row);
    bench.tick(10.0, &row);
    let silent = |bench: &Bench, name: &str| bench.value(name).to_bits() == ABSENT.to_bits();
    for axis in AXES {
        assert!(bench.value(&format!("thermal.{axis}")).is_finite());
        assert_eq!(
            bench.value(&format!("both.{axis}")).is_nan(),
            axis == "Y",
            "{axis}"
        );
    }
    row.retain(|(name, _)| *name != "temperature.g");
    bench.tick(31.0, &row);
    for axis in AXES {
        assert!(silent(&bench, &format!("thermal.{axis}")));
        assert!(bench.value(&format!("few.{axis}")).is_finite());
    }
}
