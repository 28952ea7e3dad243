//! How often each slot of a plan is given something, as the room for its past is made.

use std::collections::BTreeMap;

use athermal_core::compile::{Plan, PlannedNode, PlannedRole};
use athermal_core::time::Duration;

use crate::error::ExportError;

/// The time between two samples: of all signals, and of some.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rates {
    /// Of every signal that is not named.
    pub period: Duration,
    /// Of signals by name.
    pub signals: BTreeMap<String, Duration>,
}

impl Default for Rates {
    fn default() -> Self {
        Self {
            period: Duration::from_ns(1_000_000_000),
            signals: BTreeMap::new(),
        }
    }
}

impl Rates {
    /// One for all.
    #[must_use]
    pub fn every(period: Duration) -> Self {
        Self {
            period,
            signals: BTreeMap::new(),
        }
    }

    /// Those of the data that a model was fitted on, in seconds by signal; a signal of which they do not say it is taken to be as fast as
    /// the fastest. None where they say nothing.
    #[must_use]
    pub fn of_data(usual: &BTreeMap<String, f64>) -> Option<Self> {
        let signals = usual.iter().filter_map(|(signal, seconds)| {
            let period = Duration::from_secs_f64(*seconds)?;
            (period > Duration::ZERO).then(|| (signal.clone(), period))
        });
        let signals: BTreeMap<String, Duration> = signals.collect();
        let period = *signals.values().min()?;
        Some(Self { period, signals })
    }

    /// And this for a signal.
    #[must_use]
    pub fn with(mut self, signal: &str, period: Duration) -> Self {
        self.signals.insert(signal.to_owned(), period);
        self
    }

    fn of(&self, source: &str) -> Duration {
        let signal = source.split('.').next().unwrap_or(source);
        self.signals.get(signal).copied().unwrap_or(self.period)
    }
}

/// The least time between two values of each slot, in nanoseconds, and between two ticks. Samples of several signals are taken to come
/// together: one that is three times as frequent comes at every tick of the other too.
#[derive(Debug)]
pub(crate) struct Periods {
    pub(crate) slots: Vec<i64>,
    pub(crate) tick: i64,
}

impl Periods {
    pub(crate) fn new(plan: &Plan, rates: &Rates) -> Result<Self, ExportError> {
        let names = || plan.sources.iter().map(|source| &source.name);
        let signals = || names().map(|name| name.split('.').next().unwrap_or(name));
        let all = rates
            .signals
            .iter()
            .map(|(name, period)| (&**name, *period));
        for (name, period) in all.chain([("the signals", rates.period)]) {
            if period <= Duration::ZERO {
                return Err(ExportError::Rate {
                    signal: name.to_owned(),
                    given: period.to_string(),
                });
            }
        }
        if let Some(unknown) = rates
            .signals
            .keys()
            .find(|name| !signals().any(|signal| signal == **name))
        {
            let mut known: Vec<&str> = signals().collect();
            known.dedup();
            return Err(ExportError::UnknownSignal {
                signal: unknown.clone(),
                known: known.join(", "),
            });
        }
        let sources: Vec<i64> = names().map(|name| rates.of(name).as_ns()).collect();
        let tick = sources.iter().copied().min().unwrap_or(1_000_000_000);
        let mut periods = Self {
            slots: vec![tick; plan.channels.len()],
            tick,
        };
        periods.slots[..sources.len()].copy_from_slice(&sources);
        for node in &plan.nodes {
            periods.follow(plan, node);
        }
        Ok(periods)
    }

    /// The least time between two values of anything in a gather.
    pub(crate) fn of_gather(&self, plan: &Plan, gather: usize) -> i64 {
        let entries = plan.gathers[gather].entries.iter();
        let periods = entries.map(|entry| self.slots[entry.slot]);
        periods.min().unwrap_or(self.tick)
    }

    /// The least time between two runs of a combiner.
    pub(crate) fn of_votes(&self, plan: &Plan, voters: usize, state: Option<usize>) -> i64 {
        let voters = self.of_gather(plan, voters);
        let state = state.map_or(i64::MAX, |state| self.of_gather(plan, state));
        voters.min(state)
    }

    fn follow(&mut self, plan: &Plan, node: &PlannedNode) {
        let period = match &node.role {
            PlannedRole::Feature {
                gathers,
                every_tick,
                ..
            } => {
                // Each channel of these is given something where its own input is.
                let own = ["slope", "lag", "first_order", "uncorrected"];
                if own.contains(&node.kind.name)
                    && let Some(&gather) = gathers.first()
                {
                    let inputs = &plan.gathers[gather].entries;
                    // Of several ports each has all channels.
                    let ports = node.ports.iter().filter(|(_, slots)| !slots.is_empty());
                    for (_, slots) in ports {
                        let each = slots.len() / inputs.len().max(1);
                        for (nth, slot) in slots.clone().enumerate() {
                            let input = inputs.get(nth / each.max(1));
                            self.slots[slot] = input.map_or(self.tick, |of| self.slots[of.slot]);
                        }
                    }
                    return;
                }
                if node.kind.name == "cross_check"
                    && let Some(&gather) = gathers.first()
                {
                    // What passes comes as its input does, and reasons at every tick.
                    self.slots[node.slots.clone()].fill(self.tick);
                    let inputs = &plan.gathers[gather].entries;
                    for (slot, input) in node.slots.clone().zip(&inputs[..inputs.len() / 2]) {
                        self.slots[slot] = self.slots[input.slot];
                    }
                    return;
                }
                let all = gathers.iter().map(|&gather| self.of_gather(plan, gather));
                if *every_tick {
                    self.tick
                } else {
                    all.min().unwrap_or(self.tick)
                }
            }
            PlannedRole::Estimator {
                gathers,
                every_tick,
                ..
            } => match gathers.first().filter(|_| !every_tick) {
                Some(&gather) => self.of_gather(plan, gather),
                None => self.tick,
            },
            PlannedRole::Combiner { voters, state, .. } => self.of_votes(plan, *voters, *state),
        };
        self.slots[node.slots.clone()].fill(period);
    }
}
