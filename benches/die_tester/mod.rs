//! The die tester's graph, fitted on a simulated week, and the ticks of another: what several benchmarks run.

#![allow(dead_code, reason = "each benchmark uses a part of it")]

pub mod by_hand;
pub mod dense;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use athermal::core::compile::{Outside, PlannedRole, Wanted, compile};
use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::core::document::{Disk, declare, load_text};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::Table;
use athermal::trial::machine::{Machine, Row, Setup, Simulation};
use athermal::{Instant, Model};

/// One tick: temperatures, then six positions, NaN where there is none.
pub type Tick = (Instant, Vec<f64>);

pub const AXES: usize = 6;

pub fn graph() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/die-tester.toml")
}

const MACHINE: &dyn Machine = athermal_simulation::MACHINES[0];

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
        ticks.push((Instant::from_ns(row.time_ns), row.values.clone()));
    }
    ticks
}

pub fn has_truth((_, values): &Tick) -> bool {
    !values[values.len() - AXES].is_nan()
}

pub fn table(ticks: &[Tick]) -> Table {
    let mut table = Table::default();
    for (time, values) in ticks {
        table.push(*time, values);
    }
    table
}

pub fn text() -> String {
    std::fs::read_to_string(graph()).expect("the shipped graph is there")
}

/// The graph, fitted on a week.
pub fn model() -> Model {
    fitted(&text(), &ticks(7.0, 1))
}

/// A graph from its text, fitted on these ticks.
pub fn fitted(text: &str, ticks: &[Tick]) -> Model {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let name = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/of-a-benchmark.toml");
    let document = load_text(name, text, &Disk, &mut sources, &mut diagnostics);
    let graph = document.and_then(|document| declare(document, &mut diagnostics));
    let plan = graph
        .as_ref()
        .and_then(|graph| compile(graph, Wanted::default(), &mut diagnostics));
    let (Some(graph), Some(plan)) = (graph, plan) else {
        panic!("{}", diagnostics.render(&sources, false, 100));
    };
    let plan = Arc::new(plan);
    let fitted = fit(&plan, &table(ticks), &FitOptions::default(), &mut |_| ());
    Model {
        graph: Arc::new(graph),
        fitted: fitted.expect("a table in memory can be read").0,
        plan,
        card: None,
    }
}

/// The model as one that does not know how far its fit reaches: by hand nothing is known of that.
pub fn without_novelty(model: &Model) -> Model {
    let text = model.to_text().expect("a model is text");
    let mut json: serde_json::Value = serde_json::from_str(&text).expect("it is JSON");
    remove(&mut json["fitted"]);
    let name = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/of-a-benchmark.json");
    Model::from_text(name, json.to_string()).expect("what is left is a model")
}

fn remove(json: &mut serde_json::Value) {
    if let Some(object) = json.as_object_mut() {
        object.remove("novelty");
        object.values_mut().for_each(remove);
    }
}

/// The model with `outside = "pass"`, in which nobody reads a novelty, so that none is worked out.
pub fn passing(model: &Model) -> Model {
    let mut plan = (*model.plan).clone();
    for node in &mut plan.nodes {
        match &mut node.role {
            PlannedRole::Estimator {
                outside, novelty, ..
            } => (*outside, *novelty) = (Outside::Pass, None),
            PlannedRole::Combiner { beside, .. } => beside.novelties = None,
            PlannedRole::Feature { .. } => {}
        }
    }
    Model {
        plan: Arc::new(plan),
        graph: model.graph.clone(),
        fitted: model.fitted.clone(),
        card: None,
    }
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
