//! What an engine of the die tester's graph holds, by a counting allocator, and what a tick costs where thousands of engines share the
//! caches.
//!
//! `cargo bench --bench memory`: bytes that stay allocated once all windows are full, of the engine alone and of a model beyond the first;
//! microseconds of processor a tick, of one engine and of many that step ten rows each in turn. `ENGINES` says how many, 10,000 as a rule.

mod die_tester;

use std::time::Instant as Clock;

use allocation_counter::measure;
use athermal::{Engine, Instant, Model};
use die_tester::{Tick, model, ticks};

/// The same rows, so many seconds apart; a tenth of the temperatures is missing now and then where there are gaps.
fn apart(ticks: &[Tick], seconds: i64, gaps: bool) -> Vec<Tick> {
    let row = |(nth, (_, values)): (usize, &Tick)| {
        let mut values = values.clone();
        if gaps && nth % 7 == 3 {
            values[nth % 10] = f64::NAN;
        }
        (
            Instant::from_ns(nth as i64 * seconds * 1_000_000_000),
            values,
        )
    };
    ticks.iter().enumerate().map(row).collect()
}

fn warmed(model: &Model, ticks: &[Tick]) -> Engine {
    let mut engine = model.engine().expect("the fit belongs to the graph");
    for (at, values) in ticks {
        engine.step(*at, values).expect("ticks are in order");
    }
    engine
}

/// Bytes of a warm engine.
fn bytes(model: &Model, ticks: &[Tick]) -> i64 {
    let mut kept = None;
    let counted = measure(|| kept = Some(warmed(model, ticks)));
    drop(kept);
    counted.bytes_current
}

fn main() {
    let model = model();
    let ticks = ticks(1.0, 2);
    println!("{:<60}{:>12}", "", "measured");
    for seconds in [10, 1] {
        for (gaps, of) in [(false, "no gaps"), (true, "gaps in temperatures")] {
            let rows = apart(&ticks, seconds, gaps);
            let of = format!("an engine, a row each {seconds} s, {of}");
            println!("{of:<60}{:>9.1} kB", bytes(&model, &rows) as f64 / 1e3);
        }
    }
    let text = model.to_text().expect("a model is text");
    let mut kept = Vec::new();
    for of in ["a model", "a model beyond the first"] {
        let read = || Model::from_text("model.json", text.clone()).expect("it is a model");
        let counted = measure(|| kept.push(read()));
        let bytes = counted.bytes_current as f64 / 1e3;
        println!("{of:<60}{bytes:>9.1} kB");
    }

    let rows = apart(&ticks, 10, false);
    let many = std::env::var("ENGINES").ok().and_then(|of| of.parse().ok());
    for engines in [1, many.unwrap_or(10_000)] {
        let (warm, rest) = rows.split_at(400);
        let mut all: Vec<Engine> = (0..engines).map(|_| warmed(&model, warm)).collect();
        let rounds = (20_000 / engines).max(3);
        let began = Clock::now();
        for rows in rest.chunks(10).cycle().take(rounds.min(rest.len() / 10)) {
            for engine in &mut all {
                let rows = rows.iter().map(|(at, values)| (*at, &values[..]));
                let look = |engine: &Engine, _| _ = std::hint::black_box(engine.outputs());
                engine.step_rows(rows, look).expect("ticks are in order");
            }
        }
        let stepped = 10 * engines * rounds.min(rest.len() / 10);
        let us = began.elapsed().as_secs_f64() * 1e6 / stepped as f64;
        println!(
            "{:<60}{us:>9.2} µs",
            format!("a tick, {engines} engines, ten rows at a time")
        );
    }
}
