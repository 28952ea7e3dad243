//! The past of each channel of a node that looks back. Decides how old a value of the past may be, what is kept of it and how
//! it is handed over; not how far is looked back, nor what is made of what is found.

use athermal_core::channel::{ABSENT, Channel};
use athermal_core::engine::History;
use athermal_core::node::{Mistake, Restored, State};
use athermal_core::time::{Duration, Instant};
use serde::{Deserialize, Serialize};

/// How old a value of the past may be: as stated, or as a held value of the channel.
pub(crate) fn max_age(stated: Option<Duration>, of: &Channel) -> Result<Duration, Mistake> {
    let age = stated.or_else(|| of.default_max_age());
    age.ok_or_else(|| {
        let message = format!("how old a value of `{}` may be is not known", of.name);
        let help = "add `max_age = \"1min\"` here, or to the signal that has none";
        Mistake::at("max_age", message).help(help)
    })
}

/// What is wrong with how old values may be; reported once, however many channels it is true of.
pub(crate) fn max_age_mistake(stated: Option<Duration>, channels: &[Channel]) -> Option<Mistake> {
    channels
        .iter()
        .find_map(|channel| max_age(stated, channel).err())
}

/// Channels that are looked back at, all as far.
pub(crate) struct LookingBack {
    /// How far, once or several times.
    back: Vec<Duration>,
    channels: Vec<Looking>,
}

/// The past of one channel.
struct Looking {
    history: History,
    /// For each distance, where in the past it was last found.
    places: Vec<u64>,
    max_age: Duration,
}

impl LookingBack {
    pub(crate) fn new(back: Vec<Duration>, stated: Option<Duration>, channels: &[Channel]) -> Self {
        let longest = back.iter().copied().max().unwrap_or_default();
        let channel = |channel: &Channel| Looking {
            history: History::new(longest),
            places: vec![0; back.len()],
            max_age: max_age(stated, channel).unwrap_or_default(),
        };
        Self {
            channels: channels.iter().map(channel).collect(),
            back,
        }
    }

    /// Takes what a channel was given at this tick; whether that is a value.
    pub(crate) fn take(
        &mut self,
        channel: usize,
        now: Instant,
        value: f64,
        stamp: Instant,
    ) -> bool {
        let value = if value.is_finite() { value } else { ABSENT };
        self.channels[channel].history.push(now, value, stamp);
        !value.is_nan()
    }

    /// What a channel held before: for each distance that, the value and its stamp.
    pub(crate) fn before(
        &mut self,
        channel: usize,
        now: Instant,
    ) -> impl Iterator<Item = (Duration, f64, Instant)> {
        let channel = &mut self.channels[channel];
        let (history, max_age) = (&channel.history, channel.max_age);
        let places = self.back.iter().zip(&mut channel.places);
        places.map(move |(&back, place)| {
            let (value, stamp) = history.at(now - back, max_age, place);
            (back, value, stamp)
        })
    }

    pub(crate) fn clear(&mut self) {
        for channel in &mut self.channels {
            channel.history.clear();
            channel.places.fill(0);
        }
    }

    pub(crate) fn snapshot(&self) -> Box<dyn State> {
        let history = |channel: &Looking| channel.history.clone();
        Box::new(Past {
            channels: self.channels.iter().map(history).collect(),
        })
    }

    pub(crate) fn restore(&mut self, state: Box<dyn State>) -> Restored {
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
struct Past {
    channels: Vec<History>,
}

athermal_core::state!(Past, "past/1");
