//! Estimators that read the same values are predicted at once, to the bits and stamps that each has alone, whatever is missing.

use std::sync::Arc;

use crate::workbench::{Bench, linear, plan, secs, slot};
use athermal::Engine;
use athermal::core::channel::ABSENT;
use athermal::core::compile::PlannedRole;
use athermal::core::node::Predictor;
use athermal::core::prng::Prng;
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::Table;

const AXES: [&str; 3] = ["X", "Y", "Z"];
/// Eleven are eight whose products are summed at once and three that are left.
const SENSORS: [&str; 11] = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k"];
/// Each with what it is made of.
const KINDS: [(&str, &str); 4] = [
    (
        "thermal",
        "type = \"linear\"\ninputs.features = \"temperature\"",
    ),
    (
        "few",
        "type = \"linear\"\ninputs.features = [\"temperature.a\", \"temperature.c\"]",
    ),
    ("motion", "type = \"ar\"\nlags = [\"0s\", \"10s\"]"),
    (
        "both",
        "type = \"arx\"\ninputs.features = \"temperature\"\nlags = [\"0s\", \"10s\"]",
    ),
];
const LEARNING: &str = "learn = true\nsolver = { type = \"sgd\" }";

/// One estimator of each kind and axis, each with these keys too.
fn graph(axes: &[&str], kinds: &[(&str, &str)], keys: &str) -> String {
    let nodes = kinds.iter().map(|(name, kind)| {
        // Whoever reads what is told beside a prediction must read that of the same tick.
        let told = if keys == LEARNING {
            format!("[nodes.told_{name}]\ntype = \"scale\"\neach = \"axis\"\ninputs.signal = \"{name}:learning.{{axis}}\"\n")
        } else {
            String::new()
        };
        format!(
            "[nodes.{name}]\n{kind}\neach = \"axis\"\ninputs.truth = \"position.{{axis}}\"\nahead = \"10s\"\n{keys}\n{told}\
             [outputs.{name}]\nfrom = \"{name}\"\n"
        )
    });
    format!(
        r#"
schema = 1
sets.axis = {axes:?}
signals.temperature = {{ unit = "Cel", channels = {SENSORS:?}, max_age = "20s" }}
signals.position = {{ unit = "nm", channels = "axis", max_age = "40s" }}
{}"#,
        nodes.collect::<String>()
    )
}

/// All estimators at once, and each alone.
struct Benches {
    all: Bench,
    alone: Vec<Bench>,
    there: [u32; KINDS.len()],
    missing: [u32; KINDS.len()],
}

impl Benches {
    /// `fit` is that of an instance.
    fn new(keys: &str, fit: &dyn Fn(&str) -> Arc<dyn Predictor>) -> Self {
        let bench = |axes: &[&str], kinds: &[(&str, &str)]| {
            let names = axes
                .iter()
                .flat_map(|axis| kinds.iter().map(move |(name, _)| format!("{name}.{axis}")));
            let fitted: Vec<_> = names.map(|name| (fit(&name), name)).collect();
            let fitted: Vec<_> = fitted
                .iter()
                .map(|(fit, name)| (&**name, Arc::clone(fit)))
                .collect();
            Bench::new(&graph(axes, kinds, keys), &fitted)
        };
        let each = AXES
            .iter()
            .flat_map(|axis| KINDS.iter().map(move |kind| (*axis, *kind)));
        Self {
            all: bench(&AXES, &KINDS),
            alone: each.map(|(axis, kind)| bench(&[axis], &[kind])).collect(),
            there: [0; KINDS.len()],
            missing: [0; KINDS.len()],
        }
    }

    fn each(&mut self) -> impl Iterator<Item = &mut Bench> {
        self.alone.iter_mut().chain([&mut self.all])
    }

    /// Steps to the same instant, and compares what the nodes give.
    fn step(&mut self, seconds: f64, samples: &[(String, f64)]) {
        for bench in self.each() {
            let plan = Arc::clone(bench.engine.plan());
            let known = |name: &str| plan.sources.iter().any(|source| source.name == name);
            let samples = samples.iter().map(|(name, value)| (&**name, *value));
            let samples: Vec<_> = samples.filter(|(name, _)| known(name)).collect();
            bench.tick(seconds, &samples);
        }
        for (nth, alone) in self.alone.iter().enumerate() {
            let channels = alone.engine.plan().channels.iter();
            for channel in channels.filter(|channel| channel.node.is_some()) {
                let of = |bench: &Bench| {
                    let (value, stamp) = (bench.value(&channel.name), bench.stamp(&channel.name));
                    (value.to_bits(), bench.ran(&channel.name), stamp)
                };
                assert_eq!(of(&self.all), of(alone), "{} at {seconds} s", channel.name);
            }
            let kind = nth % KINDS.len();
            let predicted = alone.engine.outputs()[0];
            let count = if predicted.is_nan() {
                &mut self.missing
            } else {
                &mut self.there
            };
            count[kind] += 1;
        }
    }

    fn is_telling(&self) -> bool {
        let mut counts = self.there.iter().chain(&self.missing);
        counts.all(|&count| count > 50)
    }
}

/// A linear form with coefficients of its own for each instance.
fn of_chance(instance: &str) -> Arc<dyn Predictor> {
    let plan = plan(&graph(&AXES, &KINDS, ""));
    let node = plan.nodes.iter().find(|node| node.instance() == instance);
    let PlannedRole::Estimator { fit, .. } = &node.unwrap().role else {
        panic!("all nodes are estimators");
    };
    let mut random = Prng::stream(7, instance);
    let terms = fit
        .regressors
        .iter()
        .map(|regressor| (&*regressor.name, random.normal()));
    let terms: Vec<_> = terms.collect();
    linear(&terms, random.normal())
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

#[test]
fn estimators_that_share_regressors_predict_the_bits_that_each_predicts_alone() {
    let mut benches = Benches::new("", &of_chance);
    for (seconds, samples) in rows() {
        benches.step(seconds, &samples);
    }
    assert!(
        benches.is_telling(),
        "{:?} {:?}",
        benches.there,
        benches.missing
    );
}

/// Frozen now and then, over breaks in the data, and from snapshots on.
#[test]
fn estimators_that_go_on_learning_predict_at_once_what_each_predicts_alone() {
    let rows = rows();
    let of_all = plan(&graph(&AXES, &KINDS, LEARNING));
    let mut table = Table::default();
    for (seconds, samples) in &rows[..800] {
        let mut values = vec![ABSENT; of_all.sources.len()];
        for (name, value) in samples {
            values[slot(&of_all, name)] = *value;
        }
        table.push(secs(*seconds), &values);
    }
    let (fitted, _) = fit(&of_all, &table, &FitOptions::default(), &mut |_| ()).unwrap();
    let of_fit = |instance: &str| Arc::clone(&fitted[instance]);
    let mut benches = Benches::new(LEARNING, &of_fit);
    let mut as_fitted = Benches::new("", &of_fit);
    let mut learned = [0; KINDS.len()];
    for (nth, (seconds, samples)) in rows.iter().enumerate() {
        for bench in benches.each() {
            bench.engine.freeze(nth % 300 > 250);
            match nth % 400 {
                // Not while a sensor is silent, so that what was learned at the end of a segment shows at once.
                160 => bench.engine.segment(),
                // While nothing is measured, so that nothing is learned before the next prediction.
                205 => {
                    let snapshot = bench.engine.snapshot();
                    let (plan, fitted) = (bench.engine.plan(), bench.engine.fitted());
                    bench.engine = Engine::new(Arc::clone(plan), fitted).unwrap();
                    bench.engine.restore(&snapshot).unwrap();
                }
                _ => {}
            }
        }
        benches.step(*seconds, samples);
        as_fitted.step(*seconds, samples);
        for (learned, (kind, _)) in learned.iter_mut().zip(KINDS) {
            let name = format!("{kind}.X");
            let (one, other) = (benches.all.value(&name), as_fitted.all.value(&name));
            *learned += u32::from((one - other).abs() > 1e-6);
        }
    }
    assert!(
        benches.is_telling(),
        "{:?} {:?}",
        benches.there,
        benches.missing
    );
    assert!(learned.iter().all(|&count| count > 50), "{learned:?}");
}

#[test]
fn an_absent_regressor_silences_those_that_use_it_and_no_others() {
    let mut bench = Benches::new("", &of_chance).all;
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
