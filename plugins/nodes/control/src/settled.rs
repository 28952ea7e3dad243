//! How long a machine takes to settle after its set point has changed.

use athermal_core::channel::{ABSENT, Channel, is_unchanged};
use athermal_core::node::{
    Duty, Feature, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs,
    PortSummary, Restored, State, Tick,
};
use athermal_core::quantity::Quantity;
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::limit;

/// The settle time: from a change of the set point to the start of the first ten minutes that are stable throughout.
///
/// `settle_time = t₁ − t₀`, with `t₀` the change and `t₁` the start. Stable is what lies below `below`, usually the
/// optical loss over five minutes below 0.2 dB. The set point may be a measured temperature. A change is a departure by
/// more than `change` from where it stood at the change before. What it does within `same_change` of that belongs to
/// it. A value of the loss counts until the next. `settle_time` is given once the machine has been stable for `for`;
/// `since` is the time since a change that has not settled yet, and 0 when it has. A pause longer than `max_gap`
/// between two values of the loss is no stable time. Runs at every tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Settled {
    /// Below this the machine is stable: `"0.2 dB"`.
    #[schemars(extend("minimum" = 0))]
    pub below: Quantity,
    /// The smallest change of the set point that counts: `"5 K"`.
    #[schemars(extend("minimum" = 0))]
    pub change: Quantity,
    /// For how long it must be stable.
    #[serde(default = "ten_minutes")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub r#for: Duration,
    /// How long after its start a change still counts as the same one.
    #[serde(default = "ten_minutes")]
    pub same_change: Duration,
    /// The longest pause between values that are stable throughout.
    #[serde(default = "five_minutes")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_gap: Duration,
}

fn ten_minutes() -> Duration {
    Duration::from_ns(600_000_000_000)
}

fn five_minutes() -> Duration {
    Duration::from_ns(300_000_000_000)
}

impl Settled {
    fn limits(&self, inputs: &Inputs) -> Result<(f64, f64), Vec<Mistake>> {
        let mut mistakes = Vec::new();
        let mut one = |port: &'static str| match inputs.port(port) {
            [channel] => Some(channel.clone()),
            channels => {
                let message = format!("`{port}` takes one channel and is given {}", channels.len());
                mistakes.push(Mistake::at(format!("inputs.{port}"), message));
                None
            }
        };
        let (loss, set_point) = (one("loss"), one("set_point"));
        let below = loss.and_then(|loss| {
            limit::size_or_none(Some(&self.below), &loss.unit, "below", &mut mistakes)
        });
        let change = set_point.and_then(|set_point| {
            let unit = set_point.unit.difference();
            limit::size_or_none(Some(&self.change), &unit, "change", &mut mistakes)
        });
        match (below, change) {
            (Some(below), Some(change)) if mistakes.is_empty() => Ok((below, change)),
            _ => Err(mistakes),
        }
    }
}

impl Feature for Settled {
    fn facts() -> KindFacts {
        KindFacts::of(Duty::Settle {
            below: "below",
            change: "change",
        })
        .change()
    }

    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::fresh(
                    "loss",
                    "what says whether the machine is stable: one channel",
                ),
                InputPort::fresh(
                    "set_point",
                    "what is set, or a temperature that follows it at once: one channel",
                ),
            ]
        }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("settle_time", "in min, once it is known"),
                PortSummary::new(
                    "since",
                    "the time in min since a change that has not settled; 0 when it has",
                ),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        self.limits(inputs)?;
        let minutes = |name: &str| Channel {
            name: name.to_owned(),
            unit: Unit::parse("min").unwrap_or_else(|_| Unit::second()),
            span: Duration::ZERO,
            ahead: Duration::ZERO,
            max_age: Some(self.max_gap),
        };
        Ok(vec![
            OutputPort {
                name: "settle_time",
                channels: vec![minutes("settle_time")],
            },
            OutputPort {
                name: "since",
                channels: vec![minutes("since")],
            },
        ])
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let (below, change) = self.limits(inputs).unwrap_or((ABSENT, ABSENT));
        Box::new(Settling {
            spec: self.clone(),
            below,
            change,
            known: Known::default(),
        })
    }

    fn every_tick(&self) -> bool {
        true
    }

    fn memory(&self) -> Duration {
        self.r#for
    }
}

struct Settling {
    spec: Settled,
    below: f64,
    change: f64,
    known: Known,
}

/// The state.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct Known {
    /// Where the set point stood when it last changed, and when that was.
    stood: Option<f64>,
    changed: Option<Instant>,
    waiting: bool,
    /// Since when the loss has been low, and its newest value's time.
    low_since: Option<Instant>,
    newest: Option<Instant>,
}

impl Settling {
    fn set_point(&mut self, value: f64, now: Instant) {
        let known = &mut self.known;
        let same = known
            .changed
            .is_some_and(|changed| now - changed <= self.spec.same_change);
        match known.stood {
            Some(stood) if !same && (value - stood).abs() > self.change => {
                known.changed = Some(now);
                known.waiting = true;
                known.low_since = None;
                known.stood = Some(value);
            }
            Some(_) if same => known.stood = Some(value),
            Some(_) => {}
            None => known.stood = Some(value),
        }
    }

    /// A value of the loss counts until the next one, though not beyond `max_gap`.
    fn pass(&mut self, now: Instant) -> Option<Duration> {
        let known = &mut self.known;
        let gap = known
            .newest
            .is_some_and(|newest| now - newest > self.spec.max_gap);
        if gap {
            known.low_since = None;
        }
        let (changed, low) = known.changed.zip(known.low_since)?;
        if known.waiting && now - low >= self.spec.r#for {
            known.waiting = false;
            return Some(low - changed);
        }
        None
    }

    fn loss(&mut self, value: f64, now: Instant) {
        let known = &mut self.known;
        // An absent loss is not low.
        known.low_since = (value < self.below).then(|| known.low_since.unwrap_or(now));
        known.newest = Some(now);
    }
}

impl Operator for Settling {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let (loss, set_point) = (tick.port(0)[0], tick.port(1)[0]);
        if let Some(time) = self.pass(tick.now) {
            outputs.set_stamped(0, time.secs() / 60.0, tick.now);
        }
        if !set_point.is_nan() {
            self.set_point(set_point, tick.now);
        }
        if !is_unchanged(loss) {
            self.loss(loss, tick.now);
        }
        let since = match self.known.changed {
            Some(changed) if self.known.waiting => (tick.now - changed).secs() / 60.0,
            _ => 0.0,
        };
        outputs.set_stamped(1, since, tick.now);
    }

    fn segment(&mut self) {
        self.known = Known::default();
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.known.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.replace(&mut self.known)
    }
}

athermal_core::state!(Known, "settled/1");

athermal_core::register!(Settled, Feature, "settled");
