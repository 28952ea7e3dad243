//! How fast a recording or a simulation goes.

use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::node::Forms;
use athermal_core::time::Instant;
use athermal_serve::connector::Stop;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

/// How fast time passes.
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema)]
#[schemars(untagged)]
pub enum Speed {
    /// So many times as fast as the clock on the wall.
    Times(f64),
    /// "fastest": as fast as it goes.
    Fastest(Fastest),
}

/// As fast as it goes.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Fastest {
    /// As fast as it goes.
    Fastest,
}

impl Default for Speed {
    fn default() -> Self {
        Self::Times(1.0)
    }
}

impl<'de> Deserialize<'de> for Speed {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let speed = Forms::new("a positive number, such as 10, or \"fastest\"")
            .number(Self::Times)
            .text(Self::Fastest)
            .read(deserializer)?;
        match speed {
            Self::Times(times) if !(times > 0.0 && times.is_finite()) => {
                Err(serde::de::Error::custom(format_args!(
                    "{times} is no speed: a positive number is expected, such as 10, or \"fastest\""
                )))
            }
            speed => Ok(speed),
        }
    }
}

/// Waits for instants.
#[derive(Debug)]
pub(crate) struct Pace {
    speed: Speed,
    began: Option<(Clock, Instant)>,
}

impl Pace {
    pub(crate) fn new(speed: Speed) -> Self {
        Self { speed, began: None }
    }

    /// Waits until an instant has come; false where it is to stop. The first one has come; one that lies before begins anew.
    pub(crate) fn wait(&mut self, at: Instant, stop: &Stop) -> bool {
        let Speed::Times(times) = self.speed else {
            return !stop.is_asked();
        };
        let now = Clock::now();
        let (began, first) = *self.began.get_or_insert((now, at));
        if at < first {
            self.began = Some((now, at));
            return !stop.is_asked();
        }
        let due = (at - first).as_ns() as f64 / times;
        let due = began + Wait::from_nanos(due as u64);
        match due.checked_duration_since(now) {
            Some(left) => stop.wait(left),
            None => !stop.is_asked(),
        }
    }
}
