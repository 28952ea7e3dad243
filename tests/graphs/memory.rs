//! What an engine and a model hold, by a counting allocator, and what is known of it before.

use std::path::Path;
use std::sync::Arc;

use allocation_counter::measure;
use athermal::core::compile::{Periods, Rates};
use athermal::core::engine::EngineError;
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::Table;
use athermal::{Duration, Engine, Instant, Model};

const GRAPHS: [&str; 2] = ["die-tester.toml", "linear-axis.toml"];

/// Temperatures swing at every tick; everything else follows them and is measured at every seventh. Of some rows a tenth is missing.
fn rows(model: &Model, ticks: i64, seconds: i64, gaps: bool) -> Vec<(Instant, Vec<f64>)> {
    let swing =
        |i: usize, t: f64| ((1.0 + 0.3 * i as f64) * t).sin() + ((0.21 + 0.1 * i as f64) * t).cos();
    let sample = |tick: i64, i: usize, name: &str| {
        let t = tick as f64 / 100.0;
        if gaps && (tick * 7 + 3 * i as i64) % 31 < 3 {
            f64::NAN
        } else if name.starts_with("temperature") {
            25.0 + swing(i, t)
        } else if tick % 7 == 0 {
            0.1 * swing(0, t) + 0.01 * swing(i, t)
        } else {
            f64::NAN
        }
    };
    let sources = || model.plan.sources.iter().enumerate();
    let row = |tick: i64| {
        let at = Instant::from_ns(tick * seconds * 1_000_000_000);
        let samples = sources().map(|(i, source)| sample(tick, i, &source.name));
        (at, samples.collect())
    };
    (0..ticks).map(row).collect()
}

fn fitted(name: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("graphs")
        .join(name);
    let mut model = Model::load(path).unwrap();
    let mut log = Table::default();
    for (at, samples) in rows(&model, 2_000, 10, false) {
        log.push(at, &samples);
    }
    let options = FitOptions::default();
    model.fitted = fit(&model.plan, &log, &options, &mut |_| ()).unwrap().0;
    model
}

fn stepped(mut engine: Engine, rows: &[(Instant, Vec<f64>)]) -> Engine {
    let rows = rows.iter().map(|(at, samples)| (*at, &samples[..]));
    engine.step_rows(rows, |_, _| ()).unwrap();
    engine
}

#[test]
fn an_engine_comes_to_hold_what_its_graph_says_before() {
    for name in GRAPHS {
        let model = fitted(name);
        for seconds in [1, 10, 60] {
            let second = |of: i64| Duration::from_ns(of * 1_000_000_000);
            let mut rates = Rates::every(second(7 * seconds));
            rates
                .signals
                .insert("temperature".to_owned(), second(seconds));
            let rates = Periods::new(&model.plan, &rates).unwrap();
            let said = model.engine().unwrap().holding(&rates);
            let rows = rows(&model, 3_000, seconds, false);
            let mut kept = None;
            let counted = measure(|| kept = Some(stepped(model.engine().unwrap(), &rows)));
            let (said, held) = (said.bytes() as f64, counted.bytes_current as f64);
            println!("{name}, a row each {seconds} s: {said} bytes said, {held} held");
            assert!((said / held - 1.0).abs() < 0.1, "{name}: {said}, {held}");
        }
    }
}

#[test]
fn a_day_of_rows_each_second_with_gaps_takes_no_more_memory_than_its_first_hour() {
    let model = fitted(GRAPHS[0]);
    let rows = rows(&model, 86_400, 1, true);
    let (hour, day) = rows.split_at(3_600);
    let mut engine = stepped(model.engine().unwrap(), hour);
    let mut given = 0_u64;
    let counted = measure(|| {
        let rows = day.iter().map(|(at, samples)| (*at, &samples[..]));
        let look = |engine: &Engine, _| given += u64::from(engine.outputs()[0].is_finite());
        engine.step_rows(rows, look).unwrap();
    });
    assert!(given > 40_000, "{given}");
    assert_eq!((counted.count_total, counted.bytes_current), (0, 0));
}

#[test]
fn rows_stepped_together_give_the_bits_of_each_alone() {
    let model = fitted(GRAPHS[0]);
    let rows = rows(&model, 700, 10, true);
    let (mut alone, mut together) = (model.engine().unwrap(), model.engine().unwrap());
    for rows in rows.chunks(13) {
        let mut given = Vec::new();
        let look = |engine: &Engine, at| given.push((at, engine.outputs().to_vec()));
        let taken = rows.iter().map(|(at, samples)| (*at, &samples[..]));
        together.step_rows(taken, look).unwrap();
        assert_eq!(given.len(), rows.len());
        for ((at, samples), (of, found)) in rows.iter().zip(given) {
            let expected = alone.step(*at, samples).unwrap();
            let bits = |values: &[f64]| values.iter().map(|of| of.to_bits()).collect::<Vec<_>>();
            assert_eq!((of, bits(&found)), (*at, bits(expected)));
        }
    }
    assert_eq!(alone.snapshot(), together.snapshot());
    // What comes before a row that is refused has been taken.
    let (last, samples) = rows.last().unwrap();
    let next = Instant::from_ns(last.as_ns() + 1);
    let wrong = [(next, &samples[..]), (*last, &samples[..])];
    let refused = together.step_rows(wrong, |_, _| ());
    assert!(matches!(refused, Err(EngineError::NotAfter { .. })));
    assert_eq!(together.last(), Some(next));
}

#[test]
fn models_of_one_graph_share_all_but_their_fits() {
    let first = fitted(GRAPHS[0]);
    let mut second = first.clone();
    second.fitted.pop_last();
    let read = |model: &Model| Model::from_text("model.json", model.to_text().unwrap()).unwrap();
    let shared = read(&first);
    let texts = second.to_text().unwrap();
    let mut other = None;
    let counted = measure(|| other = Some(Model::from_text("other.json", texts).unwrap()));
    let other = other.unwrap();
    assert!(Arc::ptr_eq(&shared.plan, &other.plan) && Arc::ptr_eq(&shared.graph, &other.graph));
    assert_eq!(other.fitted.len() + 1, shared.fitted.len());
    assert_eq!(other.to_text().unwrap(), second.to_text().unwrap());
    assert!(counted.bytes_current < 60_000, "{counted:?}");
    // Another graph, however alike, is another.
    let text = first.to_text().unwrap().replace("\"15min\"", "\"16min\"");
    let changed = Model::from_text("model.json", text).unwrap();
    assert!(!Arc::ptr_eq(&shared.plan, &changed.plan));
    // Nothing is held of a graph that no model has any more.
    let plan = Arc::downgrade(&shared.plan);
    drop((shared, other));
    assert!(plan.upgrade().is_none());
}
