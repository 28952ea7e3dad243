//! How large the errors of predictions have been of late: each paired with the truth that it was of, once that is known.

use std::sync::Arc;

use athermal_run::live::{Slots as _, TickView};
use athermal_run::score::{PairedPrediction, link};

use crate::compile::{Plan, PlannedChannel};
use crate::time::Instant;

/// After so many seconds an error counts half.
const HALF_LIFE_S: f64 = 3_600.0;

/// The errors of all predictions of a graph.
#[derive(Debug, Default, Clone)]
pub struct PredictionErrors {
    plan: Option<Arc<Plan>>,
    all: Vec<PredictionError>,
    /// The last tick.
    last: Option<Instant>,
}

/// The error of a prediction.
#[derive(Debug, Clone)]
pub struct PredictionError {
    /// The channel that predicts.
    pub name: String,
    /// The unit of its errors.
    pub unit: String,
    truth: usize,
    paired: PairedPrediction,
    squares: f64,
    weight: f64,
    last: Option<Instant>,
}

impl PredictionErrors {
    /// The errors.
    pub fn iter(&self) -> impl Iterator<Item = &PredictionError> {
        self.all.iter()
    }

    /// Looks at what a tick did.
    pub fn look(&mut self, tick: &TickView<'_>) {
        let (now, plan) = (tick.at, tick.plan);
        if !self.plan.as_ref().is_some_and(|of| Arc::ptr_eq(of, plan)) {
            self.all = predictions(plan);
            self.plan = Some(Arc::clone(plan));
        }
        // What lies before a new segment pairs with nothing in it.
        let is_break = self.last.replace(now).is_some_and(|last| now <= last);
        for error in &mut self.all {
            if is_break {
                error.paired.clear();
                error.last = None;
            }
            error.look(tick);
        }
    }
}

impl PredictionError {
    /// The root mean square; none before there was a truth.
    pub fn rmse(&self) -> Option<f64> {
        (self.weight > 0.0).then(|| (self.squares / self.weight).sqrt())
    }

    fn look(&mut self, tick: &TickView<'_>) {
        let now = tick.at;
        let error = self.paired.error(tick, now, tick.value(self.truth));
        if error.is_nan() {
            return;
        }
        let passed = self
            .last
            .map_or(0.0, |last| (now - last).as_ns() as f64 / 1e9);
        self.last = Some(now);
        let kept = 0.5_f64.powf(passed / HALF_LIFE_S);
        self.squares = self.squares * kept + error.powi(2);
        self.weight = self.weight * kept + 1.0;
    }
}

fn predictions(plan: &Plan) -> Vec<PredictionError> {
    let prediction = |(slot, channel): (usize, &PlannedChannel)| {
        let link = link(plan, slot)?;
        let truth = &plan.channels[link.slot].channel;
        Some(PredictionError {
            name: channel.name.clone(),
            unit: truth.unit.difference().to_string(),
            truth: link.slot,
            paired: PairedPrediction::new(slot, &link),
            squares: 0.0,
            weight: 0.0,
            last: None,
        })
    };
    plan.channels
        .iter()
        .enumerate()
        .filter_map(prediction)
        .collect()
}
