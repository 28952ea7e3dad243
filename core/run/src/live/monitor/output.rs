//! Whether anything came out of a run.

use super::super::Frame;
use crate::engine::Engine;
use crate::time::Instant;

/// Watches what goes into a sink.
#[derive(Debug, Default)]
pub struct OutputMonitor {
    rows: u64,
    /// Whether an output had a value.
    any: bool,
    /// The first row and the last.
    times: Option<(Instant, Instant)>,
}

/// Rows were put out, and none has a value.
#[derive(Debug, Clone, PartialEq)]
pub struct NoOutput {
    /// Rows that were put out.
    pub rows: u64,
    /// How far apart they are on the average, in s.
    pub apart_s: f64,
    /// The first node that gives nothing.
    pub first_silent: String,
}

impl OutputMonitor {
    /// Takes the frame of a tick.
    pub(crate) fn look(&mut self, frame: &Frame<'_>) {
        self.rows += 1;
        self.any = self.any || frame.outputs.iter().any(|value| !value.is_nan());
        let (first, _) = self.times.unwrap_or((frame.time, frame.time));
        self.times = Some((first, frame.time));
    }

    /// How many rows were put out.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Whether all of them are empty, which looks like an output that works.
    #[must_use]
    pub fn none(&self, engine: &Engine) -> Option<NoOutput> {
        let (first, last) = self.times.filter(|_| !self.any)?;
        let output = engine.plan().outputs.first()?;
        Some(NoOutput {
            rows: self.rows,
            apart_s: (last - first).secs() / (self.rows - 1).max(1) as f64,
            first_silent: engine.first_silent(output.slot),
        })
    }
}
