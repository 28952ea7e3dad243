//! Decides what the nodes under test measure: signals that wander, with gaps, at irregular instants, the same at every call.

use super::case::Given;
use super::fixture::channel;
use crate::channel::ABSENT;
use crate::node::{Kind, Read};
use crate::prng::Prng;
use crate::recording::Table;
use crate::time::Instant;

/// How samples come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coming {
    /// With gaps, at irregular instants, with empty ticks between.
    WithGaps,
    /// All of them at every tick, twice as often.
    Always,
}

/// So many ticks of all channels, in the order of the plan's sources.
pub(super) fn samples(kind: &Kind, given: &[Given], ticks: usize, coming: Coming) -> Table {
    let mut waves = Waves::new(kind, given);
    let mut random = Prng::stream(17, "ticks");
    let mut table = Table::default();
    let mut row = vec![ABSENT; waves.channels.len()];
    let mut gap_until = vec![0_usize; row.len()];
    let mut ns = 0_i64;
    for tick in 0..ticks {
        waves.at(ns as f64 / 1e9, &mut row);
        if coming == Coming::WithGaps {
            let empty = tick % 41 == 40;
            for (i, value) in row.iter_mut().enumerate() {
                if random.uniform() < 0.01 {
                    gap_until[i] = tick + 3 + (random.uniform() * 20.0) as usize;
                }
                if random.uniform() < 0.15 || tick < gap_until[i] || empty {
                    *value = ABSENT;
                }
            }
        }
        table.push(Instant::from_ns(ns), &row);
        ns += match coming {
            // Whole milliseconds, as data have them.
            Coming::WithGaps => random.between(4_000.0, 16_000.0) as i64 * 1_000_000,
            Coming::Always => 5_000_000_000,
        };
    }
    table
}

/// The channels as functions of time.
struct Waves {
    channels: Vec<Wave>,
    noise: Prng,
}

struct Wave {
    what: What,
    range: (f64, f64),
    slow: (f64, f64),
    fast: (f64, f64),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum What {
    /// Goes its own way.
    Own,
    /// What an estimator predicts from.
    Feature,
    Truth,
    /// Follows the truth, the less well the higher its number.
    Voter(usize),
}

impl Waves {
    fn new(kind: &Kind, given: &[Given]) -> Self {
        let ports = (kind.inputs)();
        let mut channels = Vec::new();
        for input in given {
            let port = ports.iter().find(|port| port.name == input.port);
            for number in 0..input.channels {
                let what = match (input.port.as_str(), port.map(|port| port.read)) {
                    (_, Some(Read::Truth)) => What::Truth,
                    ("features", _) => What::Feature,
                    ("voters", _) => What::Voter(number),
                    _ => What::Own,
                };
                let mut random = Prng::stream(23, &format!("{}.{}", input.port, channel(number)));
                channels.push(Wave {
                    what,
                    range: input.range(),
                    slow: (random.between(900.0, 3000.0), random.between(0.0, 6.0)),
                    fast: (random.between(90.0, 400.0), random.between(0.0, 6.0)),
                });
            }
        }
        Self {
            channels,
            noise: Prng::stream(29, "noise"),
        }
    }

    fn at(&mut self, t: f64, row: &mut [f64]) {
        let features = self
            .channels
            .iter()
            .filter(|wave| wave.what == What::Feature);
        let weighted = features
            .enumerate()
            .map(|(i, wave)| (wave.at(t) - 0.5) / (i + 1) as f64);
        let of_features: f64 = weighted.sum();
        let truth = self.channels.iter().find(|wave| wave.what == What::Truth);
        let truth = truth.map_or(0.5, |wave| 0.4 * wave.at(t) + 0.3 + 0.4 * of_features);
        for (value, wave) in row.iter_mut().zip(&self.channels) {
            let noise = 0.01 * self.noise.normal();
            let share = match wave.what {
                What::Own | What::Feature => wave.at(t) + noise,
                What::Truth => truth + noise,
                What::Voter(number) => truth + noise * (3 + 4 * number) as f64,
            };
            *value = wave.range.0 + share * (wave.range.1 - wave.range.0);
        }
    }
}

impl Wave {
    /// Where the channel stands between its lowest and highest value, 0 to 1.
    fn at(&self, t: f64) -> f64 {
        let wave =
            |(period, phase): (f64, f64)| libm::sin(std::f64::consts::TAU * t / period + phase);
        0.5 + 0.35 * wave(self.slow) + 0.1 * wave(self.fast)
    }
}
