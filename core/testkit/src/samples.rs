//! Decides what the nodes under test measure: signals that wander, with gaps, at irregular instants, the same at every call.

use super::case::{EVERY, Given};
use super::fixture::channel;
use crate::channel::ABSENT;
use crate::node::{FREEZE, Kind, Read};
use crate::prng::Prng;
use crate::recording::Table;
use crate::time::{Duration, Instant};

/// From where on in its wave what freezes learning does so: about a third of the time.
const FROZEN: f64 = 0.65;

/// In how many parts the time between ticks is divided.
const PARTS: i64 = 10_000;

/// How samples come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coming {
    /// With gaps, at irregular instants, with empty ticks between.
    WithGaps,
    /// All of them at every tick, twice as often.
    Always,
}

/// So many ticks of all channels, about so far apart, in the order of the plan's sources.
pub(super) fn samples(
    kind: &Kind,
    given: &[Given],
    ticks: usize,
    every: Duration,
    coming: Coming,
) -> Table {
    // Whole milliseconds where ticks are 10 s apart, as data have them.
    let unit_ns = every.as_ns() / PARTS;
    let slower = every.secs() / EVERY.secs();
    let mut waves = Waves::new(kind, given);
    let mut random = Prng::stream(17, "ticks");
    let mut table = Table::default();
    // Whether what freezes learning is connected changes nothing else.
    let mut of_freeze = Prng::stream(19, "ticks");
    let mut row = vec![ABSENT; waves.channels.len()];
    let mut gap_until = vec![0_usize; row.len()];
    let mut ns = 0_i64;
    for tick in 0..ticks {
        waves.at(ns as f64 / 1e9 / slower, &mut row);
        if coming == Coming::WithGaps {
            let empty = tick % 41 == 40;
            for (i, value) in row.iter_mut().enumerate() {
                let random = match waves.channels[i].what {
                    What::Freeze => &mut of_freeze,
                    _ => &mut random,
                };
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
            Coming::WithGaps => random.between(4_000.0, 16_000.0) as i64 * unit_ns,
            Coming::Always => PARTS / 2 * unit_ns,
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
    /// Now 0, now 1.
    Freeze,
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
                    (FREEZE, _) => What::Freeze,
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
            if wave.what == What::Freeze {
                *value = if wave.at(t) > FROZEN { 1.0 } else { 0.0 };
                continue;
            }
            let noise = 0.01 * self.noise.normal();
            let share = match wave.what {
                What::Own | What::Feature | What::Freeze => wave.at(t) + noise,
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
