//! Whether anything comes out of a graph at work.

use super::{Finding, Monitor};
use crate::compile::Plan;
use crate::engine::{Engine, SampleRange};
use crate::live::{Feed, TickView};
use crate::time::{Duration, Instant};

/// A graph is given so long beyond its warm-up until that is reported, as a sensor that has not had a sample yet.
const PATIENCE: Duration = Duration::from_ns(3_600_000_000_000);
/// And so many rows.
const FEWEST: u64 = 20;

/// Watches what is put out.
#[derive(Debug, Default)]
pub struct OutputMonitor {
    rows: u64,
    /// Whether an output had a value.
    any: bool,
    /// The first row and the last.
    times: Option<(Instant, Instant)>,
    /// How long the graph takes to warm up.
    warm_up: Duration,
    is_reported: bool,
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
    /// Watches the outputs of a plan.
    #[must_use]
    pub fn of(plan: &Plan) -> Self {
        Self {
            warm_up: plan.warm_up,
            ..Self::default()
        }
    }

    /// Takes the outputs of a tick.
    pub(crate) fn look(&mut self, now: Instant, outputs: &[f64]) {
        self.rows += 1;
        self.any = self.any || outputs.iter().any(|value| !value.is_nan());
        let (first, _) = self.times.unwrap_or((now, now));
        self.times = Some((first, now));
    }

    /// How many rows were put out.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Whether no output has had a value so far.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.any
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

impl Monitor for OutputMonitor {
    fn row(&mut self, _: Instant, _: &[f64], _: &mut Vec<Finding>) {}

    fn stepped(&mut self, tick: &TickView<'_>, found: &mut Vec<Finding>) {
        self.look(tick.at, tick.outputs);
        let is_long = |(first, last)| last - first >= self.warm_up + PATIENCE;
        if self.rows >= FEWEST
            && self.times.is_some_and(is_long)
            && let Some(engine) = tick.engine
        {
            self.end(engine, found);
        }
    }

    fn end(&mut self, engine: &Engine, found: &mut Vec<Finding>) {
        if self.any || self.is_reported {
            return;
        }
        let none = self.none(engine);
        self.is_reported = none.is_some();
        found.extend(none.map(Finding::NoOutput));
    }

    fn follow(&mut self, plan: &Plan, _: &[Feed], _: &[SampleRange], _: &mut Vec<Finding>) {
        self.warm_up = plan.warm_up;
    }
}
