//! Values as they were some time ago, and as they are planned to be.

use std::fmt;

use athermal_core::channel::{ABSENT, Channel, is_unchanged};
use athermal_core::node::{
    Feature, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs, Pace,
    PortSummary, Reach, Restored, State, Tick,
};
use athermal_core::time::Duration;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::past::{LookingBack, max_age_mistake};

/// Each channel as it was some time ago, at one lag or several: past values as regressors. A negative lag gives what is planned.
///
/// `y(t) = x(t − lag)`: with every new value at `t` it gives, for each lag, the last value at or before `t − lag`,
/// unless that was older than `max_age` at that instant. With several lags a channel is named by both: `plate1@5min`.
/// The stamp moves with the value. A `delay` gives every value on, each later by the same; a `lag` looks back whenever
/// there is a new one.
///
/// A negative lag, `"-5min"`, gives what will be then, as it is planned at `t`. Only signals with `known_ahead` may be read so, and as far
/// as that says. With a negative lag among the others all are given at every tick, stamped with it, since a plan holds from the instant
/// that it names to the next.
///
/// The search for leaks counts each channel as so much older as its lag says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lag {
    /// How far to look back: `["5min", "10min"]`; each once. Negative is ahead.
    #[schemars(length(min = 1))]
    pub lags: Vec<Shift>,
    /// How old a value may have been at the instant looked back to; by default as old as a held value of the channel may be.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_age: Option<Duration>,
}

/// How far back in time, or with a minus how far ahead.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Shift(pub Duration);

impl Shift {
    /// How far ahead, where it is.
    fn ahead(self) -> Option<Duration> {
        self.0.is_negative().then_some(-self.0)
    }
}

impl TryFrom<String> for Shift {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let ahead = text.trim().strip_prefix(['-', '\u{2212}']);
        let length = ahead.unwrap_or(&text).parse::<Duration>();
        let length = length.map_err(|error| error.to_string())?;
        Ok(Self(if ahead.is_some() { -length } else { length }))
    }
}

impl From<Shift> for String {
    fn from(shift: Shift) -> Self {
        shift.to_string()
    }
}

impl fmt::Display for Shift {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

impl JsonSchema for Shift {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Shift".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "type": "string",
            "description": "A duration such as \"5min\"; \"-5min\" is as far ahead.",
            "examples": ["5min", "-5min"]
        })
    }
}

impl Feature for Lag {
    fn facts() -> KindFacts {
        KindFacts::default().pace(Pace::ByChannel)
    }

    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is looked back at")] }
    }

    fn ports() -> &'static [PortSummary] {
        const { &[PortSummary::new("lagged", "each channel as it was")] }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        for (i, lag) in self.lags.iter().enumerate() {
            if self.lags[..i].contains(lag) {
                let message = format!("the lag {lag} stands twice");
                mistakes.push(Mistake::at(format!("lags.{i}"), message));
            }
        }
        mistakes
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let from = inputs.port("signal");
        if let Some(mistake) = max_age_mistake(self.max_age, from) {
            return Err(vec![mistake]);
        }
        let of = |channel: &Channel, lag: &Shift| Channel {
            name: if self.lags.len() == 1 {
                channel.name.clone()
            } else {
                format!("{}@{lag}", channel.name)
            },
            ..channel.clone()
        };
        let channels = from
            .iter()
            .flat_map(|channel| self.lags.iter().map(move |lag| of(channel, lag)));
        Ok(vec![OutputPort {
            name: "lagged",
            channels: channels.collect(),
        }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Delayed(self.lags.iter().map(|lag| lag.0).collect())
    }

    fn reads_ahead(&self) -> Vec<Duration> {
        self.lags.iter().filter_map(|lag| lag.ahead()).collect()
    }

    fn memory(&self) -> Duration {
        let longest = self.lags.iter().map(|lag| lag.0).max();
        longest.unwrap_or_default().max(Duration::ZERO) + self.max_age.unwrap_or_default()
    }

    fn every_tick(&self) -> bool {
        // A run of the producer that gave nothing is no new value, and still ends the hold of the one before.
        true
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let channels = inputs.port("signal");
        let back = self.lags.iter().filter(|lag| lag.ahead().is_none());
        Box::new(Lagging {
            lags: self.lags.iter().map(|lag| lag.ahead()).collect(),
            channels: channels.len(),
            max_age: self.max_age.unwrap_or(Duration::MAX),
            past: LookingBack::new(back.map(|lag| lag.0).collect(), self.max_age, channels),
        })
    }
}

struct Lagging {
    /// Of each lag how far ahead it is, where it is.
    lags: Box<[Option<Duration>]>,
    channels: usize,
    /// How long before an instant ahead a plan for it may have begun.
    max_age: Duration,
    past: LookingBack,
}

impl Lagging {
    /// Gives a channel at all lags at once, as it was and as it is planned.
    fn plan(&mut self, nth: usize, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let (values, stamps) = (tick.port(0), tick.stamps(0));
        let mut past = self.past.before(nth, tick.now);
        let mut place = nth;
        for (i, ahead) in self.lags.iter().enumerate() {
            let value = match ahead {
                None => past.next().map_or(ABSENT, |(_, value, _)| value),
                Some(_) => {
                    place += self.channels;
                    let is_old = tick.now - stamps[place] > self.max_age;
                    if is_old { ABSENT } else { values[place] }
                }
            };
            outputs.set_stamped(nth * self.lags.len() + i, value, tick.now);
        }
    }
}

impl Operator for Lagging {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let is_planned = self.lags.iter().any(Option::is_some);
        for nth in 0..self.channels {
            let (value, stamp) = (tick.port(0)[nth], tick.stamps(0)[nth]);
            let is_new = !is_unchanged(value) && self.past.take(nth, tick.now, value, stamp);
            if is_planned {
                self.plan(nth, tick, outputs);
            } else if is_new {
                let past = self.past.before(nth, tick.now);
                for (i, (lag, past, stamp)) in past.enumerate() {
                    outputs.set_stamped(nth * self.lags.len() + i, past, stamp + lag);
                }
            }
        }
    }

    fn segment(&mut self) {
        self.past.clear();
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(self.past.snapshot())
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        self.past.restore(state)
    }
}

athermal_core::register!(Lag, Feature, "lag");
