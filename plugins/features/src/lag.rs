//! Values as they were some time ago.

use athermal_core::channel::{Channel, is_unchanged};
use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, PortSummary, Reach,
    Restored, State, Tick,
};
use athermal_core::time::Duration;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::past::{LookingBack, max_age_mistake};

/// Each channel as it was some time ago, at one lag or several: past values as regressors.
///
/// With every new value at `t` it gives, for each lag, the last value at or before `t − lag`, unless that was older than
/// `max_age` at that instant. With several lags a channel is named by both: `plate1@5min`. The stamp moves with the value. A `delay`
/// gives every value on, each later by the same; a `lag` looks back whenever there is a new one.
///
/// The search for leaks counts each channel as so much older as its lag says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lag {
    /// How far to look back: `["5min", "10min"]`; 0 or more, each once.
    #[schemars(length(min = 1))]
    pub lags: Vec<Duration>,
    /// How old a value may have been at the instant looked back to; by default as old as a held value of the channel may be.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_age: Option<Duration>,
}

impl Feature for Lag {
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
        let of = |channel: &Channel, lag: &Duration| Channel {
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
        Reach::Delayed(self.lags.clone())
    }

    fn memory(&self) -> Duration {
        let longest = self.lags.iter().copied().max();
        longest.unwrap_or_default() + self.max_age.unwrap_or_default()
    }

    fn every_tick(&self) -> bool {
        // A run of the producer that gave nothing is no new value, and still ends the hold of the one before.
        true
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let channels = inputs.port("signal");
        Box::new(Lagging {
            lags: self.lags.len(),
            past: LookingBack::new(self.lags.clone(), self.max_age, channels),
        })
    }
}

struct Lagging {
    /// How many lags there are.
    lags: usize,
    past: LookingBack,
}

impl Operator for Lagging {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let inputs = tick.port(0).iter().zip(tick.stamps(0));
        for (nth, (&value, &stamp)) in inputs.enumerate() {
            if is_unchanged(value) || !self.past.take(nth, tick.now, value, stamp) {
                continue;
            }
            for (i, (lag, past, stamp)) in self.past.before(nth, tick.now).enumerate() {
                outputs.set_stamped(nth * self.lags + i, past, stamp + lag);
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
