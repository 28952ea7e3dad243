//! Values that change only by what counts.

use athermal_core::channel::{ABSENT, Channel, is_unchanged};
use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, PortSummary, Reach,
    Restored, State, Tick,
};
use athermal_core::quantity::Quantity;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rounding::rounding;

/// A filter that takes changes below a minimum difference for noise: each channel keeps its last value until a sample differs
/// from it by at least that much.
///
/// `y ← x` where `|x − y| ≥ difference`, else `y` stays: the rule of sampling on delta (Miskowicz 2006). The value is that of the
/// sample to within `difference`, however long it has stayed, and carries the sample's stamp. Tu and Peng (2020) put a filter of
/// this name before time-series models of thermal errors; their own text has not been compared. A minimum of three standard
/// deviations of the noise lets one change in several hundred through by mistake. A slope of such a value is a stair's: for slopes,
/// a longer window is the better filter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MinimumDifference {
    /// The least change that is passed on, above 0: `"5 mK"`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub difference: Quantity,
}

impl MinimumDifference {
    /// The least change in the unit of a channel.
    fn least(&self, of: &Channel) -> Result<f64, Mistake> {
        let unit = of.unit.difference();
        self.difference.as_difference(&unit).ok_or_else(|| {
            let message = format!(
                "`difference` is in {}, and `{}` differs in {unit}",
                self.difference.unit, of.name
            );
            Mistake::at("difference", message).help(format!("give it in {unit}"))
        })
    }
}

impl Feature for MinimumDifference {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what has noise")] }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[PortSummary::new(
                "signal",
                "each channel without changes below the minimum",
            )]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = inputs.port("signal");
        let mistake = channels
            .iter()
            .find_map(|channel| self.least(channel).err());
        match mistake {
            Some(mistake) => Err(vec![mistake]),
            None => Ok(vec![OutputPort {
                name: "signal",
                channels: channels.to_vec(),
            }]),
        }
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn every_tick(&self) -> bool {
        // A run of the producer that gave nothing is no new value, and still ends the hold of the one before.
        true
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let channels = inputs.port("signal");
        let least = |channel| self.least(channel).unwrap_or(0.0);
        Box::new(Keeping {
            least: channels.iter().map(least).collect(),
            kept: vec![None; channels.len()],
        })
    }
}

struct Keeping {
    least: Vec<f64>,
    kept: Vec<Option<f64>>,
}

impl Operator for Keeping {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let samples = tick.port(0).iter().zip(tick.stamps(0));
        for (nth, (&value, &stamp)) in samples.enumerate() {
            if is_unchanged(value) {
                continue;
            }
            if value.is_nan() {
                outputs.set_stamped(nth, ABSENT, stamp);
                continue;
            }
            let kept = match self.kept[nth] {
                Some(kept) if (value - kept).abs() < self.least[nth] - rounding(value, kept) => {
                    kept
                }
                _ => value,
            };
            self.kept[nth] = Some(kept);
            outputs.set_stamped(nth, kept, stamp);
        }
    }

    fn segment(&mut self) {
        self.kept.fill(None);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(Kept {
            kept: self.kept.clone(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.accept(|state: Kept| {
            let fits = state.kept.len() == self.kept.len();
            fits.then(|| self.kept = state.kept)
                .ok_or("the channels differ")
        })
    }
}

/// The values that were passed on last.
#[derive(Debug, Serialize, Deserialize)]
struct Kept {
    kept: Vec<Option<f64>>,
}

athermal_core::state!(Kept, "minimum_difference/1");
athermal_core::register!(MinimumDifference, Feature, "minimum_difference");
