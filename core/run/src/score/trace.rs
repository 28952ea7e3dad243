//! Truths and predictions one by one, for whoever works out more than a score.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Lack, Mode, NoModel, ScoreOptions, Watch, evidence};
use crate::compile::Plan;
use crate::engine::{Engine, Fitted, SampleRange};
use crate::fit::FitError;
use crate::recording::{Event, Recording, pass};
use crate::time::{Duration, Instant};

/// Every truth of a recording, and what was predicted of it.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    /// The truths that something predicts, in the order of their slots.
    pub truths: Vec<TruthTrace>,
    /// Ticks stepped.
    pub ticks: u64,
    /// Ticks refused because their time was not after the one before.
    pub refused: u64,
    /// Samples rejected as infinite or out of range, by measured channel.
    pub rejected: Vec<(String, u64)>,
    /// Between which values the samples of each measured channel lay.
    pub ranges: Vec<SampleRange>,
    /// Combiners that went by fewer truths than they take.
    pub lacks: Vec<Lack>,
}

/// A truth over time: one entry for each instant at which it was measured.
#[derive(Debug, Clone)]
pub struct TruthTrace {
    /// Its slot.
    pub slot: usize,
    /// What no model predicts of it.
    pub no_model: NoModel,
    /// The segment of the recording, counted from 0, and the instant.
    pub times: Vec<(u32, Instant)>,
    /// The truth.
    pub values: Vec<f64>,
    /// Its standard error; NaN where its node gives none.
    pub errors: Vec<f64>,
    /// What was predicted of it.
    pub predictions: Vec<PredictionTrace>,
    /// For each horizon the truth at the smallest lag that sees nothing of the answer, several steps ahead of that so many steps
    /// back; NaN where there was none. Empty in a free run, which would repeat the first truth of each segment.
    pub persistence: BTreeMap<Duration, Vec<f64>>,
}

/// A prediction over time, paired with its truths as in scoring.
#[derive(Debug, Clone)]
pub struct PredictionTrace {
    /// Its slot.
    pub slot: usize,
    /// Its node.
    pub node: usize,
    /// Its horizon.
    pub ahead: Duration,
    /// Its value for each truth; NaN where there was none.
    pub values: Vec<f64>,
    /// Both ends of the interval about each, where it has any.
    pub ends: Option<Vec<[f64; 2]>>,
}

/// Steps a plan over a recording, cold, and writes down every truth with its predictions. `look` sees each tick and each
/// segment break.
///
/// # Errors
/// When the recording cannot be read, or the fit does not belong to the plan.
pub fn trace(
    plan: &Arc<Plan>,
    fitted: &Fitted,
    recording: &dyn Recording,
    look: &mut dyn FnMut(&Engine, Event),
) -> Result<Trace, FitError> {
    trace_as(plan, fitted, recording, &ScoreOptions::default(), look)
}

/// The same in another mode, or with nothing learned on the way. What is left out of scores is not left out here.
///
/// # Errors
/// When the recording cannot be read, or the fit does not belong to the plan.
pub fn trace_as(
    plan: &Arc<Plan>,
    fitted: &Fitted,
    recording: &dyn Recording,
    options: &ScoreOptions,
    look: &mut dyn FnMut(&Engine, Event),
) -> Result<Trace, FitError> {
    let mut engine = Engine::new(Arc::clone(plan), fitted)?;
    engine.freeze(options.frozen);
    engine.predict_in(options.mode);
    let mut watch = Watch::new(plan, options.mode);
    let mut times = vec![Vec::new(); watch.truths.len()];
    let mut segment = 0;
    let passed = pass(&mut engine, recording, |engine, event, _| {
        watch.look(engine, event);
        match event {
            Event::Segment => segment += 1,
            Event::Row(now) => {
                for (times, truth) in times.iter_mut().zip(&watch.truths) {
                    if times.len() < truth.values.len() {
                        times.push((segment, now));
                    }
                }
            }
        }
        look(engine, event);
    })?;
    let lacks = evidence::lacks(&watch.tallies);
    let truths = watch.truths.into_iter().zip(times);
    let truths = truths.map(|(truth, times)| TruthTrace {
        slot: truth.slot,
        no_model: NoModel::of(plan, truth.slot, &options.levels),
        times,
        values: truth.values,
        errors: truth.errors,
        predictions: truth
            .predictions
            .into_iter()
            .map(|prediction| PredictionTrace {
                slot: prediction.slot,
                node: prediction.node,
                ahead: prediction.ahead,
                values: prediction.values,
                ends: prediction.intervals.map(|_| prediction.ends),
            })
            .collect(),
        persistence: truth
            .persistences
            .into_iter()
            .filter(|_| options.mode != Mode::FreeRun)
            .map(|(ahead, persistence)| (ahead, persistence.values))
            .collect(),
    });
    Ok(Trace {
        truths: truths.collect(),
        ticks: passed.ticks,
        refused: engine.refused(),
        rejected: engine.rejected_channels(),
        ranges: engine.sample_ranges(),
        lacks,
    })
}
