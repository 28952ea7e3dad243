//! The estimator with squares and products of features.

use athermal_core::node::{
    Coefficients, Estimator, Factor, InputPort, Mistake, Of, Predictor, Regressor, Regressors,
    Trained, Trainer, TrainingError, TrainingReport, TrainingSetup,
};
use athermal_core::node::{number, numbers};
use athermal_core::time::Duration;
use athermal_numerics::{Novelty, Standardizer};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::features::{FEATURES_AND_TRUTH, present_features};
use crate::novelty::novelty_mistakes;
use crate::regression::LinearTrainer;
use crate::scaling::{scale_mistakes, tell_first_rows, term_mistake};
use crate::selection::Selection;
use crate::solver::{PRIOR, Solver};

/// More terms would take the memory of many rows, and no machine has been seen that needs them.
const MOST_TERMS: usize = 500;

/// Second-order regression of the truth on features, their squares and their products.
///
/// `ŷ(t + ahead) = b₀ + Σ b_j z_j + Σ b_jk z_j z_k` with features centred and scaled by the rows of the fit, so that
/// a square is not nearly its feature once more. Terms are chosen by stepwise regression, as Chen (1996) did for the
/// thermal errors of a machining centre, unless another selection is stated. There may be 500 of them at most.
/// Outside the range of the fit a square grows without bound. The port `novelty` shows where that is, of the terms as
/// that of `linear` does of features; `outside` says what becomes of it. Put a `guard` behind it too.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Polynomial {
    /// Whether squares of features are terms.
    #[serde(default = "yes")]
    pub squares: bool,
    /// Whether products of two features are terms.
    #[serde(default = "yes")]
    pub interactions: bool,
    /// How coefficients are found.
    #[serde(default)]
    pub solver: Solver,
    /// How terms are chosen.
    #[serde(default = "Selection::stepwise")]
    pub selection: Selection,
}

fn yes() -> bool {
    true
}

impl Estimator for Polynomial {
    fn inputs() -> &'static [InputPort] {
        FEATURES_AND_TRUTH
    }

    fn regressors(&self) -> Regressors {
        present_features()
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = self.solver.mistakes();
        if self.solver.prior().is_some() {
            let message = "a prior is for regressors as they are, and not for their products";
            mistakes.push(Mistake::at(PRIOR, message).help("leave `prior` out"));
        }
        mistakes
    }

    fn has_novelty(&self) -> bool {
        true
    }

    fn mistakes_for(&self, features: usize) -> Vec<Mistake> {
        let squares = if self.squares { features } else { 0 };
        let products = if self.interactions {
            features * features.saturating_sub(1) / 2
        } else {
            0
        };
        let terms = features + squares + products;
        if terms <= MOST_TERMS {
            return Vec::new();
        }
        let message =
            format!("{features} features give {terms} terms, and at most {MOST_TERMS} are fitted");
        let fewer = if self.interactions {
            "name fewer features, or set `interactions = false`"
        } else {
            "name fewer features"
        };
        let mistake = Mistake::at("inputs.features", message).help(fewer);
        vec![mistake]
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(PolynomialTrainer {
            terms: self.terms(setup.regressors.len()),
            solver: self.solver.clone(),
            selection: self.selection,
            running: Standardizer::new(setup.regressors.len()),
            setup: TrainingSetup {
                memory: setup.memory / 2,
                ..setup.clone()
            },
            waiting: Vec::new(),
            expanding: None,
        })
    }
}

athermal_core::register!(Polynomial, Estimator, "polynomial");

/// One term: a feature, or a product of two, which may be the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Term(usize, Option<usize>);

impl Term {
    fn of(self, z: &[f64]) -> f64 {
        z[self.0] * self.1.map_or(1.0, |second| z[second])
    }

    fn name(self, features: &[Regressor]) -> String {
        let first = &features[self.0].name;
        match self.1 {
            None => first.clone(),
            Some(second) if second == self.0 => format!("{first}²"),
            Some(second) => format!("{first} × {}", features[second].name),
        }
    }

    fn sensors(self, features: &[Regressor]) -> Vec<String> {
        let mut sensors = features[self.0].sensors.clone();
        for sensor in self.1.iter().flat_map(|&second| &features[second].sensors) {
            if !sensors.contains(sensor) {
                sensors.push(sensor.clone());
            }
        }
        sensors
    }
}

impl Polynomial {
    fn terms(&self, features: usize) -> Vec<Term> {
        let mut terms: Vec<Term> = (0..features).map(|j| Term(j, None)).collect();
        for j in 0..features {
            for k in j..features {
                let wanted = if j == k {
                    self.squares
                } else {
                    self.interactions
                };
                if wanted {
                    terms.push(Term(j, Some(k)));
                }
            }
        }
        terms
    }
}

/// Holds rows back until it is known about what and in which scale features vary; then they become rows of terms.
struct PolynomialTrainer {
    setup: TrainingSetup,
    terms: Vec<Term>,
    solver: Solver,
    selection: Selection,
    running: Standardizer,
    waiting: Vec<f64>,
    expanding: Option<Expanding>,
}

struct Expanding {
    /// How many rows centres and scales were found from.
    found_from: usize,
    centres: Vec<f64>,
    scales: Vec<f64>,
    trainer: LinearTrainer,
    z: Vec<f64>,
    row: Vec<f64>,
}

impl Expanding {
    fn row(&mut self, terms: &[Term], features: &[f64], truth: f64) {
        self.z.clear();
        let scaled = features.iter().zip(&self.centres).zip(&self.scales);
        self.z
            .extend(scaled.map(|((x, centre), scale)| (x - centre) / scale));
        self.row.clear();
        self.row.extend(terms.iter().map(|term| term.of(&self.z)));
        self.trainer.row(&self.row, truth);
    }
}

impl PolynomialTrainer {
    fn expand(&mut self) {
        if self.expanding.is_some() {
            return;
        }
        let features = &self.setup.regressors;
        let regressors = self.terms.iter().map(|term| Regressor {
            name: term.name(features),
            unit: String::new(),
            sensors: term.sensors(features),
            lag: Duration::ZERO,
            of_truth: false,
        });
        let setup = TrainingSetup {
            regressors: regressors.collect(),
            ..self.setup.clone()
        };
        let standard = self.running.standardization();
        let mut expanding = Expanding {
            found_from: self.waiting.len() / (features.len() + 1),
            centres: standard.means,
            scales: standard.scales,
            trainer: LinearTrainer::new(&setup, self.solver.clone(), Some(self.selection)),
            z: Vec::new(),
            row: Vec::new(),
        };
        for row in std::mem::take(&mut self.waiting).chunks_exact(features.len() + 1) {
            let (features, truth) = row.split_at(features.len());
            expanding.row(&self.terms, features, truth[0]);
        }
        self.expanding = Some(expanding);
    }
}

impl Trainer for PolynomialTrainer {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        if let Some(expanding) = &mut self.expanding {
            expanding.row(&self.terms, regressors, truth);
            return;
        }
        self.running.partial_fit(regressors);
        self.waiting.extend_from_slice(regressors);
        self.waiting.push(truth);
        if self.waiting.len() * size_of::<f64>() > self.setup.memory {
            self.expand();
        }
    }

    fn finish(mut self: Box<Self>) -> Result<Trained, TrainingError> {
        self.expand();
        let Some(expanding) = self.expanding else {
            return Err(TrainingError::TooFewRows { rows: 0, needed: 2 });
        };
        let mut report = TrainingReport::default();
        let linear = expanding.trainer.solve(&mut report)?;
        tell_first_rows(expanding.found_from, expanding.trainer.rows(), &mut report);
        let features = &self.setup.regressors;
        let mut predictor = PolynomialPredictor {
            regressors: Vec::new(),
            centres: Vec::new(),
            scales: Vec::new(),
            terms: Vec::new(),
            coefficients: Vec::new(),
            intercept: linear.intercept,
            // It is of all terms, which are those that are left but where one has no coefficient.
            novelty: linear
                .novelty
                .filter(|_| linear.coefficients.iter().all(|b| *b != 0.0)),
        };
        let mut used: Vec<usize> = Vec::new();
        let mut place = |feature: usize| {
            used.iter()
                .position(|&known| known == feature)
                .unwrap_or_else(|| {
                    used.push(feature);
                    used.len() - 1
                })
        };
        // The square of what is on or off may stay the same, though the feature does not.
        let varying = linear.regressors.iter().zip(linear.coefficients);
        for (name, coefficient) in varying.filter(|(_, b)| *b != 0.0) {
            let term = self.terms.iter().find(|term| term.name(features) == *name);
            let term = term.expect("the fit chose among these terms");
            let first = place(term.0);
            predictor.terms.push(Term(first, term.1.map(&mut place)));
            predictor.coefficients.push(coefficient);
        }
        for &feature in &used {
            predictor.regressors.push(features[feature].name.clone());
            predictor.centres.push(expanding.centres[feature]);
            predictor.scales.push(expanding.scales[feature]);
        }
        Ok(Trained {
            predictor: Box::new(predictor),
            report,
        })
    }
}

/// A fitted polynomial of second order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PolynomialPredictor {
    /// The features used.
    regressors: Vec<String>,
    /// The value about which each varies, in its unit.
    #[serde(with = "numbers")]
    centres: Vec<f64>,
    /// How far each varies, in its unit.
    #[serde(with = "numbers")]
    scales: Vec<f64>,
    /// The terms, by the positions of their features.
    terms: Vec<Term>,
    /// The coefficient of each term, in the unit of the truth.
    #[serde(with = "numbers")]
    coefficients: Vec<f64>,
    /// The intercept, in the unit of the truth.
    #[serde(with = "number")]
    intercept: f64,
    /// How far terms are from those of the fit, where its rows say so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    novelty: Option<Novelty>,
}

impl Predictor for PolynomialPredictor {
    fn uses(&self) -> &[String] {
        &self.regressors
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let width = self.regressors.len();
        let (centres, scales) = (("centres", &*self.centres), ("scales", &*self.scales));
        let mut mistakes = scale_mistakes(width, centres, scales);
        let coefficients = [("coefficients", self.coefficients.len())];
        mistakes.extend(Mistake::of_lengths(self.terms.len(), &coefficients));
        let features = self.terms.iter().flat_map(|term| [Some(term.0), term.1]);
        mistakes.extend(term_mistake(width, features.flatten()));
        mistakes.extend(novelty_mistakes(self.novelty.as_ref(), self.terms.len()));
        mistakes
    }

    fn coefficients(&self) -> Option<Coefficients> {
        let factor = |regressor: usize| Factor {
            about: self.centres[regressor],
            ..Factor::of(regressor)
        };
        let terms = self.terms.iter().zip(&self.coefficients).map(|(term, b)| {
            let places: Vec<usize> = std::iter::once(term.0).chain(term.1).collect();
            let scale: f64 = places.iter().map(|&place| self.scales[place]).product();
            let factors = places.into_iter().map(factor).collect();
            athermal_core::node::Term::new(Of::Product(factors), b / scale)
        });
        let constant = athermal_core::node::Term::new(Of::Constant, self.intercept);
        Some(Coefficients {
            terms: std::iter::once(constant).chain(terms).collect(),
            ..Coefficients::default()
        })
    }

    fn novelty(&self, regressors: &[f64]) -> f64 {
        let z = |j: usize| (regressors[j] - self.centres[j]) / self.scales[j];
        let terms = self.terms.iter();
        let terms = terms.map(|term| z(term.0) * term.1.map_or(1.0, z));
        let novelty = self.novelty.as_ref();
        novelty.map_or(f64::NAN, |novelty| novelty.at_each(terms))
    }

    fn centre(&self) -> f64 {
        let novelty = self.novelty.as_ref();
        novelty.map_or(self.intercept, |of| {
            of.centre(self.intercept, &self.coefficients)
        })
    }

    fn predict(&self, regressors: &[f64]) -> f64 {
        let z = |j: usize| (regressors[j] - self.centres[j]) / self.scales[j];
        let terms = self.terms.iter().zip(&self.coefficients);
        terms.fold(self.intercept, |sum, (term, b)| {
            sum + b * z(term.0) * term.1.map_or(1.0, z)
        })
    }
}

athermal_core::predictor!(PolynomialPredictor, "polynomial");
