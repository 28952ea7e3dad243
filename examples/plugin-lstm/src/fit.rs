//! Decides what a fit gives: a network with the scales of what it reads and answers, and what it makes of a row.

use athermal_core::node::Mistake;
use serde::{Deserialize, Serialize};

use crate::network::{MOST_UNITS, Memory, Network};

/// A network with the scales of what it reads and answers, as a model file holds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Fit {
    /// The regressors that make up a sequence, the oldest step first.
    pub(crate) uses: Vec<String>,
    /// Mean and deviation of each channel.
    pub(crate) inputs: Vec<Scale>,
    /// Mean and deviation of the truth.
    pub(crate) truth: Scale,
    pub(crate) network: Network,
}

/// A mean, and a standard deviation that is 1 where there is none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Scale {
    mean: f64,
    pub(crate) deviation: f64,
}

impl Scale {
    /// Of some values.
    pub(crate) fn of(values: impl Iterator<Item = f64> + Clone) -> Self {
        let count = values.clone().count().max(1) as f64;
        let mean = values.clone().sum::<f64>() / count;
        let variance = values.map(|value| (value - mean).powi(2)).sum::<f64>() / count;
        let deviation = variance.sqrt();
        // What wanders no more than its own rounding does not wander.
        let wanders = deviation > 1e-12 * mean.abs();
        Self {
            mean,
            deviation: if wanders { deviation } else { 1.0 },
        }
    }

    /// The value on this scale.
    pub(crate) fn scaled(self, value: f64) -> f64 {
        (value - self.mean) / self.deviation
    }
}

/// The most channels of a step.
pub(crate) const MOST_CHANNELS: usize = 256;

impl Fit {
    /// What of it does not fit together: a model file may have been written by hand.
    pub(crate) fn mistakes(&self) -> Vec<Mistake> {
        let (channels, steps) = (self.inputs.len(), self.uses.len());
        let mut mistakes = self.network.mistakes(channels);
        let mut check = |at: &str, found: usize, fits: bool, allowed: &str| {
            if !fits {
                let message = format!("`{at}` has {found} values and must have {allowed}");
                mistakes.push(Mistake::at(at, message));
            }
        };
        let most = format!("1 to {MOST_CHANNELS}");
        check(
            "inputs",
            channels,
            (1..=MOST_CHANNELS).contains(&channels),
            &most,
        );
        let whole = steps > 0 && steps.is_multiple_of(channels.max(1));
        check(
            "uses",
            steps,
            whole,
            "as many for each step of the sequence",
        );
        let scales = self.inputs.iter().map(|scale| ("inputs", scale));
        for (at, scale) in scales.chain([("truth", &self.truth)]) {
            let Scale { mean, deviation } = *scale;
            if !mean.is_finite() {
                let message = format!("a `mean` is {mean} and must be finite");
                mistakes.push(Mistake::at(at, message));
            }
            // So that NaN fails.
            if !(deviation > 0.0 && deviation.is_finite()) {
                let message =
                    format!("a `deviation` is {deviation} and must be above 0 and finite");
                mistakes.push(Mistake::at(at, message));
            }
        }
        mistakes
    }

    fn remember(&self, row: &[f64]) -> Memory {
        let channels = self.inputs.len();
        let mut memory = Memory::empty();
        let mut scaled = [0.0; MOST_CHANNELS];
        for step in row.chunks_exact(channels) {
            for ((scaled, value), scale) in scaled.iter_mut().zip(step).zip(&self.inputs) {
                *scaled = scale.scaled(*value);
            }
            self.network.step(&scaled[..channels], &mut memory);
        }
        memory
    }

    /// The answer of the network, in the unit of the truth.
    pub(crate) fn predict(&self, row: &[f64]) -> f64 {
        let shown = self.network.read_out(&self.remember(row));
        self.truth.mean + self.truth.deviation * shown
    }

    /// What each unit shows at the end of a row.
    pub(crate) fn encode(&self, row: &[f64], code: &mut [f64; MOST_UNITS]) {
        let units = self.network.units();
        code[..units].copy_from_slice(self.remember(row).hidden(units));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_by_which_nothing_can_be_divided_are_mistakes() {
        let fit = |inputs: Scale, truth: Scale| Fit {
            uses: vec!["a lag 0s".to_owned()],
            inputs: vec![inputs],
            truth,
            network: Network::random(1, 2, 1),
        };
        let scale = |mean, deviation| Scale { mean, deviation };
        let fine = scale(3.0, 0.5);
        assert_eq!(fit(fine, fine).mistakes(), []);
        for wrong in [
            scale(0.0, 0.0),
            scale(0.0, -1.0),
            scale(0.0, f64::NAN),
            scale(f64::INFINITY, 1.0),
        ] {
            for (fit, at) in [(fit(wrong, fine), "inputs"), (fit(fine, wrong), "truth")] {
                let mistakes = fit.mistakes();
                assert!(mistakes.len() == 1 && mistakes[0].at == at, "{mistakes:?}");
            }
        }
    }
}
