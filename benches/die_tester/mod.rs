//! The die tester's graph, fitted on a simulated week, and the ticks of another: what several benchmarks run.

#![allow(dead_code, reason = "each benchmark uses a part of it")]

pub mod by_hand;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use athermal::core::fit::{FitOptions, fit};
use athermal::core::machine::{Machine, Row, Setup, Simulation};
use athermal::core::recording::Table;
use athermal::{Instant, Model};

pub const CHANNELS: usize = 12;

/// One tick: six temperatures, then six positions, NaN where there is none.
pub type Tick = (Instant, [f64; CHANNELS]);

pub fn graph() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/die-tester.toml")
}

const MACHINE: &dyn Machine = &athermal_simulation::DieTester;

fn simulation(days: f64, seed: u64) -> Box<dyn Simulation> {
    let setup = Setup {
        days,
        seed,
        ..Setup::default()
    };
    MACHINE.start(&setup).expect("the days are positive")
}

pub fn ticks(days: f64, seed: u64) -> Vec<Tick> {
    let mut simulation = simulation(days, seed);
    let mut row = Row::empty(MACHINE.channels());
    let mut ticks = Vec::new();
    while simulation.next(&mut row) {
        let mut values = [f64::NAN; CHANNELS];
        values.copy_from_slice(&row.values);
        ticks.push((Instant::from_ns(row.time_ns), values));
    }
    ticks
}

pub fn table(ticks: &[Tick]) -> Table {
    let mut table = Table::default();
    for (time, values) in ticks {
        table.push(*time, values);
    }
    table
}

/// The graph, fitted on a week.
pub fn model() -> Model {
    let mut model = Model::load(graph()).expect("the shipped graph has no mistakes");
    let week = table(&ticks(7.0, 1));
    let plan = Arc::clone(&model.plan);
    let fitted = fit(&plan, &week, &FitOptions::default(), &mut |_| ());
    model.fitted = fitted.expect("a table in memory can be read").0;
    model
}

/// Writes a simulated log as a table, and gives its size in bytes.
pub fn write(path: &Path, days: f64, seed: u64) -> u64 {
    let mut simulation = simulation(days, seed);
    let file = std::fs::File::create(path).expect("the temporary folder can be written");
    let mut out = std::io::BufWriter::new(file);
    athermal_simulation::write_table(MACHINE.channels(), &mut *simulation, false, &mut out)
        .and_then(|_| std::io::Write::flush(&mut out))
        .expect("the temporary folder can be written");
    std::fs::metadata(path)
        .expect("the file has just been written")
        .len()
}
