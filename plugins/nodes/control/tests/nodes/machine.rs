//! A graph under test: compiled from its text, stepped in seconds, read by the names of its outputs.

use std::sync::Arc;

use athermal_control as _;
use athermal_core::compile::{Plan, Wanted, compile};
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::document::{Memory, declare, load_text};
use athermal_core::engine::{Engine, Fitted};
use athermal_core::time::Instant;

/// The plan of a graph, or what is wrong with it; and the warnings.
pub fn compiled(text: &str) -> (Result<Plan, String>, String) {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let text = format!("schema = 1\n{text}");
    let document = load_text(
        "graph.toml",
        text,
        &Memory::new(),
        &mut sources,
        &mut diagnostics,
    );
    let graph = document.and_then(|document| declare(document, &mut diagnostics));
    let plan = graph.and_then(|graph| compile(&graph, Wanted::default(), &mut diagnostics));
    let told = diagnostics.render(&sources, false, 140);
    (plan.ok_or_else(|| told.clone()), told)
}

/// A graph that runs.
pub struct Machine {
    pub engine: Engine,
    names: Vec<String>,
}

impl Machine {
    pub fn new(text: &str) -> Self {
        let plan = compiled(text).0.unwrap_or_else(|told| panic!("{told}"));
        let names = plan
            .outputs
            .iter()
            .map(|output| output.name.clone())
            .collect();
        let engine = Engine::new(Arc::new(plan), &Fitted::new()).unwrap();
        Self { engine, names }
    }

    /// Steps to a time in s; NaN where there is no sample.
    pub fn step(&mut self, time_s: f64, samples: &[f64]) -> &mut Self {
        let time = Instant::from_ns((time_s * 1e9) as i64);
        self.engine.step(time, samples).unwrap();
        self
    }

    /// What an output gave at the last step.
    pub fn get(&self, name: &str) -> f64 {
        let place = self.names.iter().position(|known| known == name);
        let place = place.unwrap_or_else(|| panic!("{name} is none of {:?}", self.names));
        self.engine.outputs()[place]
    }
}

/// No sample.
pub const NONE: f64 = f64::NAN;

/// Goes on after a snapshot in another engine, and asserts that both give the same bits from then on.
pub fn goes_on_alike(graph: &str, rows: &[(f64, Vec<f64>)]) {
    let half = rows.len() / 2;
    let mut first = Machine::new(graph);
    for (time, samples) in &rows[..half] {
        first.step(*time, samples);
    }
    let snapshot = first.engine.snapshot();
    let mut second = Machine::new(graph);
    second.engine.restore(&snapshot).unwrap();
    for (time, samples) in &rows[half..] {
        let bits = |machine: &Machine| -> Vec<u64> {
            machine
                .engine
                .outputs()
                .iter()
                .map(|value| value.to_bits())
                .collect()
        };
        assert_eq!(
            bits(first.step(*time, samples)),
            bits(second.step(*time, samples)),
            "at {time} s"
        );
    }
}
