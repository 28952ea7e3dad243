//! When to measure again: before what a correction has not followed exceeds a tolerance.

use athermal_core::channel::{ABSENT, Channel, is_unchanged};
use athermal_core::node::{
    Duty, Feature, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs,
    PortSummary, Reach, Restored, State, Tick,
};
use athermal_core::quantity::Quantity;
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::limit;

/// Asks for a measurement in time: `lead` before the uncertainty of what a correction has accumulated will exceed `tolerance`.
///
/// A correction integrates a predicted rate, and with it the error of the prediction, whose standard deviation is the
/// input `std_dev`. That error stays about the same for `memory` and is forgotten exponentially. Its integral since the
/// last measurement then has the variance `s² = 2 σ² τ² (T/τ − 1 + exp(−T/τ))` (Uhlenbeck and Ornstein, "On the theory
/// of the Brownian motion", 1930, eq. 15); here it is worked out from tick to tick, so that σ may change. The
/// uncertainty is `sigmas` times the root of it. What is to come is worked out with σ as it is now.
///
/// The port `ask` is 1 where a measurement is asked for, and stays so until a fresh value of `measured` comes.
/// Without that input a measurement counts as made at the tick at which it is asked for. None is asked for sooner
/// than `least` after the last, and one at the latest `longest` after it. The uncertainty is not known before the
/// first measurement, where `std_dev` is absent or was since the last one, and over a minute without a tick. Then a
/// measurement is asked for. The port `due` says in how many minutes the next one is due. The port `why` says why it
/// is: 0 it is not, 1 the tolerance, 2 the longest interval, 3 the uncertainty is not known. Runs at every tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Remeasure {
    /// What the accumulated correction may be off by: `"20 nm"`. The uncertainty is in this unit.
    #[schemars(extend("minimum" = 0))]
    pub tolerance: Quantity,
    /// How long before that a measurement is asked for.
    #[serde(default = "limit::minute")]
    #[schemars(extend("minimum" = 0))]
    pub lead: Duration,
    /// The shortest time from one measurement to the next that is asked for.
    #[serde(default = "limit::minute")]
    #[schemars(extend("minimum" = 0))]
    pub least: Duration,
    /// The longest.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub longest: Duration,
    /// How long an error of the predicted rate stays about the same.
    #[serde(default = "five_minutes")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub memory: Duration,
    /// How many standard deviations the tolerance is to hold.
    #[serde(default = "two")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sigmas: f64,
}

fn five_minutes() -> Duration {
    Duration::from_ns(300_000_000_000)
}

fn two() -> f64 {
    2.0
}

/// The numbers of the port `why`.
const NOT_DUE: f64 = 0.0;
const TOLERANCE: f64 = 1.0;
const LONGEST: f64 = 2.0;
const UNKNOWN: f64 = 3.0;

impl Remeasure {
    /// From the unit of a rate to that of the tolerance per second.
    fn factor(&self, rate: &Channel) -> Option<f64> {
        let of_tolerance = limit::per_second(&self.tolerance.unit);
        rate.unit.factor_to(&of_tolerance)
    }
}

impl Feature for Remeasure {
    fn facts() -> KindFacts {
        KindFacts::of(Duty::Ask {
            tolerance: "tolerance",
        })
    }

    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held(
                    "std_dev",
                    "the standard deviation of each predicted rate that is integrated",
                ),
                InputPort::fresh(
                    "measured",
                    "has a value where what was accumulated has been measured: one, or one per rate",
                )
                .or_none(),
            ]
        }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("ask", "1 where a measurement is asked for, otherwise 0"),
                PortSummary::new("due", "in how many minutes the next one is due"),
                PortSummary::new(
                    "why",
                    "why one is asked for: 0 none is, 1 the tolerance, 2 the longest interval, 3 the uncertainty is not known",
                ),
                PortSummary::new(
                    "uncertainty",
                    "of what each rate has accumulated since it was measured",
                ),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let (std_dev, measured) = (inputs.port("std_dev"), inputs.port("measured"));
        let mut mistakes = Vec::new();
        if let Some(rate) = std_dev.iter().find(|rate| self.factor(rate).is_none()) {
            let unit = &self.tolerance.unit;
            let message = format!("the integral of {} cannot be in {unit}", rate.unit);
            let help = "give it in what the rate changes, such as \"20 nm\" for nm/min";
            mistakes.push(Mistake::at("tolerance", message).help(help));
        }
        if !matches!(measured.len(), 0 | 1) {
            mistakes.extend(limit::same_count("measured", measured, "std_dev", std_dev));
        }
        if self.longest < self.least {
            let message = format!(
                "`longest` ({}) is below `least` ({})",
                self.longest, self.least
            );
            mistakes.push(Mistake::at("longest", message));
        }
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        let channel = |name: &str, unit: Unit| Channel {
            name: name.to_owned(),
            unit,
            span: Duration::ZERO,
            ahead: Duration::ZERO,
            max_age: Some(limit::minute()),
        };
        let minutes = Unit::parse("min").unwrap_or_else(|_| Unit::second());
        let accumulated = |of: &Channel| channel(&of.name, self.tolerance.unit.clone());
        let port = |name, channels| OutputPort { name, channels };
        let one = |name, unit| port(name, vec![channel(name, unit)]);
        Ok(vec![
            one("ask", Unit::one()),
            one("due", minutes),
            one("why", Unit::one()),
            port("uncertainty", std_dev.iter().map(accumulated).collect()),
        ])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, inputs: &Inputs, wanted: &[bool]) -> Box<dyn Operator> {
        let rates = inputs.port("std_dev").iter();
        let factors = rates.map(|of| self.factor(of).unwrap_or(ABSENT));
        let factors: Vec<f64> = factors.collect();
        Box::new(Asking {
            allowed: (self.tolerance.value / self.sigmas).powi(2),
            tells_when: wanted.get(1).is_none_or(|due| *due),
            known: Known {
                unit: self.tolerance.unit.clone(),
                last: None,
                measured: None,
                axes: vec![None; factors.len()],
            },
            factors,
            spec: self.clone(),
        })
    }

    fn every_tick(&self) -> bool {
        true
    }
}

struct Asking {
    spec: Remeasure,
    factors: Vec<f64>,
    /// The variance at which the tolerance is reached.
    allowed: f64,
    /// Whether anybody reads when the next measurement is due.
    tells_when: bool,
    known: Known,
}

/// The state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Known {
    unit: Unit,
    last: Option<Instant>,
    /// When something was measured last.
    measured: Option<Instant>,
    /// What each rate has accumulated since it was measured; nothing is known before, or where its uncertainty was not.
    axes: Vec<Option<Moments>>,
}

/// The variance of an accumulated error, and its covariance with the error of the rate per second.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
struct Moments {
    variance: f64,
    covariance: f64,
}

impl Moments {
    /// After `dt` seconds with a variance of the rate, whose errors are forgotten within `memory` seconds.
    fn after(self, dt: f64, rate: f64, memory: Duration) -> Self {
        let memory = memory.secs();
        let lasting = rate * memory;
        let left = libm::exp(-dt / memory);
        let excess = self.covariance - lasting;
        Self {
            variance: self.variance + 2.0 * (lasting * dt + excess * memory * (1.0 - left)),
            covariance: lasting + excess * left,
        }
    }
}

impl Asking {
    /// In how many seconds a measurement is due, so that the variance reaches what is allowed no sooner than `lead` later; never where
    /// that is longer than `longest`.
    fn due_in(&self, so_far: Moments, rate: f64, longest: f64) -> f64 {
        let (memory, lead) = (self.spec.memory, self.spec.lead.secs());
        let is_within = |dt: f64| so_far.after(dt + lead, rate, memory).variance <= self.allowed;
        if !is_within(0.0) {
            return 0.0;
        }
        if !self.tells_when || is_within(longest) {
            return f64::INFINITY;
        }
        // To a thousandth of the whole, which is enough for a clock.
        let halved = (0..10).fold((0.0, longest), |(from, to), _| {
            let middle = 0.5 * (from + to);
            if is_within(middle) {
                (middle, to)
            } else {
                (from, middle)
            }
        });
        halved.1
    }
}

impl Operator for Asking {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let (std_dev, measured) = (tick.port(0), tick.port(1));
        let is_measured = |i: usize| {
            let mark = measured.get(if measured.len() == 1 { 0 } else { i });
            mark.is_some_and(|mark| !mark.is_nan() && !is_unchanged(*mark))
        };
        let passed = self
            .known
            .last
            .replace(tick.now)
            .map(|last| tick.now - last);
        let bridged = passed.filter(|passed| *passed <= limit::minute());
        if (0..std_dev.len()).any(is_measured) {
            self.known.measured = Some(tick.now);
        }
        let since = self.known.measured.map(|at| (tick.now - at).secs());
        let left = since.map_or(0.0, |since| self.spec.longest.secs() - since);
        let (mut due, mut reason) = (left, LONGEST);
        for i in 0..std_dev.len() {
            let variance = (std_dev[i] * self.factors[i]).powi(2);
            let so_far = match (self.known.axes[i], bridged) {
                _ if is_measured(i) => Some(Moments::default()),
                (Some(so_far), Some(dt)) => {
                    Some(so_far.after(dt.secs(), variance, self.spec.memory))
                }
                _ => None,
            };
            let so_far = so_far.filter(|_| variance.is_finite());
            self.known.axes[i] = so_far;
            let (of_axis, of_why) = so_far.map_or((0.0, UNKNOWN), |so_far| {
                (self.due_in(so_far, variance, left), TOLERANCE)
            });
            if of_axis <= due {
                (due, reason) = (of_axis, of_why);
            }
            let std_dev = so_far.map_or(ABSENT, |so_far| so_far.variance.max(0.0).sqrt());
            outputs.set_stamped(3 + i, self.spec.sigmas * std_dev, tick.now);
        }
        // Not before so long after the last, and then at once.
        let earliest = since.map_or(0.0, |since| self.spec.least.secs() - since);
        let due = due.max(earliest).max(0.0);
        let asks = due == 0.0;
        outputs.set_stamped(0, f64::from(u8::from(asks)), tick.now);
        outputs.set_stamped(1, due / 60.0, tick.now);
        outputs.set_stamped(2, if asks { reason } else { NOT_DUE }, tick.now);
        if asks && measured.is_empty() {
            self.known.measured = Some(tick.now);
            self.known.axes.fill(Some(Moments::default()));
        }
    }

    fn segment(&mut self) {
        (self.known.last, self.known.measured) = (None, None);
        self.known.axes.fill(None);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.known.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.accept(|state: Known| {
            let fits = state.axes.len() == self.known.axes.len() && state.unit == self.known.unit;
            fits.then(|| self.known = state)
                .ok_or("the number of rates or the unit of the tolerance differs")
        })
    }
}

athermal_core::state!(Known, "remeasure/1");

athermal_core::register!(Remeasure, Feature, "remeasure");
