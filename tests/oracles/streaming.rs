//! A fit of more rows than memory holds. Decides how much memory years of data may take; what is fitted has its own tests.

use std::sync::Arc;

use crate::workbench::{Graph, plan};
use athermal::Instant;
use athermal::core::compile::Plan;
use athermal::run::fit::{FitOptions, Outcome, fit};
use athermal::run::recording::{Event, Recording, Samples, Source, SourceError};

/// Temperatures that wander, once a second, and a drift that follows two of them.
struct Wandering {
    rows: u64,
}

struct Wander {
    left: u64,
    second: i64,
    state: u64,
    temperatures: [f64; 4],
}

impl Recording for Wandering {
    fn open(&self, _plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        Ok(Box::new(Wander {
            left: self.rows,
            second: 0,
            state: 1,
            temperatures: [21.0; 4],
        }))
    }
}

impl Wander {
    fn uniform(&mut self) -> f64 {
        self.state = self
            .state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    }
}

impl Source for Wander {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        if self.left == 0 {
            return Ok(None);
        }
        self.left -= 1;
        self.second += 1;
        for sensor in 0..4 {
            let step = 0.01 * self.uniform() - 1e-4 * (self.temperatures[sensor] - 21.0);
            self.temperatures[sensor] += step;
        }
        let [first, _, third, _] = self.temperatures;
        let drift = 3.0 * (first - 21.0) - 2.0 * (third - 21.0) + self.uniform();
        samples.values.clear();
        samples.values.extend(self.temperatures);
        samples.values.push(drift);
        Ok(Some(Event::Row(Instant::from_ns(
            self.second * 1_000_000_000,
        ))))
    }
}

fn lagged() -> Graph {
    Graph::new()
        .time("t")
        .signal("temperature", "Cel", "a b c d", "1s")
        .signal("drift", "nm", "Z", "1s")
        .node("lagged", "first_order", "temperature")
        .with("time_constants = ['10s', '1min', '10min']")
        .model("model", "linear", "temperature lagged", "drift.Z", "0s")
        .with("selection = { method = 'forward', folds = { type = 'blocked', count = 5, gap_rows = 600 }, one_standard_error = true }")
        .with("solver = { type = 'ridge', alpha = { by = 'cross_validation', folds = 5 } }")
        .outputs("predicted = 'model'")
}

/// The most memory that this process has had, in bytes.
fn peak() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes << 10)
}

fn stream(rows: u64, memory: usize) {
    let plan: Arc<Plan> = plan(&lagged());
    let options = FitOptions {
        memory,
        ..FitOptions::default()
    };
    let (_, report) = fit(&plan, &Wandering { rows }, &options, &mut |_| {}).unwrap();
    let estimator = &report.estimators[0];
    assert!(estimator.streamed);
    assert!(estimator.rows > rows - 2000, "{}", estimator.rows);
    let Outcome::Fitted(report) = &estimator.outcome else {
        panic!("{estimator:?}")
    };
    let mut first: Vec<&str> = report.selection[..2]
        .iter()
        .map(|step| step.regressor.as_str())
        .collect();
    first.sort_unstable();
    assert_eq!(first, ["temperature.a", "temperature.c"]);
    // The noise is uniform, of variance 1/12.
    let rmse = report.in_sample_rmse.unwrap();
    assert!((rmse - (1.0_f64 / 12.0).sqrt()).abs() < 1e-3, "{rmse}");
    let notes = report.notes.join("; ");
    assert!(notes.contains("folds end at multiples of"), "{notes}");
}

#[test]
fn rows_beyond_the_memory_are_streamed() {
    stream(200_000, 1 << 20);
}

#[test]
#[ignore = "takes minutes: cargo test --release --test oracles -- --ignored a_hundred_million"]
fn a_hundred_million_rows_stream_through_a_fit_in_200_megabytes() {
    let before = std::time::Instant::now();
    stream(100_000_000, 64 << 20);
    let seconds = before.elapsed().as_secs_f64();
    if let Some(peak) = peak() {
        println!("{:.0} MB, {seconds:.0} s", peak as f64 / 1e6);
        assert!(peak < 200_000_000, "{peak}");
    }
}
