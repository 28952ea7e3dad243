//! How often each slot of a plan is given something, where it is known how often samples come: the room for its past follows.

use std::collections::BTreeMap;

use thiserror::Error;

use super::{Plan, PlannedNode, PlannedRole};
use crate::node::Pace;
use crate::time::{Duration, DurationError};

/// Why samples do not come so often.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RateError {
    /// The time between two samples is not above 0.
    #[error(
        "the rate of `{signal}` is {given}: give the time between two samples, above 0, such as --rate {signal}=1s"
    )]
    NotAbove {
        /// The signal.
        signal: String,
        /// What was given.
        given: String,
    },
    /// A rate of a signal that the graph does not have.
    #[error("there is no signal `{signal}`: the graph has {known}")]
    UnknownSignal {
        /// The signal.
        signal: String,
        /// Those that there are.
        known: String,
    },
    /// What was given is no time.
    #[error("--rate {given}: {reason}")]
    NoTime {
        /// What was given.
        given: String,
        /// Why not.
        reason: String,
    },
}

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

    /// As given, in words such as `1s` for all signals or `position=10s` for one; else as in the data that a model was fitted on, where
    /// that is known. Whether nothing says how often the others come, which is then taken to be once a second.
    ///
    /// # Errors
    /// Where what was given is no time.
    pub fn given(given: &[String], of_data: Option<Self>) -> Result<(Self, bool), RateError> {
        let of_all = given.iter().any(|rate| !rate.contains('='));
        let is_guessed = of_data.is_none() && !of_all;
        let mut rates = of_data.filter(|_| !of_all).unwrap_or_default();
        for rate in given {
            let (signal, time) = match rate.split_once('=') {
                Some((signal, time)) => (Some(signal), time),
                None => (None, &**rate),
            };
            let time = time
                .parse()
                .map_err(|reason: DurationError| RateError::NoTime {
                    given: rate.clone(),
                    reason: reason.to_string(),
                })?;
            match signal {
                Some(signal) => drop(rates.signals.insert(signal.to_owned(), time)),
                None => rates.period = time,
            }
        }
        Ok((rates, is_guessed))
    }

    fn of(&self, source: &str) -> Duration {
        let signal = source.split('.').next().unwrap_or(source);
        self.signals.get(signal).copied().unwrap_or(self.period)
    }
}

/// The least time between two values of each slot, in nanoseconds, and between two ticks. Samples of several signals are taken to come
/// together: one that is three times as frequent comes at every tick of the other too.
#[derive(Debug)]
pub struct Periods {
    /// By slot.
    pub slots: Vec<i64>,
    /// Between two ticks.
    pub tick: i64,
}

impl Periods {
    /// Those of a plan.
    ///
    /// # Errors
    /// Where a rate is not above 0, or that of no signal.
    pub fn new(plan: &Plan, rates: &Rates) -> Result<Self, RateError> {
        let names = || plan.sources.iter().map(|source| &source.name);
        let signals = || names().map(|name| name.split('.').next().unwrap_or(name));
        let all = rates
            .signals
            .iter()
            .map(|(name, period)| (&**name, *period));
        for (name, period) in all.chain([("the signals", rates.period)]) {
            if period <= Duration::ZERO {
                return Err(RateError::NotAbove {
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
            return Err(RateError::UnknownSignal {
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
    #[must_use]
    pub fn of_gather(&self, plan: &Plan, gather: usize) -> i64 {
        let entries = plan.gathers[gather].entries.iter();
        let periods = entries.map(|entry| self.slots[entry.slot]);
        periods.min().unwrap_or(self.tick)
    }

    /// The least time between two runs of a combiner.
    #[must_use]
    pub fn of_votes(&self, plan: &Plan, voters: usize, state: Option<usize>) -> i64 {
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
                let first = gathers.first().map(|&of| &plan.gathers[of].entries);
                match ((node.kind.facts)().pace, first) {
                    (Pace::ByChannel, Some(inputs)) => {
                        // Of several ports each has all channels.
                        let ports = node.ports.iter().filter(|(_, slots)| !slots.is_empty());
                        for (_, slots) in ports {
                            let each = (slots.len() / inputs.len().max(1)).max(1);
                            for (nth, slot) in slots.clone().enumerate() {
                                let input = inputs.get(nth / each);
                                self.slots[slot] =
                                    input.map_or(self.tick, |of| self.slots[of.slot]);
                            }
                        }
                        return;
                    }
                    (Pace::Passes, Some(inputs)) => {
                        self.slots[node.slots.clone()].fill(self.tick);
                        let first = node.ports.first().map_or(0..0, |(_, slots)| slots.clone());
                        for (slot, input) in first.zip(inputs) {
                            self.slots[slot] = self.slots[input.slot];
                        }
                        return;
                    }
                    (Pace::BySecond, _) if gathers.len() > 1 => {
                        let period = self.of_gather(plan, gathers[1]);
                        self.slots[node.slots.clone()].fill(period);
                        return;
                    }
                    _ => {}
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
        if let PlannedRole::Estimator {
            learning: Some(_), ..
        } = node.role
        {
            // What became of truths is given as these are let through.
            self.slots[node.slots.start + 1] = self.tick;
        }
    }
}
