//! All monitors of a graph at work: whoever runs one shows its rows to these, so that all hosts report the same.

use std::collections::BTreeMap;

use super::{
    Finding, Monitor, NoOutput, OutputMonitor, OutsideFit, RangeMonitor, SensorFault, SensorMonitor,
};
use crate::compile::{Plan, SourceChannel};
use crate::engine::{Engine, SampleRange};
use crate::live::{Feed, TickView};
use crate::time::Instant;

/// What is watched of a graph at work, what was found, and what goes on.
#[derive(Debug)]
pub struct Watch {
    range: RangeMonitor,
    sensors: SensorMonitor,
    output: OutputMonitor,
    /// How often was warned of what.
    warnings: BTreeMap<(&'static str, Option<String>), u64>,
}

impl Watch {
    /// Watches a plan. `read` are the channels in the order of a row's values, of which the first are those of the plan; `usual` is where
    /// samples lay in the fit.
    #[must_use]
    pub fn new(plan: &Plan, read: &[SourceChannel], usual: &[SampleRange]) -> Self {
        Self {
            range: RangeMonitor::new(read, usual),
            sensors: SensorMonitor::new(plan),
            output: OutputMonitor::of(plan),
            warnings: BTreeMap::new(),
        }
    }

    /// How often was warned, by kind and channel; no channel of what is found of a whole graph.
    pub fn warnings(&self) -> impl Iterator<Item = (&'static str, Option<&str>, u64)> {
        let warnings = self.warnings.iter();
        warnings.map(|((kind, channel), count)| (*kind, channel.as_deref(), *count))
    }

    /// The sensors that have been reported and go on failing.
    pub fn faults(&self) -> impl Iterator<Item = (&str, SensorFault)> {
        self.sensors.faults()
    }

    /// The channels of which samples lay far outside of those of the fit.
    pub fn outside_fit(&self) -> impl Iterator<Item = &OutsideFit> {
        self.range.outside_fit()
    }

    /// What is known of a graph that has put out rows, none of which has a value.
    #[must_use]
    pub fn no_output(&self, engine: &Engine) -> Option<NoOutput> {
        self.output.none(engine)
    }

    /// Whether what is found next takes more of the graph than its outputs: none has had a value.
    #[must_use]
    pub fn looks_inside(&self) -> bool {
        self.output.is_empty()
    }

    fn count(&mut self, found: &[Finding]) {
        for (kind, channel) in found.iter().flat_map(Finding::warnings) {
            let known = (kind, channel.map(str::to_owned));
            *self.warnings.entry(known).or_default() += 1;
        }
    }
}

impl Monitor for Watch {
    fn row(&mut self, now: Instant, values: &[f64], found: &mut Vec<Finding>) {
        let before = found.len();
        self.range.row(now, values, found);
        self.sensors.row(now, values, found);
        self.count(&found[before..]);
    }

    fn stepped(&mut self, tick: &TickView<'_>, found: &mut Vec<Finding>) {
        let before = found.len();
        self.output.stepped(tick, found);
        self.count(&found[before..]);
    }

    fn end(&mut self, engine: &Engine, found: &mut Vec<Finding>) {
        let before = found.len();
        self.output.end(engine, found);
        self.count(&found[before..]);
    }

    fn segment(&mut self) {
        self.sensors.segment();
    }

    fn follow(
        &mut self,
        plan: &Plan,
        feed: &[Feed],
        usual: &[SampleRange],
        found: &mut Vec<Finding>,
    ) {
        self.range.follow(plan, feed, usual, found);
        self.sensors.follow(plan, feed, usual, found);
        self.output.follow(plan, feed, usual, found);
    }
}
