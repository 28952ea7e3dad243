//! The position that would have been measured without a correction.

use athermal_core::channel::{ABSENT, Channel, is_unchanged};
use athermal_core::node::{
    Duty, Feature, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs, Pace,
    PortSummary, Reach, Restored, State, Tick,
};
use athermal_core::quantity::Quantity;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::limit;

/// The measured position minus the correction applied at its instant: what the machine would have done on its own.
///
/// `uncorrected(t) = position(t) − applied(t)`, channel by channel. What was applied is a signal that the machine
/// reports, since it may clip or refuse what it is asked for. Drift, features and learning take this position, so
/// that a model never learns its own correction. Without `applied` the node says that no correction moves what is
/// measured, as of a probe beside the axis: the position stays as it is. Where it is not known what was applied, there
/// is no value: no drift is made of it, so that nothing learns and no vote moves. It is not known either where it is
/// further than `differs` from what was `commanded`. A machine that reports the wrong sign, twice as much or something old would have its
/// own correction learned. The port `reason` says why: 0 known, 1 not reported or too old, 2 not what was commanded.
/// A command acts on the next tick, so it passes a `delay` of one, which closes the loop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Uncorrected {
    /// What is taken as applied before the machine first reports it: nothing known (`absent`), or `zero` for recordings
    /// that were made without a correction.
    #[serde(default)]
    pub until_first: UntilFirst,
    /// How far what was applied may be from what was commanded, such as `"100 nm"`.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub differs: Option<Quantity>,
}

/// The numbers of the port `reason`.
mod reason {
    pub(super) const KNOWN: u8 = 0;
    pub(super) const SILENT: u8 = 1;
    pub(super) const DIFFERS: u8 = 2;
    /// Each by its number.
    pub(super) const WORDS: [&str; 3] = [
        "known",
        "not reported, or too old",
        "not what was commanded",
    ];
}

/// What is taken as applied before anything has been reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum UntilFirst {
    /// It is not known.
    #[default]
    Absent,
    /// No correction.
    Zero,
}

impl Feature for Uncorrected {
    fn facts() -> KindFacts {
        KindFacts::of(Duty::PutBack)
            .reasons(&reason::WORDS)
            .pace(Pace::ByChannel)
    }

    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::fresh("position", "the measured positions"),
                InputPort::held(
                    "applied",
                    "what the machine reports as applied, one per position; none where no correction moves what is measured",
                )
                .or_none(),
                InputPort::held(
                    "commanded",
                    "what the machine was asked for, one per position; with `differs`",
                )
                .or_none(),
            ]
        }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("position", "each position without the correction"),
                PortSummary::new("reason", "why there is none"),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let position = inputs.port("position");
        let mut mistakes = Vec::new();
        for port in ["applied", "commanded"] {
            let of = inputs.port(port);
            if of.is_empty() {
                continue;
            }
            mistakes.extend(limit::same_count(port, of, "position", position));
            for (position, of) in position.iter().zip(of) {
                if of.unit.factor_to(&position.unit).is_none() {
                    let message = format!(
                        "`{}` is in {} and was corrected in {}",
                        position.name, position.unit, of.unit
                    );
                    mistakes.push(Mistake::at(format!("inputs.{port}"), message));
                }
            }
        }
        if let Some(first) = position.first() {
            limit::size_or_none(self.differs.as_ref(), &first.unit, "differs", &mut mistakes);
        }
        if self.differs.is_some() && inputs.port("applied").is_empty() {
            let message = "`differs` says how far `inputs.applied` may be from what was commanded";
            mistakes.push(Mistake::at("differs", message));
        }
        if self.differs.is_some() == inputs.port("commanded").is_empty() {
            let message = "`differs` and `inputs.commanded` go together: how far from what";
            mistakes.push(Mistake::at("differs", message));
        }
        if mistakes.is_empty() {
            Ok(vec![
                OutputPort {
                    name: "position",
                    channels: position.to_vec(),
                },
                OutputPort {
                    name: "reason",
                    channels: position.iter().map(limit::numbered).collect(),
                },
            ])
        } else {
            Err(mistakes)
        }
    }

    fn reach(&self, port: &str) -> Reach {
        match port {
            // What was commanded says whether there is a value, and not which.
            "position" => Reach::First(2),
            _ => Reach::Own,
        }
    }

    fn build(&self, inputs: &Inputs, wanted: &[bool]) -> Box<dyn Operator> {
        let positions = inputs.port("position");
        let factors = |port| -> Vec<f64> {
            let pairs = positions.iter().zip(inputs.port(port));
            pairs
                .map(|(position, of)| of.unit.factor_to(&position.unit).unwrap_or(ABSENT))
                .collect()
        };
        let within = |of: &Channel| {
            Some(limit::size(self.differs.as_ref()?, &of.unit, "differs").unwrap_or(ABSENT))
        };
        Box::new(Uncorrecting {
            moved: !inputs.port("applied").is_empty(),
            seen: vec![self.until_first == UntilFirst::Absent; positions.len()],
            from_start: self.until_first == UntilFirst::Absent,
            factors: factors("applied"),
            commanded: factors("commanded"),
            within: positions.iter().filter_map(within).collect(),
            says_why: wanted.get(1).is_some_and(|wanted| *wanted),
        })
    }

    fn every_tick(&self) -> bool {
        // What was applied may be reported between two positions, and that it has been is part of the answer.
        true
    }
}

struct Uncorrecting {
    /// Whether corrections move what is measured.
    moved: bool,
    factors: Vec<f64>,
    /// Of what was commanded, and how far from it what was applied may be; none where that is not looked at.
    commanded: Vec<f64>,
    within: Vec<f64>,
    /// Whether an absent correction is unknown rather than none.
    seen: Vec<bool>,
    from_start: bool,
    says_why: bool,
}

impl Operator for Uncorrecting {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let (position, applied) = (tick.port(0), tick.port(1));
        let count = self.seen.len();
        for channel in 0..count {
            self.seen[channel] |= self.moved && !applied[channel].is_nan();
            if is_unchanged(position[channel]) {
                continue;
            }
            let applied = if self.moved && self.seen[channel] {
                applied[channel] * self.factors[channel]
            } else {
                0.0
            };
            let mut reason = if applied.is_nan() {
                reason::SILENT
            } else {
                reason::KNOWN
            };
            if let Some(within) = self.within.get(channel)
                && (applied - tick.port(2)[channel] * self.commanded[channel]).abs() > *within
            {
                reason = reason::DIFFERS;
            }
            let value = if reason == reason::KNOWN {
                position[channel] - applied
            } else {
                ABSENT
            };
            let value = if value.is_finite() { value } else { ABSENT };
            outputs.set_stamped(channel, value, tick.stamps(0)[channel]);
            if self.says_why {
                outputs.set_stamped(count + channel, f64::from(reason), tick.stamps(0)[channel]);
            }
        }
    }

    fn segment(&mut self) {
        self.seen.fill(self.from_start);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(Reported {
            seen: self.seen.clone(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.accept(|state: Reported| {
            let fits = state.seen.len() == self.seen.len();
            fits.then(|| self.seen = state.seen)
                .ok_or("the number of channels differs")
        })
    }
}

/// The state: for which channels a correction has been reported.
#[derive(Debug, Serialize, Deserialize)]
struct Reported {
    seen: Vec<bool>,
}

athermal_core::state!(Reported, "uncorrected/1");

athermal_core::register!(Uncorrected, Feature, "uncorrected");
