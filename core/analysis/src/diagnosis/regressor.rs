//! How well the data determine what an estimator has learned: condition, variance inflation, and what each regressor
//! moves.

use athermal_core::compile::{PlannedNode, PlannedRole, TrainingLimits};
use athermal_core::engine::{Engine, Pairing};
use athermal_core::node::number_or_none;
use athermal_core::node::{Of, Predictor};
use athermal_core::time::Instant;
use athermal_numerics::{Collinearity, GramBlocks};
use athermal_run::fit::FitError;
use athermal_run::model::Model;
use athermal_run::recording::{Event, Recording};
use athermal_run::score::trace;
use serde::{Serialize, Serializer};

/// The regressors that a fitted estimator uses, over the rows of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Design {
    /// The estimator: `thermal.Z1`.
    pub node: String,
    /// The unit of its predictions.
    pub unit: String,
    /// Truths within the limits of its fit before which it had run, as far before as it predicts, with all its regressors.
    pub rows: u64,
    /// The condition number of the standardised regressors; NaN (null in JSON) without rows, and of a model that filters its
    /// inputs or its past, which other columns determine; infinite (`"inf"`) where they are collinear.
    #[serde(serialize_with = "or_null")]
    pub condition: f64,
    /// Each regressor.
    pub regressors: Vec<RegressorFacts>,
}

/// A regressor of a fitted estimator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegressorFacts {
    /// Its name: `gradients.chuck@150s`.
    pub name: String,
    /// How much the prediction moves when it moves by one standard deviation and the others stay at their means.
    pub effect: f64,
    /// Its variance inflation factor; NaN (null in JSON) where it is constant, and where there is no condition number, infinite
    /// (`"inf"`) where the others determine it.
    #[serde(serialize_with = "or_null")]
    pub inflation: f64,
}

fn or_null<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    let known = Some(*value).filter(|value| !value.is_nan());
    number_or_none::serialize(&known, serializer)
}

/// An estimator whose rows are collected.
struct Collecting<'a> {
    node: usize,
    truth: usize,
    predictor: &'a dyn Predictor,
    /// Gather and place of each regressor that is used.
    places: Vec<(usize, usize)>,
    row: Vec<f64>,
    /// Its runs, of which each truth is paired with one as in a fit.
    runs: Pairing,
    limits: TrainingLimits,
    blocks: GramBlocks,
}

/// The design of every fitted estimator that uses a regressor.
///
/// # Errors
/// When the recording cannot be read, or the fit does not belong to the graph.
pub fn designs(model: &Model, recording: &dyn Recording) -> Result<Vec<Design>, FitError> {
    let mut collecting = collecting(model);
    let mut look = |engine: &Engine, event: Event| {
        for of in &mut collecting {
            match event {
                Event::Row(now) => of.look(engine, now),
                Event::Segment => of.runs.clear(),
            }
        }
    };
    trace(&model.plan, &model.fitted, recording, &mut look)?;
    Ok(collecting.iter().map(|of| of.design(model)).collect())
}

fn collecting(model: &Model) -> Vec<Collecting<'_>> {
    let plan = &*model.plan;
    let mut collecting = Vec::new();
    for (index, node) in plan.nodes.iter().enumerate() {
        let (PlannedRole::Estimator { fit, gathers, .. }, Some(predictor)) =
            (&node.role, model.fitted.get(&node.instance()))
        else {
            continue;
        };
        let places: Vec<(usize, usize)> = gathers
            .iter()
            .flat_map(|&gather| (0..plan.gathers[gather].entries.len()).map(move |n| (gather, n)))
            .collect();
        let place = |name: &String| fit.regressors.iter().position(|of| of.name == *name);
        let used: Option<Vec<usize>> = predictor.uses().iter().map(place).collect();
        let Some(used) = used.filter(|used| !used.is_empty()) else {
            continue;
        };
        collecting.push(Collecting {
            node: index,
            truth: fit.truth.slot,
            predictor: &**predictor,
            row: vec![0.0; used.len()],
            runs: Pairing::new(&fit.truth, used.len()),
            limits: fit.training,
            blocks: GramBlocks::with_row_memory(used.len(), 0),
            places: used.into_iter().map(|nth| places[nth]).collect(),
        });
    }
    collecting
}

/// Whether a model filters its inputs or its past, so that its regressors are not the columns that determine it.
fn filters(node: &PlannedNode, predictor: &dyn Predictor) -> bool {
    match predictor.coefficients() {
        Some(of) => {
            let mut terms = of.terms.iter();
            terms.any(|term| matches!(term.of, Of::Power { .. }))
        }
        None => {
            predictor.linear().is_none()
                && matches!(
                    node.role,
                    PlannedRole::Estimator {
                        every_tick: true,
                        ..
                    }
                )
        }
    }
}

impl Collecting<'_> {
    fn look(&mut self, engine: &Engine, now: Instant) {
        let Self {
            node,
            truth,
            places,
            row,
            runs,
            limits,
            blocks,
            ..
        } = self;
        if engine.ran(engine.plan().nodes[*node].slots.start) {
            for (value, &(gather, place)) in row.iter_mut().zip(places.iter()) {
                *value = engine.gathered(gather).0[place];
            }
            runs.run(now, [&row[..]]);
        }
        if limits.admits(engine.value(*truth))
            && let Some(run) = runs.truth(now)
            && run.row.iter().all(|value| value.is_finite())
        {
            blocks.push(run.row, 0.0);
        }
    }

    fn design(&self, model: &Model) -> Design {
        let gram = self.blocks.total();
        let width = self.places.len();
        let columns: Vec<usize> = (0..width).collect();
        let found = Collinearity::of(&gram, &columns).ok();
        let (means, variances) = (gram.means(), gram.variances());
        let effect = |nth: usize| {
            let at = |by: f64| {
                let mut row = means[..width].to_vec();
                row[nth] += by * variances[nth].sqrt();
                self.predictor.predict(&row)
            };
            (at(1.0) - at(-1.0)) / 2.0
        };
        let node = &model.plan.nodes[self.node];
        let truth = &model.plan.channels[self.truth].channel;
        let collinearity = found.as_ref().filter(|_| !filters(node, self.predictor));
        Design {
            node: node.instance(),
            unit: truth.unit.difference().to_string(),
            rows: gram.count(),
            condition: collinearity.map_or(f64::NAN, |of| of.condition),
            regressors: self
                .predictor
                .uses()
                .iter()
                .enumerate()
                .map(|(nth, name)| RegressorFacts {
                    name: name.clone(),
                    effect: if found.is_some() {
                        effect(nth)
                    } else {
                        f64::NAN
                    },
                    inflation: collinearity.map_or(f64::NAN, |of| of.inflation[nth]),
                })
                .collect(),
        }
    }
}
