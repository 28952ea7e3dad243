//! Decides how a fitted estimator is run: which regressors it is given, and when it gives nothing.

use std::sync::Arc;

use super::EngineError;
use super::gather::Gathered;
use crate::compile::{PlannedNode, PlannedRole};
use crate::node::Predictor;
use crate::time::Instant;

/// A fitted estimator in a running plan.
#[derive(Debug)]
pub(crate) struct Estimate {
    predictor: Arc<dyn Predictor>,
    /// Where the regressors that it uses are: gather and place within it.
    places: Vec<(usize, usize)>,
    row: Vec<f64>,
}

impl Estimate {
    /// Finds the regressors that a predictor uses.
    ///
    /// # Errors
    /// When the node has no regressor of a name that the predictor uses.
    pub(crate) fn new(
        node: &PlannedNode,
        predictor: Arc<dyn Predictor>,
        widths: &[usize],
    ) -> Result<Self, EngineError> {
        let PlannedRole::Estimator {
            regressors,
            gathers,
            ..
        } = &node.role
        else {
            return Err(EngineError::NotAnEstimator {
                node: node.instance(),
            });
        };
        let places: Vec<_> = gathers
            .iter()
            .flat_map(|&gather| (0..widths[gather]).map(move |place| (gather, place)))
            .collect();
        let place = |name: &String| match regressors
            .iter()
            .position(|regressor| regressor.name == *name)
        {
            Some(index) => Ok(places[index]),
            None => Err(EngineError::UnknownRegressor {
                node: node.instance(),
                regressor: name.clone(),
                known: regressors
                    .iter()
                    .map(|regressor| regressor.name.clone())
                    .collect(),
            }),
        };
        let places = predictor
            .uses()
            .iter()
            .map(place)
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            row: vec![0.0; places.len()],
            predictor,
            places,
        })
    }

    /// The prediction and its stamp, the oldest among the values used; none where one of them is missing.
    pub(crate) fn run(&mut self, gathered: &[Gathered], now: Instant) -> Option<(f64, Instant)> {
        let mut oldest = if self.places.is_empty() {
            now
        } else {
            Instant::MAX
        };
        for (value, &(gather, place)) in self.row.iter_mut().zip(&self.places) {
            let from = &gathered[gather];
            *value = from.values[place];
            if value.is_nan() {
                return None;
            }
            oldest = oldest.min(from.stamps[place]);
        }
        let prediction = self.predictor.predict(&self.row);
        prediction.is_finite().then_some((prediction, oldest))
    }

    /// Asks for the prediction from any values.
    #[cfg(feature = "testkit")]
    pub(crate) fn ask_idly(&self, value: &mut dyn FnMut() -> f64) {
        let row: Vec<f64> = self.row.iter().map(|_| value()).collect();
        self.predictor.predict(&row);
    }
}
