//! How much memory an engine will take once all that it looks back over is full, before it has seen a sample.

use serde::Serialize;

use super::Engine;
use super::tick::{Estimate, Gathered, NodeRunner};
use crate::compile::{Periods, PlannedRole, TruthLink};
use crate::node::{Kept, Role};
use crate::time::Duration;

/// A stretch of the past, and what keeps it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Held {
    /// The instance, or the channel: `gradients`.
    pub of: String,
    /// What is kept of it: `samples`, `runs` that truths are still to come for, `errors` of votes, or `values` that are read with a lag.
    pub what: &'static str,
    /// How much.
    #[serde(flatten)]
    pub kept: Kept,
}

/// All that an engine will hold.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Holding {
    /// The past, window by window, in the order of the plan.
    pub past: Vec<Held>,
    /// Bytes of all else: what does not depend on how often samples come.
    pub rest: u64,
}

impl Holding {
    /// All bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.rest + self.past.iter().map(|of| of.kept.bytes).sum::<u64>()
    }
}

impl Engine {
    /// What the engine will hold where samples come so often, as far as its kinds of nodes say: without gaps, which take a little more, and
    /// without what estimators learn.
    #[must_use]
    pub fn holding(&self, periods: &Periods) -> Holding {
        let plan = &*self.plan;
        let mut past = Vec::new();
        let mut add = |of: &str, what, kept: Vec<Kept>| {
            let held = |kept| Held {
                of: of.to_owned(),
                what,
                kept,
            };
            past.extend(kept.into_iter().map(held));
        };
        for (node, runner) in plan.nodes.iter().zip(&self.nodes) {
            let name = node.instance();
            match (&node.role, node.spec.role()) {
                (
                    PlannedRole::Feature {
                        inputs,
                        gathers,
                        wanted,
                        every_tick,
                        ..
                    },
                    Role::Feature(spec),
                ) => {
                    let periods_of = gathers.iter().map(|&of| periods.of_gather(plan, of));
                    let own = periods_of.min().filter(|_| !every_tick);
                    let every = Duration::from_ns(own.unwrap_or(periods.tick));
                    add(&name, "samples", spec.keeps(inputs, wanted, every));
                }
                (
                    PlannedRole::Combiner {
                        voters,
                        state,
                        truth: Some(truth),
                        ..
                    },
                    Role::Combiner(spec),
                ) => {
                    let every = periods.of_votes(plan, *voters, *state);
                    let width = plan.gathers[*voters].entries.len();
                    let of_truth = Duration::from_ns(periods.slots[truth.slot]);
                    let ends = spec.coverage().map_or(0, |_| 3);
                    add(&name, "runs", runs(truth, every, width + ends));
                    add(&name, "errors", spec.keeps(width, of_truth));
                }
                (PlannedRole::Estimator { fit, .. }, _) => {
                    let learns = runner.estimate().filter(|of| of.learning.is_some());
                    let every = periods.slots[node.slots.start];
                    let runs_of = |of: &Estimate| runs(&fit.truth, every, of.width() + 1);
                    add(&name, "runs", learns.map_or_else(Vec::new, runs_of));
                }
                _ => {}
            }
        }
        for (of, every) in plan.channels.iter().zip(&periods.slots) {
            if let Some(back) = of.history {
                let values = Kept::in_parts(back, Duration::from_ns(*every), 24);
                add(&of.name, "values", values);
            }
        }
        Holding {
            past,
            rest: self.rest() as u64,
        }
    }

    /// Bytes of what does not depend on how often samples come.
    fn rest(&self) -> usize {
        let plan = &*self.plan;
        let slots = 24 * plan.channels.len();
        let of_gather = |of: &Gathered| size_of_val(of) + 16 * of.values.len();
        let gathers: usize = self.gathered.iter().map(of_gather).sum();
        let of_node = |of: &NodeRunner| match of {
            // Its coefficients in a bank, where its regressors are, and its name beside its fit.
            NodeRunner::Estimate(of) => 250 + 16 * of.estimate.as_ref().map_or(0, Estimate::width),
            // Factors, results and what each window is made of.
            NodeRunner::Operator(of) => 500 + 8 * of.slots.len(),
            NodeRunner::Vote(of) => 500 + size_of_val(&**of),
        };
        let nodes: usize = self.nodes.iter().map(of_node).sum();
        let at_edges = 56 * plan.sources.len() + 128 * plan.outputs.len();
        let leaps = self.leaps.bytes();
        size_of_val(self) + size_of_val(&*self.nodes) + slots + gathers + nodes + at_edges + leaps
    }
}

/// Runs that truths may still be paired with, of each of which so many numbers are written down.
fn runs(truth: &TruthLink, every: i64, width: usize) -> Vec<Kept> {
    let back = truth.ahead + truth.embargo();
    Kept::in_parts(back, Duration::from_ns(every), 8 + 8 * width)
}
