//! Decides what each sensor contributes to predictions: how much they move with it, and what they are worth without it.
//!
//! The recording is run again with the sensor at rest at its mean, through the whole graph, so that a vote that turns to other
//! voters is seen to do so. Nothing is fitted anew: a sensor that others could replace after a fit still contributes.

use athermal_core::compile::Plan;
use athermal_core::fit::FitError;
use athermal_core::model::Model;
use athermal_core::recording::{Event, Recording, RecordingError, Rows};
use athermal_core::score::{PredictionTrace, trace};
use serde::Serialize;

use super::observation::Observation;
use super::of_truths;

/// What a sensor contributes to a prediction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contribution {
    /// The measured channel: `temperature.chuck`.
    pub sensor: String,
    /// The prediction: `vote.Z1`.
    pub prediction: String,
    /// The unit of the truth and of all figures.
    pub unit: String,
    /// The standard deviation of what the prediction loses when the sensor rests at its mean.
    pub moves: f64,
    /// Root mean square error of the prediction.
    pub rmse: f64,
    /// The same with the sensor at rest, on the same instants.
    pub rmse_at_rest: f64,
}

/// What every sensor contributes to every prediction; measured channels of which truths are made are not taken for sensors.
///
/// # Errors
/// When the recording cannot be read, or the fit does not belong to the graph.
pub fn contributions(
    model: &Model,
    recording: &dyn Recording,
    observation: &Observation,
) -> Result<Vec<Contribution>, FitError> {
    let plan = &*model.plan;
    let of_truth = of_truths(plan);
    let mut contributions = Vec::new();
    for source in (0..plan.sources.len()).filter(|&source| !of_truth[source]) {
        if observation.sources[source].samples == 0 {
            continue;
        }
        let resting = AtRest {
            recording,
            source,
            mean: observation.sources[source].mean,
        };
        let rested = trace(&model.plan, &model.fitted, &resting, &mut |_, _| {})?;
        let truths = observation.trace.truths.iter().zip(&rested.truths);
        for (truth, rested) in truths {
            let predictions = truth.predictions.iter().zip(&rested.predictions);
            contributions.extend(predictions.filter_map(|(with, without)| {
                contribution(plan, source, &truth.values, with, without)
            }));
        }
    }
    Ok(contributions)
}

/// None where the two have no instant in common, or the sensor changes nothing.
fn contribution(
    plan: &Plan,
    source: usize,
    truth: &[f64],
    with: &PredictionTrace,
    without: &PredictionTrace,
) -> Option<Contribution> {
    let both = truth.iter().zip(&with.values).zip(&without.values);
    let both: Vec<(f64, f64, f64)> = both
        .map(|((&y, &with), &without)| (y, with, without))
        .filter(|(_, with, without)| !(with + without).is_nan())
        .collect();
    let n = both.len() as f64;
    let mean = both.iter().map(|(_, a, b)| a - b).sum::<f64>() / n;
    let spread = both.iter().map(|(_, a, b)| (a - b - mean).powi(2));
    let moves = (spread.sum::<f64>() / n).sqrt();
    let rms = |errors: f64| (errors / n).sqrt();
    let slot = &plan.channels[with.slot];
    (moves > 0.0).then(|| Contribution {
        sensor: plan.sources[source].name.clone(),
        prediction: slot.name.clone(),
        unit: slot.channel.unit.difference().to_string(),
        moves,
        rmse: rms(both.iter().map(|(y, a, _)| (y - a).powi(2)).sum()),
        rmse_at_rest: rms(both.iter().map(|(y, _, b)| (y - b).powi(2)).sum()),
    })
}

/// A recording in which a channel stays at one value, at the instants at which it was measured.
struct AtRest<'a> {
    recording: &'a dyn Recording,
    source: usize,
    mean: f64,
}

struct RowsAtRest<'a> {
    rows: Box<dyn Rows + 'a>,
    source: usize,
    mean: f64,
}

impl Recording for AtRest<'_> {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Rows + '_>, RecordingError> {
        Ok(Box::new(RowsAtRest {
            rows: self.recording.open(plan)?,
            source: self.source,
            mean: self.mean,
        }))
    }
}

impl Rows for RowsAtRest<'_> {
    fn next(&mut self, values: &mut [f64]) -> Result<Option<Event>, RecordingError> {
        let event = self.rows.next(values)?;
        if matches!(event, Some(Event::Row(_))) && !values[self.source].is_nan() {
            values[self.source] = self.mean;
        }
        Ok(event)
    }
}
