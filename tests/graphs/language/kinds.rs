//! Combiners that are made to look where they must not, known to the graphs of these tests only. Decides what a cheat would
//! do with a truth that it was given too early.

use athermal::core::node::{Combine, Combiner, InputPort, Votes};
use athermal::core::time::Instant;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const PORTS: &[InputPort] = &[
    InputPort::held("voters", "predictions of the same truth"),
    InputPort::truth("what the voters predict"),
];

/// Gives as its prediction the arrival, in seconds, of the newest truth that it has been told; −1 before the first.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct NewestArrival {}

impl Combiner for NewestArrival {
    fn inputs() -> &'static [InputPort] {
        PORTS
    }

    fn build(&self, _voters: usize) -> Box<dyn Combine> {
        Box::new(Newest(-1.0))
    }
}

struct Newest(f64);

impl Combine for Newest {
    fn combine(&self, _votes: Votes<'_>) -> f64 {
        self.0
    }

    fn observe(&mut self, _votes: Votes<'_>, _truth: f64, arrived: Instant) {
        self.0 = arrived.as_ns() as f64 / 1e9;
    }
}

athermal::core::register!(NewestArrival, Combiner, "test_newest_arrival");

/// Adds to its first voter a share of that voter's last known residual: worth something only where truths overlap.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct LastResidual {
    /// The share.
    share: f64,
}

impl Combiner for LastResidual {
    fn inputs() -> &'static [InputPort] {
        PORTS
    }

    fn build(&self, _voters: usize) -> Box<dyn Combine> {
        Box::new(Residual {
            share: self.share,
            last: 0.0,
        })
    }
}

struct Residual {
    share: f64,
    last: f64,
}

impl Combine for Residual {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        votes.0[0] + self.share * self.last
    }

    fn observe(&mut self, votes: Votes<'_>, truth: f64, _arrived: Instant) {
        if !votes.0[0].is_nan() {
            self.last = truth - votes.0[0];
        }
    }
}

athermal::core::register!(LastResidual, Combiner, "test_last_residual");
