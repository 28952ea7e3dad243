//! What each sensor contributes to predictions: how much they move with it, and what they are worth without it.
//!
//! The recording is run again with the sensor at rest at its mean, through the whole graph, so that a vote that turns to other
//! voters is seen to do so. Nothing is fitted anew: a sensor that others could replace after a fit still contributes.

use athermal_core::compile::Plan;
use athermal_core::engine::Engine;
use athermal_run::fit::FitError;
use athermal_run::model::Model;
use athermal_run::recording::{Event, Recording, Samples, Source, SourceError};
use athermal_run::score::{PredictionTrace, Trace, trace};
use serde::Serialize;

use super::observation::{Observation, count_valid};
use super::of_truths;
use super::rest::{Rest, SilentNode, name};

/// A node that has a value at less than this share of its rows when a sensor rests has fallen silent.
const STILL_THERE: f64 = 0.9;

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

/// What every sensor contributes to every prediction, and the sensors of which it cannot be found. Channels that truths are made of
/// are no sensors.
///
/// # Errors
/// When the recording cannot be read, or the fit does not belong to the graph.
pub fn contributions(
    model: &Model,
    recording: &dyn Recording,
    observation: &Observation,
) -> Result<(Vec<Contribution>, Vec<SilentNode>), FitError> {
    let plan = &*model.plan;
    let of_truth = of_truths(plan);
    let (mut contributions, mut silent_nodes) = (Vec::new(), Vec::new());
    for source in (0..plan.sources.len())
        .filter(|&source| !of_truth[source] && !plan.sources[source].is_instant)
    {
        if observation.sources[source].samples == 0 {
            continue;
        }
        let (rested, silent) = rested(model, recording, observation, source)?;
        if let Some(slot) = silent {
            silent_nodes.push(SilentNode {
                sensor: Some(plan.sources[source].name.clone()),
                estimator: None,
                silent: name(plan, slot),
            });
            continue;
        }
        let truths = observation.trace.truths.iter().zip(&rested.truths);
        for (truth, rested) in truths {
            let predictions = truth.predictions.iter().zip(&rested.predictions);
            contributions.extend(predictions.filter_map(|(with, without)| {
                contribution(plan, source, &truth.values, with, without)
            }));
        }
    }
    Ok((contributions, silent_nodes))
}

/// A pass with a sensor at rest, as still as no node falls silent by it; or else the first slot that does.
fn rested(
    model: &Model,
    recording: &dyn Recording,
    observation: &Observation,
    source: usize,
) -> Result<(Trace, Option<usize>), FitError> {
    let statistics = &observation.sources[source];
    let mut first = None;
    for rest in Rest::ALL {
        let resting = AtRest {
            recording,
            source,
            mean: statistics.mean,
            to_either_side: rest.to_either_side(statistics),
        };
        let mut valid = vec![0; observation.valid.len()];
        let mut look = |engine: &Engine, event: Event| {
            if let Event::Row(_) = event {
                count_valid(engine, &mut valid);
            }
        };
        let trace = trace(&model.plan, &model.fitted, &resting, &mut look)?;
        let pairs = valid.iter().zip(&observation.valid);
        let mut fewer = pairs.map(|(&now, &then)| (now as f64) < STILL_THERE * then as f64);
        let silent = fewer.position(|fewer| fewer);
        if silent.is_none() {
            return Ok((trace, None));
        }
        first.get_or_insert((trace, silent));
    }
    Ok(first.unwrap_or_default())
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

/// A recording in which a channel stays at its mean, or alternates about it, at the instants at which it was measured.
struct AtRest<'a> {
    recording: &'a dyn Recording,
    source: usize,
    mean: f64,
    to_either_side: f64,
}

struct RowsAtRest<'a> {
    rows: Box<dyn Source + 'a>,
    source: usize,
    mean: f64,
    /// By how much the next value lies from the mean.
    next: f64,
}

impl Recording for AtRest<'_> {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        Ok(Box::new(RowsAtRest {
            rows: self.recording.open(plan)?,
            source: self.source,
            mean: self.mean,
            next: self.to_either_side,
        }))
    }
}

impl Source for RowsAtRest<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let event = self.rows.next(samples)?;
        let values = &mut samples.values;
        if matches!(event, Some(Event::Row(_))) && !values[self.source].is_nan() {
            values[self.source] = self.mean + self.next;
            self.next = -self.next;
        }
        Ok(event)
    }
}
