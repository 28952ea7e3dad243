//! Values given later.

use std::collections::VecDeque;
use std::fmt;

use athermal_core::channel::{Channel, is_unchanged};
use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, PortSummary, Reach,
    Restored, State, Tick,
};
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Gives each value later: at the first tick at or after its own plus the delay, or some ticks later.
///
/// `y(t) = x(t − delay)`. The stamp moves with the value. A delay may close a loop; its one channel is then described
/// by `unit`, since what it reads is not yet known where it stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Delay {
    /// How much later: a duration, or `"1 tick"`.
    pub delay: Lateness,
    /// The unit of the channel, where the delay closes a loop.
    #[serde(default)]
    pub unit: Option<Unit>,
}

/// How much later a value is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Lateness {
    /// So many ticks.
    Ticks(u32),
    /// So long.
    Time(Duration),
}

impl TryFrom<String> for Lateness {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let ticks = text
            .trim()
            .strip_suffix("ticks")
            .or_else(|| text.trim().strip_suffix("tick"));
        if let Some(count) = ticks {
            return match count.trim().parse() {
                Ok(count) if count > 0 => Ok(Self::Ticks(count)),
                _ => Err(format!("expected \"1 tick\" or more ticks, found {text:?}")),
            };
        }
        match text.parse::<Duration>() {
            Ok(time) if time > Duration::ZERO => Ok(Self::Time(time)),
            Ok(_) => Err(format!("a delay must be greater than 0, found {text:?}")),
            Err(error) => Err(format!(
                "{error}; a delay is a duration such as \"5min\", or \"1 tick\""
            )),
        }
    }
}

impl From<Lateness> for String {
    fn from(lateness: Lateness) -> Self {
        lateness.to_string()
    }
}

impl fmt::Display for Lateness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ticks(1) => f.write_str("1 tick"),
            Self::Ticks(count) => write!(f, "{count} ticks"),
            Self::Time(time) => write!(f, "{time}"),
        }
    }
}

impl JsonSchema for Lateness {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Lateness".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "type": "string",
            "description": "A duration such as \"5min\", or \"1 tick\".",
            "examples": ["5min", "1 tick"]
        })
    }
}

impl Feature for Delay {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is given later")] }
    }

    fn ports() -> &'static [PortSummary] {
        const { &[PortSummary::new("delayed", "each channel, later")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let known = inputs.port("signal");
        let channels = match (&self.unit, known) {
            (Some(unit), []) => vec![Channel {
                name: inputs.member.clone().unwrap_or_else(|| "value".to_owned()),
                unit: unit.clone(),
                span: Duration::ZERO,
                ahead: Duration::ZERO,
                max_age: None,
            }],
            (None, []) => {
                let mistake = Mistake::at(
                    "inputs.signal",
                    "a delay that closes a loop must say its unit",
                );
                return Err(vec![
                    mistake.help("add `unit = \"nm\"`, the unit of what it delays"),
                ]);
            }
            (Some(unit), channels) => {
                if let Some(other) = channels.iter().find(|channel| channel.unit != *unit) {
                    let message = format!(
                        "`unit` is {unit}, and `{}` is in {}",
                        other.name, other.unit
                    );
                    return Err(vec![
                        Mistake::at("unit", message)
                            .help("leave `unit` out, or give that of the input"),
                    ]);
                }
                channels.to_vec()
            }
            (None, channels) => channels.to_vec(),
        };
        Ok(vec![OutputPort {
            name: "delayed",
            channels,
        }])
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let channels = inputs.port("signal").len().max(1);
        Box::new(Delaying {
            delay: self.delay,
            queues: vec![VecDeque::new(); channels],
            tick: 0,
        })
    }

    fn every_tick(&self) -> bool {
        true
    }

    fn reach(&self, _port: &str) -> Reach {
        // Ticks are apart, nobody knows how far: a value of an earlier one is never that of the present one.
        let least = Duration::from_ns(1);
        Reach::Delayed(vec![self.memory().max(least)])
    }

    fn memory(&self) -> Duration {
        match self.delay {
            Lateness::Ticks(_) => Duration::ZERO,
            Lateness::Time(time) => time,
        }
    }

    fn closes_loops(&self) -> bool {
        true
    }
}

/// The values on their way.
struct Delaying {
    delay: Lateness,
    queues: Vec<VecDeque<Waiting>>,
    tick: u64,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Waiting {
    tick: u64,
    at: Instant,
    value: f64,
    stamp: Instant,
}

impl Delaying {
    fn is_due(&self, waiting: &Waiting, now: Instant) -> bool {
        match self.delay {
            Lateness::Ticks(count) => waiting.tick + u64::from(count) <= self.tick,
            Lateness::Time(time) => waiting.at + time <= now,
        }
    }
}

impl Operator for Delaying {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        self.tick += 1;
        for channel in 0..self.queues.len() {
            let mut due = None;
            while let Some(waiting) = self.queues[channel].front().copied() {
                if !self.is_due(&waiting, tick.now) {
                    break;
                }
                self.queues[channel].pop_front();
                due = Some(waiting);
            }
            if let Some(Waiting {
                at, value, stamp, ..
            }) = due
            {
                let moved = match self.delay {
                    Lateness::Ticks(_) => tick.now - at,
                    Lateness::Time(time) => time,
                };
                outputs.set_stamped(channel, value, stamp + moved);
            }
        }
    }

    fn capture(&mut self, tick: &Tick<'_>) {
        for (queue, (&value, &stamp)) in self
            .queues
            .iter_mut()
            .zip(tick.port(0).iter().zip(tick.stamps(0)))
        {
            if !is_unchanged(value) {
                queue.push_back(Waiting {
                    tick: self.tick,
                    at: tick.now,
                    value,
                    stamp,
                });
            }
        }
    }

    fn segment(&mut self) {
        self.queues.iter_mut().for_each(VecDeque::clear);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(OnTheWay {
            queues: self.queues.clone(),
            tick: self.tick,
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.accept(|state: OnTheWay| {
            if state.queues.len() != self.queues.len() {
                return Err("the number of channels differs");
            }
            (self.queues, self.tick) = (state.queues, state.tick);
            for queue in &mut self.queues {
                // The engine thread must not have to make room.
                queue.reserve(queue.len().max(16));
            }
            Ok(())
        })
    }
}

/// The state of a delay.
#[derive(Debug, Serialize, Deserialize)]
struct OnTheWay {
    queues: Vec<VecDeque<Waiting>>,
    tick: u64,
}

athermal_core::state!(OnTheWay, "delay/1");

athermal_core::register!(Delay, Feature, "delay");
