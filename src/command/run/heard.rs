//! Decides whether anything came out of a run, and what is said where nothing did.

use athermal::Instant;
use athermal::core::engine::Engine;
use athermal::run::live::{Frame, Sink, SinkError};
use serde_json::json;

use crate::message::Message;
use crate::terminal::Terminal;
use athermal_analysis::figures::{counted, time};

/// A sink whose rows are looked at on their way.
pub struct Heard<'a, S> {
    sink: &'a mut S,
    rows: u64,
    /// Whether an output had a value.
    any: bool,
    /// The first row and the last.
    times: Option<(Instant, Instant)>,
}

impl<'a, S> Heard<'a, S> {
    /// Listens to what goes into a sink.
    pub fn of(sink: &'a mut S) -> Self {
        Self {
            sink,
            rows: 0,
            any: false,
            times: None,
        }
    }

    /// Tells that nothing came out, with the first node that gives nothing: an output full of empty cells looks like one that works.
    pub fn end(&self, terminal: &Terminal, engine: &Engine) {
        let plan = engine.plan();
        let (Some((first, last)), Some(output)) = (self.times, plan.outputs.first()) else {
            return;
        };
        if self.any {
            return;
        }
        let silent = engine.first_silent(output.slot);
        let apart = (last - first).secs() / (self.rows - 1).max(1) as f64;
        let pace = match apart > 0.0 {
            true => format!(", which are {} apart", time(apart)),
            false => String::new(),
        };
        let words = format!(
            "no output has a value in any of {}{pace}; the first to lack one is {silent}",
            counted(self.rows, "row")
        );
        let facts = json!({ "ticks": self.rows, "first_silent": silent });
        terminal.warning(Message::new("no_output", facts, words));
    }

    /// How many rows went into it.
    pub fn rows(&self) -> u64 {
        self.rows
    }
}

impl<S: Sink> Sink for Heard<'_, S> {
    fn put(&mut self, frame: &Frame<'_>) -> Result<(), SinkError> {
        self.rows += 1;
        self.any = self.any || frame.outputs.iter().any(|value| !value.is_nan());
        let (first, _) = self.times.unwrap_or((frame.time, frame.time));
        self.times = Some((first, frame.time));
        self.sink.put(frame)
    }

    fn flush(&mut self) -> Result<(), SinkError> {
        self.sink.flush()
    }

    fn finish(&mut self) -> Result<(), SinkError> {
        self.sink.finish()
    }
}
