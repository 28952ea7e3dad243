//! What is put out when nothing can be trusted.

use athermal_core::channel::Channel;
use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, PortSummary, Reach,
    Restored, State, Tick,
};
use athermal_core::quantity::Quantity;
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::limit;

/// Passes a signal on while it can be trusted, and otherwise puts out a stated safe value.
///
/// `y = x` while it is trusted, else `y(t) = y(t') ± max_slew · (t − t')` on its way to the safe value. A signal is not
/// trusted where it is absent or too old, or where the input `distrust` is other than 0 (such as the reasons of a
/// `health` node). For up to `after` ticks the last value is kept. Then the output goes to `when_lost`, by at most
/// `max_slew`: `hold`, `zero` or a stated value. It comes back by the same when trust returns. It always has a value;
/// before the first trusted one it is the value of `when_lost`, or 0. The port `why` says: 0 trusted, 1 absent, 2
/// distrusted, 3 and 4 the same and past `after`, 5 on the way back. When the graph is replaced, it goes on from what
/// it put out. Runs at every tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SafeState {
    /// What is safe.
    pub when_lost: WhenLost,
    /// The stated value, such as `"0 nm"`, with `when_lost = "value"`.
    #[serde(default)]
    pub value: Option<Quantity>,
    /// The number of ticks without trust that are bridged with the last value.
    #[serde(default)]
    pub after: u32,
    /// The fastest way there and back, such as `"50 nm/s"`.
    #[schemars(extend("minimum" = 0))]
    pub max_slew: Quantity,
    /// The longest time between two ticks that counts for that way. After a longer pause the output goes on from where it is and
    /// does not make up for the pause at once.
    #[serde(default = "limit::minute")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_gap: Duration,
}

/// A safe output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WhenLost {
    /// The last trusted value.
    Hold,
    /// Zero.
    Zero,
    /// A stated value.
    Value,
}

/// The numbers of the port `why`.
mod why {
    pub(super) const TRUSTED: f64 = 0.0;
    pub(super) const ABSENT: f64 = 1.0;
    pub(super) const DISTRUSTED: f64 = 2.0;
    /// Added to the two above once the bridged ticks are over.
    pub(super) const SAFE: f64 = 2.0;
    pub(super) const RETURNING: f64 = 5.0;
}

impl SafeState {
    /// The value when lost, if there is one, and the fastest way per second.
    fn limits(&self, channel: &Channel) -> Result<(Option<f64>, f64), Vec<Mistake>> {
        let mut mistakes = Vec::new();
        let when_lost = match (self.when_lost, &self.value) {
            (WhenLost::Hold, None) => None,
            (WhenLost::Zero, None) => Some(0.0),
            (WhenLost::Value, Some(value)) => {
                let found = value.in_unit(&channel.unit);
                if found.is_none() {
                    let message = format!(
                        "`value` is in {}, and `{}` in {}",
                        value.unit, channel.name, channel.unit
                    );
                    mistakes.push(Mistake::at("value", message));
                }
                found
            }
            (WhenLost::Value, None) => {
                let mistake =
                    Mistake::at("when_lost", "`when_lost = \"value\"` needs to know which");
                let help = format!("add `value = \"0 {}\"`", channel.unit);
                mistakes.push(mistake.help(help));
                None
            }
            (WhenLost::Hold | WhenLost::Zero, Some(_)) => {
                let mistake = Mistake::at(
                    "value",
                    "`value` has a meaning only with `when_lost = \"value\"`",
                );
                mistakes.push(mistake);
                None
            }
        };
        match limit::size(
            &self.max_slew,
            &limit::per_second(&channel.unit),
            "max_slew",
        ) {
            Ok(slew) if mistakes.is_empty() => Ok((when_lost, slew)),
            Ok(_) => Err(mistakes),
            Err(mistake) => {
                mistakes.push(mistake);
                Err(mistakes)
            }
        }
    }
}

impl Feature for SafeState {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("signal", "what is put out while it can be trusted"),
                InputPort::held(
                    "distrust",
                    "other than 0 where the signal must not be trusted: one, or one per channel",
                )
                .or_none(),
            ]
        }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("safe", "the signal, or what stands for it"),
                PortSummary::new(
                    "why",
                    "0 trusted, 1 absent, 2 distrusted, 3 and 4 the same and past `after`, 5 on the way back",
                ),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let signal = inputs.port("signal");
        let distrust = inputs.port("distrust");
        let mut mistakes = Vec::new();
        if !matches!(distrust.len(), 0 | 1) {
            mistakes.extend(limit::same_count("distrust", distrust, "signal", signal));
        }
        let of_limits = signal.iter().find_map(|channel| self.limits(channel).err());
        mistakes.extend(of_limits.into_iter().flatten());
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        Ok(vec![
            OutputPort {
                name: "safe",
                channels: signal.to_vec(),
            },
            OutputPort {
                name: "why",
                channels: signal.iter().map(limit::numbered).collect(),
            },
        ])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let signal = inputs.port("signal");
        let limits: Vec<_> = signal
            .iter()
            .map(|channel| self.limits(channel).unwrap_or((None, 0.0)))
            .collect();
        let channels = limits
            .iter()
            .map(|&(when_lost, _)| Output::new(when_lost))
            .collect();
        Box::new(Guarding {
            after: self.after,
            max_gap: self.max_gap,
            limits,
            known: Known {
                last: None,
                units: signal.iter().map(|channel| channel.unit.clone()).collect(),
                channels,
            },
        })
    }

    fn every_tick(&self) -> bool {
        true
    }
}

struct Guarding {
    after: u32,
    max_gap: Duration,
    limits: Vec<(Option<f64>, f64)>,
    known: Known,
}

/// The state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Known {
    last: Option<Instant>,
    /// The unit of each channel; none in a state that was written before they were kept.
    #[serde(default)]
    units: Vec<Unit>,
    channels: Vec<Output>,
}

/// What is known of one channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Output {
    given: f64,
    /// Ticks without trust so far.
    doubtful: u32,
    /// Whether the output has left the signal and is not back yet.
    away: bool,
    /// Whether there has been a trusted value.
    begun: bool,
}

impl Output {
    fn new(when_lost: Option<f64>) -> Self {
        Self {
            given: when_lost.unwrap_or(0.0),
            doubtful: 0,
            away: false,
            begun: false,
        }
    }

    /// Moves towards a goal, and says whether it has been reached.
    fn approach(&mut self, goal: f64, step: f64) -> bool {
        let missing = goal - self.given;
        if missing.abs() > step {
            self.given += step.copysign(missing);
            false
        } else {
            self.given = goal;
            true
        }
    }
}

impl Operator for Guarding {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let (signal, distrust) = (tick.port(0), tick.port(1));
        let passed = self
            .known
            .last
            .map_or(Duration::ZERO, |last| tick.now - last);
        let dt = passed.min(self.max_gap).secs();
        self.known.last = Some(tick.now);
        let count = signal.len();
        for (i, (output, &(when_lost, slew))) in
            self.known.channels.iter_mut().zip(&self.limits).enumerate()
        {
            let mark = distrust.get(if distrust.len() == 1 { 0 } else { i });
            // A distrust that is not known is a reason for it.
            let distrusted = mark.is_some_and(|&mark| mark != 0.0);
            let why = if signal[i].is_finite() && !distrusted {
                output.doubtful = 0;
                let there = if output.away {
                    output.approach(signal[i], slew * dt)
                } else {
                    output.given = signal[i];
                    true
                };
                output.away = !there;
                output.begun = true;
                if there { why::TRUSTED } else { why::RETURNING }
            } else {
                let cause = if distrusted {
                    why::DISTRUSTED
                } else {
                    why::ABSENT
                };
                output.doubtful = output.doubtful.saturating_add(1);
                if output.doubtful > self.after {
                    // Without a trusted value so far there is nothing to come back from slowly.
                    output.away = output.begun;
                    output.approach(when_lost.unwrap_or(output.given), slew * dt);
                    cause + why::SAFE
                } else {
                    cause
                }
            };
            outputs.set_stamped(i, output.given, tick.now);
            outputs.set_stamped(count + i, why, tick.now);
        }
    }

    fn segment(&mut self) {
        self.known.last = None;
        for (output, &(when_lost, _)) in self.known.channels.iter_mut().zip(&self.limits) {
            *output = Output::new(when_lost);
        }
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.known.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let mut known = match state.known::<Known>() {
            Ok(known) if known.channels.len() == self.known.channels.len() => known,
            Ok(_) => return Restored::cold("the number of channels differs"),
            Err(cold) => return cold,
        };
        for (i, (channel, unit)) in known.channels.iter_mut().zip(&self.known.units).enumerate() {
            let Some(given) = limit::brought(channel.given, known.units.get(i), Some(unit)) else {
                return Restored::cold("the signal is of another quantity");
            };
            channel.given = given;
        }
        known.units.clone_from(&self.known.units);
        self.known = known;
        Restored::Accepted
    }

    fn outlives_changes(&self) -> bool {
        true
    }
}

athermal_core::state!(Known, "safe_state/1");

athermal_core::register!(SafeState, Feature, "safe_state");
