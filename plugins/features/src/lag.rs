//! Values as they were some time ago.

use athermal_core::channel::{ABSENT, Channel, is_unchanged};
use athermal_core::engine::History;
use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, Reach, Restored, State,
    Tick,
};
use athermal_core::time::Duration;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
    pub lags: Vec<Duration>,
    /// How old a value may have been at the instant looked back to; by default as old as a held value of the channel may be.
    #[serde(default)]
    pub max_age: Option<Duration>,
}

/// How old a value of the past may be: as stated, or as a held value of the channel.
pub(crate) fn max_age(stated: Option<Duration>, of: &Channel) -> Result<Duration, Mistake> {
    match stated.or_else(|| of.default_max_age()) {
        Some(age) if age > Duration::ZERO => Ok(age),
        Some(age) => {
            let message = format!("`max_age` is {age} and must be longer than nothing");
            Err(Mistake::at("max_age", message))
        }
        None => {
            let message = format!("how old a value of `{}` may be is not known", of.name);
            let help = "add `max_age = \"1min\"` here, or to the signal";
            Err(Mistake::at("max_age", message).help(help))
        }
    }
}

impl Lag {
    fn mistakes(&self, channels: &[Channel]) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        if self.lags.is_empty() {
            let mistake = Mistake::at("lags", "there is no lag");
            mistakes.push(mistake.help("give one or more, such as [\"5min\"]"));
        }
        for (i, lag) in self.lags.iter().enumerate() {
            if self.lags[..i].contains(lag) {
                let message = format!("the lag {lag} stands twice");
                mistakes.push(Mistake::at(format!("lags.{i}"), message));
            }
        }
        let ages = channels
            .iter()
            .map(|channel| max_age(self.max_age, channel));
        mistakes.extend(ages.filter_map(Result::err).next());
        mistakes
    }
}

impl Feature for Lag {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is looked back at")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let from = inputs.port("signal");
        let mistakes = self.mistakes(from);
        if !mistakes.is_empty() {
            return Err(mistakes);
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

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let longest = self.lags.iter().copied().max().unwrap_or_default();
        let channel = |channel: &Channel| Looking {
            history: History::new(longest),
            places: vec![0; self.lags.len()],
            max_age: max_age(self.max_age, channel).unwrap_or_default(),
        };
        Box::new(LookingBack {
            lags: self.lags.clone(),
            channels: inputs.port("signal").iter().map(channel).collect(),
        })
    }
}

struct LookingBack {
    lags: Vec<Duration>,
    channels: Vec<Looking>,
}

/// The past of one channel.
struct Looking {
    history: History,
    /// For each lag, where in the past it was last found.
    places: Vec<u64>,
    max_age: Duration,
}

impl Operator for LookingBack {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let inputs = tick.port(0).iter().zip(tick.stamps(0));
        for (nth, (channel, (&value, &stamp))) in self.channels.iter_mut().zip(inputs).enumerate() {
            if is_unchanged(value) {
                continue;
            }
            let value = if value.is_finite() { value } else { ABSENT };
            channel.history.push(tick.now, value, stamp);
            if value.is_nan() {
                continue;
            }
            for (i, (&lag, place)) in self.lags.iter().zip(&mut channel.places).enumerate() {
                let (past, stamp) = channel.history.at(tick.now - lag, channel.max_age, place);
                outputs.set_stamped(nth * self.lags.len() + i, past, stamp + lag);
            }
        }
    }

    fn segment(&mut self) {
        for channel in &mut self.channels {
            channel.history.clear();
            channel.places.fill(0);
        }
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        let history = |channel: &Looking| channel.history.clone();
        Some(Box::new(Past {
            channels: self.channels.iter().map(history).collect(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        match state.known::<Past>() {
            Ok(state) if state.channels.len() == self.channels.len() => {
                for (channel, past) in self.channels.iter_mut().zip(&state.channels) {
                    channel.history.adopt(past);
                    channel.places.fill(0);
                }
                Restored::Accepted
            }
            Ok(_) => Restored::cold("the number of channels differs"),
            Err(cold) => cold,
        }
    }
}

/// The state of nodes that look back: the past of each channel.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Past {
    pub(crate) channels: Vec<History>,
}

athermal_core::state!(Past, "past/1");
athermal_core::register!(Lag, Feature, "lag");
