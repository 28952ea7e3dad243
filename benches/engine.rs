//! What a tick costs: the slopes, the die tester's graph, the same arithmetic by hand, and starting an engine.

mod die_tester;

use athermal::core::channel::{ABSENT, COLD};
use athermal::{Engine, Instant, Model};
use athermal_features::slope::kernel::{Coverage, NoValue, RollingSlope};
use die_tester::by_hand::{Dense, Learning, Shipped};
use die_tester::{Tick, dense, fitted, has_truth, model, text, ticks, without_novelty};
use divan::Bencher;
use divan::counter::ItemsCount;

fn main() {
    let mut by_hand = Shipped::new(&model());
    same_bits(&model(), &ticks(2.0, 2), |tick| by_hand.step(tick));
    let mut by_hand = Dense::new(&dense::model());
    let ticks = dense::ticks(2.0, 2);
    same_bits(&dense::model(), &ticks, |tick| by_hand.step(tick));
    let mut by_hand = Learning::new(&dense::learning());
    same_bits(&dense::learning(), &ticks, |tick| by_hand.step(tick));
    divan::main();
}

/// A comparison with other results would be none.
fn same_bits(model: &Model, ticks: &[Tick], mut by_hand: impl FnMut(&Tick) -> [f64; 6]) {
    let mut engine = engine(&without_novelty(model));
    let mut predictions = 0;
    for tick in ticks {
        let engine = engine.step(tick.0, &tick.1).expect("ticks are in order");
        let by_hand = by_hand(tick);
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
        assert!(
            engine.iter().zip(&by_hand).all(same),
            "{engine:?} and by hand {by_hand:?}"
        );
        predictions += by_hand.iter().filter(|value| value.is_finite()).count();
    }
    assert!(predictions > 50_000, "only {predictions} predictions");
}

fn engine(model: &Model) -> Engine {
    model.engine().expect("the fit belongs to the graph")
}

/// Two days, after which every window is warm, and the half day that is measured.
fn warm_and_measured() -> (Vec<Tick>, Vec<Tick>) {
    let mut warm = ticks(2.5, 2);
    let measured = warm.split_off(17_280);
    (warm, measured)
}

/// With positions, without them, with what is computed for whoever looks on, and with a learner an axis of all slopes.
#[divan::bench(args = ["positions", "none", "looked into", "rls"], sample_count = 20)]
fn live_ticks(bencher: Bencher, of: &str) {
    let mut model = model();
    let (warm, mut measured) = warm_and_measured();
    if of == "none" {
        measured.retain(|tick| !has_truth(tick));
    } else if of == "looked into" {
        model.plan = model.plan.looked_into().into();
    } else if of == "rls" {
        model = fitted(&learning(), &ticks(7.0, 1));
    }
    let with_inputs = || {
        let mut engine = engine(&model);
        for tick in &warm {
            engine.step(tick.0, &tick.1).expect("ticks are in order");
        }
        engine
    };
    bencher
        .counter(ItemsCount::new(measured.len()))
        .with_inputs(with_inputs)
        .bench_local_values(|mut engine| {
            for tick in &measured {
                let outputs = engine.step(tick.0, &tick.1);
                divan::black_box(outputs.expect("ticks are in order"));
            }
            engine
        });
}

/// The graph in which `rls` is the first voter.
fn learning() -> String {
    let text = text().replace("type = \"linear\"", "type = \"rls\"");
    let is_none_of_it = |line: &&str| !line.starts_with("solver") && !line.starts_with("selection");
    text.lines()
        .filter(is_none_of_it)
        .fold(String::new(), |text, line| text + line + "\n")
}

#[divan::bench(sample_count = 20)]
fn live_ticks_by_hand(bencher: Bencher) {
    let model = model();
    let (warm, measured) = warm_and_measured();
    let with_inputs = || {
        let mut by_hand = Shipped::new(&model);
        for tick in &warm {
            by_hand.step(tick);
        }
        by_hand
    };
    bencher
        .counter(ItemsCount::new(measured.len()))
        .with_inputs(with_inputs)
        .bench_local_values(|mut by_hand| {
            for tick in &measured {
                divan::black_box(by_hand.step(tick));
            }
            by_hand
        });
}

#[divan::bench]
fn start(bencher: Bencher) {
    let model = model();
    bencher.bench_local(|| engine(&model));
}

const SLOPES: usize = 8 * 8;
/// A week at 1 Hz.
const ROWS: i64 = 604_800;

fn windows_s() -> [i64; 8] {
    [30, 60, 120, 240, 480, 600, 900, 1200]
}

#[divan::bench(sample_count = 10)]
fn slopes_in_the_kernel(bencher: Bencher) {
    let coverage = Coverage {
        min_samples: 3,
        min_coverage: 0.5,
        cold_partial: false,
    };
    let no_value = NoValue {
        absent: ABSENT,
        cold: COLD,
    };
    let rows = temperatures();
    let windows = windows_s().map(|s| s * 1_000_000_000);
    bencher
        .counter(ItemsCount::new(ROWS as usize * SLOPES))
        .with_inputs(|| RollingSlope::new(&windows, 8, coverage, no_value, false))
        .bench_local_values(|mut kernel| {
            let mut out = [0.0; SLOPES];
            for (row, samples) in (0..).zip(&rows) {
                kernel.push(row * 1_000_000_000, samples);
                kernel.slopes(&mut out);
                divan::black_box(&out);
            }
            kernel
        });
}

/// Times jitter, and each sensor misses a sample now and then.
#[divan::bench(sample_count = 10)]
fn slopes_in_the_engine(bencher: Bencher) {
    let path = std::env::temp_dir().join(format!("athermal-slopes-{}.toml", std::process::id()));
    let windows = windows_s().map(|s| format!("\"{s}s\"")).join(", ");
    let graph = format!(
        r#"schema = 1
signals.temperature = {{ unit = "Cel", channels = ["a", "b", "c", "d", "e", "f", "g", "h"], max_age = "1min" }}
nodes.gradients = {{ type = "slope", inputs.signal = "temperature", windows = [{windows}], unit = "mK/min" }}
outputs.gradients = "gradients"
"#
    );
    std::fs::write(&path, graph).expect("the temporary folder can be written");
    let model = Model::load(&path).expect("the graph has no mistakes");
    std::fs::remove_file(&path).expect("the file was just written");
    let mut rows = temperatures();
    for (nth, samples) in rows.iter_mut().step_by(7).enumerate() {
        samples[nth % 8] = f64::NAN;
    }
    bencher
        .counter(ItemsCount::new(ROWS as usize * SLOPES))
        .with_inputs(|| engine(&model))
        .bench_local_values(|mut engine| {
            for (row, samples) in (0..).zip(&rows) {
                let time = Instant::from_ns(row * 1_000_000_000 + row * 37 % 900 * 1_000_000);
                let outputs = engine.step(time, samples);
                divan::black_box(outputs.expect("ticks are in order"));
            }
            engine
        });
}

fn temperatures() -> Vec<[f64; 8]> {
    let row = |row: i64| {
        let wander = (row as f64 * 1e-3).sin();
        [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0].map(|channel| 21.0 + channel + wander)
    };
    (0..ROWS).map(row).collect()
}
