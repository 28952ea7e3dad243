//! The position that would have been measured without a correction.

use athermal_core::channel::{ABSENT, is_unchanged};
use athermal_core::node::{
    Duty, Feature, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs,
    PortSummary, Reach, Restored, State, Tick,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::limit;

/// The measured position minus the correction applied at its instant: what the machine would have done on its own.
///
/// `uncorrected(t) = position(t) − applied(t)`, channel by channel. What was applied is a signal that the machine reports,
/// since it may clip or refuse what it is asked for. Drift, features and learning take this position, so that a model never
/// learns its own correction. Where it is not known what was applied, there is no value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Uncorrected {
    /// What is taken as applied before the machine first reports it: nothing known (`absent`), or `zero` for recordings
    /// that were made without a correction.
    #[serde(default)]
    pub until_first: UntilFirst,
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
    }

    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::fresh("position", "the measured positions"),
                InputPort::held(
                    "applied",
                    "the corrections that the machine reports as applied, one per position",
                ),
            ]
        }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[PortSummary::new(
                "position",
                "each position without the correction",
            )]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let (position, applied) = (inputs.port("position"), inputs.port("applied"));
        let mut mistakes: Vec<Mistake> =
            limit::same_count("applied", applied, "position", position)
                .into_iter()
                .collect();
        for (position, applied) in position.iter().zip(applied) {
            if applied.unit.factor_to(&position.unit).is_none() {
                let message = format!(
                    "`{}` is in {} and was corrected in {}",
                    position.name, position.unit, applied.unit
                );
                mistakes.push(Mistake::at("inputs.applied", message));
            }
        }
        if mistakes.is_empty() {
            Ok(vec![OutputPort {
                name: "position",
                channels: position.to_vec(),
            }])
        } else {
            Err(mistakes)
        }
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let pairs = inputs.port("position").iter().zip(inputs.port("applied"));
        let factors: Vec<f64> = pairs
            .map(|(position, applied)| applied.unit.factor_to(&position.unit).unwrap_or(ABSENT))
            .collect();
        Box::new(Uncorrecting {
            seen: vec![self.until_first == UntilFirst::Absent; factors.len()],
            from_start: self.until_first == UntilFirst::Absent,
            factors,
        })
    }

    fn every_tick(&self) -> bool {
        // What was applied may be reported between two positions, and that it has been is part of the answer.
        true
    }
}

struct Uncorrecting {
    factors: Vec<f64>,
    /// Whether an absent correction is unknown rather than none.
    seen: Vec<bool>,
    from_start: bool,
}

impl Operator for Uncorrecting {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let (position, applied) = (tick.port(0), tick.port(1));
        for channel in 0..self.factors.len() {
            self.seen[channel] |= !applied[channel].is_nan();
            if is_unchanged(position[channel]) {
                continue;
            }
            let applied = if self.seen[channel] {
                applied[channel] * self.factors[channel]
            } else {
                0.0
            };
            let value = position[channel] - applied;
            let value = if value.is_finite() { value } else { ABSENT };
            outputs.set_stamped(channel, value, tick.stamps(0)[channel]);
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
