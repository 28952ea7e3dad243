//! The estimator with products of past drift and temperatures.

use athermal_core::node::{
    Coefficients, Estimator, Factor, Figure, Figures, InputPort, Mistake, Of, Predictor, Regressor,
    Regressors, SelectionStep, Trained, Trainer, TrainingError, TrainingReport, TrainingSetup,
    TruthLags,
};
use athermal_core::node::{number, numbers};
use athermal_numerics::{ErrorReduction, ForwardRegression, Gram, Novelty, Standardizer};

use serde::{Deserialize, Serialize};

use crate::keys::keys;
use crate::lags::repeated;
use crate::novelty::{novelty_mistakes, novelty_of_rows};
use crate::scaling::{scale_mistakes, tell_first_rows, term_mistake};
use crate::unsolved::unsolved;

/// More terms would take the memory of many rows.
const MOST_TERMS: usize = 500;

keys! {
    /// Nonlinear autoregression with exogenous inputs: a polynomial in features and the truth's own past.
    ///
    /// `ŷ(t + ahead) = ȳ + Σ θ_k p_k(z)` with products `p_k` of up to `degree` of the variables `z` (Chen and
    /// Billings 1989). These are the features and the past truths, each about its mean in the rows of the fit and in
    /// units of its deviation there. The constant and all products, 499 at most, are candidates. Forward regression
    /// takes, one after the other, the one that explains most of what is left of the truth. Its share of the truth's
    /// squares about their mean `ȳ` is the error-reduction ratio (Chen, Billings and Luo 1989), which the fit prints
    /// and keeps for every term. Coefficients are least squares.
    ///
    /// Outside the range of the fit powers grow without bound: there a variable counts in products as at the edge of the range,
    /// and alone as it is. The port `novelty` shows where that is: that of `linear`, of the terms as they are without an edge. A fit whose
    /// rows do not fit in memory has none. Like `arx` it takes the lags as they are stated, and predicts `ahead` directly; the answer changes with
    /// time alone, so the node runs at every tick.
    pub struct Narx {
        lags feature_lags;
        /// How many variables a product has at most, from 1 to 4.
        #[serde(default = "two")]
        #[schemars(range(min = 1, max = 4))]
        pub degree: usize,
        /// The least error-reduction ratio with which a term is taken, from 0 up to, but not including, 1.
        #[serde(default = "thousandth")]
        #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 1.0))]
        pub tolerance: f64,
        /// Take at most so many terms, 1 or more.
        #[serde(default = "twenty")]
        #[schemars(range(min = 1))]
        pub most: usize,
    }
}

fn two() -> usize {
    2
}

fn thousandth() -> f64 {
    1e-3
}

fn twenty() -> usize {
    20
}

impl Estimator for Narx {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("features", "what the prediction is made of beside the past"),
                InputPort::truth("what is predicted, from its own past and the features"),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            feature_lags: self.feature_lags.clone(),
            truth_lags: TruthLags::At(self.lags.clone()),
            every_tick: true,
            ..Regressors::default()
        }
    }

    fn has_novelty(&self) -> bool {
        true
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = repeated("lags", &self.lags);
        mistakes.extend(repeated("feature_lags", &self.feature_lags));
        mistakes
    }

    fn mistakes_for(&self, features: usize) -> Vec<Mistake> {
        let variables = features * self.feature_lags.len() + self.lags.len();
        if Term::all(variables, self.degree).len() <= MOST_TERMS {
            return Vec::new();
        }
        let message = format!(
            "{variables} features and lags give more than {MOST_TERMS} products of up to {}, the most that are compared",
            self.degree
        );
        let mistake = Mistake::at("inputs.features", message)
            .help("name fewer features, fewer lags, or a lower `degree`");
        vec![mistake]
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let width = setup.regressors.len();
        Box::new(NarxTrainer {
            parameters: self.clone(),
            terms: Term::all(width, self.degree),
            regressors: setup.regressors.clone(),
            memory: setup.memory / 2,
            running: Standardizer::new(width),
            range: vec![(f64::INFINITY, f64::NEG_INFINITY); width],
            waiting: Vec::new(),
            expanding: None,
        })
    }
}

athermal_core::register!(Narx, Estimator, "narx");

/// A product of variables by their positions in ascending order; the constant has none.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Term(Vec<usize>);

impl Term {
    /// All products of up to so many variables, the shortest first; a few more than are fitted where they are too many.
    fn all(width: usize, degree: usize) -> Vec<Self> {
        let mut terms = vec![Self(Vec::new())];
        let mut begin = 0;
        for _ in 0..degree {
            let end = terms.len();
            for nth in begin..end {
                let from = terms[nth].0.last().copied().unwrap_or(0);
                for variable in from..width {
                    if terms.len() > MOST_TERMS {
                        return terms;
                    }
                    let mut product = terms[nth].0.clone();
                    product.push(variable);
                    terms.push(Self(product));
                }
            }
            begin = end;
        }
        terms
    }

    fn of(&self, z: impl Fn(usize) -> f64) -> f64 {
        self.0.iter().fold(1.0, |product, &j| product * z(j))
    }

    fn name(&self, variables: &[Regressor]) -> String {
        if self.0.is_empty() {
            return "constant".to_owned();
        }
        let mut names: Vec<String> = Vec::new();
        for part in self.0.chunk_by(|a, b| a == b) {
            let power = ["", "", "²", "³", "⁴"][part.len().min(4)];
            names.push(format!("{}{power}", variables[part[0]].name));
        }
        names.join(" × ")
    }
}

/// Holds rows back until it is known about what and in which scale variables vary; then they become sums of products.
struct NarxTrainer {
    parameters: Narx,
    regressors: Vec<Regressor>,
    terms: Vec<Term>,
    memory: usize,
    running: Standardizer,
    range: Vec<(f64, f64)>,
    /// The rows, while they fit in memory.
    waiting: Vec<f64>,
    expanding: Option<Expanding>,
}

struct Expanding {
    /// How many rows centres and scales were found from.
    found_from: usize,
    centres: Vec<f64>,
    scales: Vec<f64>,
    mean: f64,
    gram: Gram,
    rows: Vec<f64>,
    scratch: Vec<f64>,
}

/// Rows of terms are summed so many at a time.
const AT_ONCE: usize = 256;

impl Expanding {
    fn row(&mut self, terms: &[Term], variables: &[f64], truth: f64) {
        let z = |j: usize| (variables[j] - self.centres[j]) / self.scales[j];
        self.rows.extend(terms.iter().map(|term| term.of(z)));
        self.rows.push(truth - self.mean);
        if self.rows.len() >= AT_ONCE * (terms.len() + 1) {
            self.sum_up();
        }
    }

    fn sum_up(&mut self) {
        self.gram.add_rows(&self.rows, None, &mut self.scratch);
        self.rows.clear();
    }
}

impl NarxTrainer {
    fn expand(&mut self) {
        if self.expanding.is_some() {
            return;
        }
        let width = self.regressors.len();
        let standard = self.running.standardization();
        let waiting = &self.waiting;
        let truths = waiting.chunks_exact(width + 1).map(|row| row[width]);
        let mean = truths.sum::<f64>() / (waiting.len() / (width + 1)).max(1) as f64;
        let mut expanding = Expanding {
            found_from: waiting.len() / (width + 1),
            centres: standard.means,
            scales: standard.scales,
            mean,
            gram: Gram::new(self.terms.len()),
            rows: Vec::new(),
            scratch: Vec::new(),
        };
        for row in waiting.chunks_exact(width + 1) {
            expanding.row(&self.terms, &row[..width], row[width]);
        }
        self.expanding = Some(expanding);
    }

    fn report(&self, found: &athermal_numerics::ForwardModel) -> TrainingReport {
        let step = |explained: &mut f64, term: &ErrorReduction| {
            *explained += term.ratio;
            SelectionStep {
                regressor: self.terms[term.column].name(&self.regressors),
                score: *explained,
                ..SelectionStep::default()
            }
        };
        let mut explained = 0.0;
        let ratios = found.terms.iter().map(|term| {
            let name = self.terms[term.column].name(&self.regressors);
            (name, term.ratio)
        });
        let by_name = Figure::named(ratios.clone());
        let ratios: Vec<String> = ratios
            .map(|(name, ratio)| format!("{name} {ratio:.3e}"))
            .collect();
        let note = if ratios.is_empty() {
            "no term explains as much as `tolerance` asks for, so the prediction is the mean of the rows".to_owned()
        } else {
            format!("error-reduction ratios: {}", ratios.join(", "))
        };
        TrainingReport {
            notes: vec![note],
            figures: Figures::from([("error_reduction_ratios".to_owned(), by_name)]),
            selection: found
                .terms
                .iter()
                .map(|term| step(&mut explained, term))
                .collect(),
            refused: found
                .refused
                .map(|term| step(&mut explained.clone(), &term)),
            ..TrainingReport::default()
        }
    }
}

impl Trainer for NarxTrainer {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        for (range, &x) in self.range.iter_mut().zip(regressors) {
            *range = (range.0.min(x), range.1.max(x));
        }
        if let Some(expanding) = &mut self.expanding {
            expanding.row(&self.terms, regressors, truth);
            return;
        }
        self.running.partial_fit(regressors);
        self.waiting.extend_from_slice(regressors);
        self.waiting.push(truth);
        if self.waiting.len() * size_of::<f64>() > self.memory {
            self.expand();
            self.waiting = Vec::new();
        }
    }

    fn finish(mut self: Box<Self>) -> Result<Trained, TrainingError> {
        self.expand();
        let Some(expanding) = &mut self.expanding else {
            return Err(TrainingError::TooFewRows { rows: 0, needed: 2 });
        };
        expanding.sum_up();
        let how = ForwardRegression {
            most: self.parameters.most,
            least_reduction: self.parameters.tolerance,
        };
        let found = how.run(&expanding.gram).map_err(unsolved)?;
        let squares = expanding
            .gram
            .moments_about(&vec![0.0; self.terms.len() + 1]);
        let spread = squares[(self.terms.len(), self.terms.len())];
        let mean_square = spread * found.unexplained / expanding.gram.count() as f64;
        let mut used: Vec<usize> = found
            .terms
            .iter()
            .flat_map(|term| self.terms[term.column].0.iter().copied())
            .collect();
        used.sort_unstable();
        used.dedup();
        let place = |variable: &usize| used.binary_search(variable).unwrap_or(0);
        let edge = |j: usize, value: f64| (value - expanding.centres[j]) / expanding.scales[j];
        let mut predictor = NarxPredictor {
            regressors: used
                .iter()
                .map(|&j| self.regressors[j].name.clone())
                .collect(),
            centres: used.iter().map(|&j| expanding.centres[j]).collect(),
            scales: used.iter().map(|&j| expanding.scales[j]).collect(),
            lowest: used.iter().map(|&j| edge(j, self.range[j].0)).collect(),
            highest: used.iter().map(|&j| edge(j, self.range[j].1)).collect(),
            terms: found
                .terms
                .iter()
                .map(|term| Term(self.terms[term.column].0.iter().map(place).collect()))
                .collect(),
            coefficients: found.coefficients.clone(),
            mean: expanding.mean,
            novelty: None,
        };
        let mut row = vec![0.0; used.len()];
        let mut rows = Vec::new();
        for whole in self.waiting.chunks_exact(self.regressors.len() + 1) {
            row.iter_mut()
                .zip(&used)
                .for_each(|(to, &j)| *to = whole[j]);
            rows.extend(predictor.moving(&row));
        }
        let moving = predictor.terms.iter().filter(|term| !term.0.is_empty());
        predictor.novelty = novelty_of_rows(moving.count(), &rows);
        let (found_from, rows) = (expanding.found_from, expanding.gram.count());
        let mut report = self.report(&found);
        report.in_sample_rmse = Some(mean_square.sqrt());
        tell_first_rows(found_from, rows, &mut report);
        Ok(Trained {
            predictor: Box::new(predictor),
            report,
        })
    }
}

/// A fitted polynomial in features and past truths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NarxPredictor {
    regressors: Vec<String>,
    #[serde(with = "numbers")]
    centres: Vec<f64>,
    #[serde(with = "numbers")]
    scales: Vec<f64>,
    /// The range of each variable in the fit, scaled.
    #[serde(with = "numbers")]
    lowest: Vec<f64>,
    #[serde(with = "numbers")]
    highest: Vec<f64>,
    /// The terms, by the positions of their variables.
    terms: Vec<Term>,
    #[serde(with = "numbers")]
    coefficients: Vec<f64>,
    #[serde(with = "number")]
    mean: f64,
    /// How far terms beside the constant are from those of the fit, where its rows say so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    novelty: Option<Novelty>,
}

impl NarxPredictor {
    /// The terms beside the constant, none of them held at an edge.
    fn moving<'a>(&'a self, variables: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let z = |j: usize| (variables[j] - self.centres[j]) / self.scales[j];
        let moving = self.terms.iter().filter(|term| !term.0.is_empty());
        moving.map(move |term| term.of(z))
    }
}

impl Predictor for NarxPredictor {
    fn uses(&self) -> &[String] {
        &self.regressors
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let width = self.regressors.len();
        let (centres, scales) = (("centres", &*self.centres), ("scales", &*self.scales));
        let mut mistakes = scale_mistakes(width, centres, scales);
        let edges = [
            ("lowest", self.lowest.len()),
            ("highest", self.highest.len()),
        ];
        mistakes.extend(Mistake::of_lengths(width, &edges));
        let coefficients = [("coefficients", self.coefficients.len())];
        mistakes.extend(Mistake::of_lengths(self.terms.len(), &coefficients));
        let variables = self.terms.iter().flat_map(|term| &term.0);
        mistakes.extend(term_mistake(width, variables.copied()));
        let moving = self.terms.iter().filter(|term| !term.0.is_empty());
        mistakes.extend(novelty_mistakes(self.novelty.as_ref(), moving.count()));
        mistakes
    }

    fn novelty(&self, regressors: &[f64]) -> f64 {
        let novelty = self.novelty.as_ref();
        novelty.map_or(f64::NAN, |of| of.at_each(self.moving(regressors)))
    }

    fn centre(&self) -> f64 {
        let all = || self.terms.iter().zip(&self.coefficients);
        let constants = all().filter(|(term, _)| term.0.is_empty());
        let constant = constants.fold(self.mean, |sum, (_, b)| sum + b);
        let moving = all().filter(|(term, _)| !term.0.is_empty());
        let novelty = self.novelty.as_ref();
        novelty.map_or(constant, |of| of.centre(constant, moving.map(|(_, b)| b)))
    }

    fn coefficients(&self) -> Option<Coefficients> {
        let of_data = |j: usize, z: f64| self.centres[j] + z * self.scales[j];
        let term = |(term, b): (&Term, &f64)| {
            let scale: f64 = term.0.iter().map(|&j| self.scales[j]).product();
            let alone = term.0.len() == 1;
            let factors = term.0.iter().map(|&j| Factor {
                about: self.centres[j],
                held: if alone {
                    Factor::of(j).held
                } else {
                    (of_data(j, self.lowest[j]), of_data(j, self.highest[j]))
                },
                ..Factor::of(j)
            });
            athermal_core::node::Term::new(Of::Product(factors.collect()), b / scale)
        };
        let all = || self.terms.iter().zip(&self.coefficients);
        let constants = all().filter(|(term, _)| term.0.is_empty());
        let constant = constants.fold(self.mean, |sum, (_, b)| sum + b);
        let constant = athermal_core::node::Term::new(Of::Constant, constant);
        let products = all().filter(|(term, _)| !term.0.is_empty()).map(term);
        Some(Coefficients {
            terms: std::iter::once(constant).chain(products).collect(),
            ..Coefficients::default()
        })
    }

    fn predict(&self, regressors: &[f64]) -> f64 {
        let z = |j: usize| (regressors[j] - self.centres[j]) / self.scales[j];
        let terms = self.terms.iter().zip(&self.coefficients);
        terms.fold(self.mean, |sum, (term, coefficient)| {
            let product = if term.0.len() > 1 {
                term.of(|j| z(j).max(self.lowest[j]).min(self.highest[j]))
            } else {
                term.of(z)
            };
            sum + coefficient * product
        })
    }
}

athermal_core::predictor!(NarxPredictor, "narx");
