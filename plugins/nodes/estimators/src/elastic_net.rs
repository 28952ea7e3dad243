//! The estimator that leaves features out by its penalty: lasso and elastic net share it.

use athermal_core::node::{
    Estimator, Forms, InputPort, Mistake, Regressor, Regressors, Summed, Trained, Trainer,
    TrainingError, TrainingReport, TrainingSetup,
};
use athermal_numerics::{
    Gram, GramBlocks, NumericsError, Standardization, logarithmic_grid, quiet_folds,
};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::conditioning::tell_columns;
use crate::features::{FEATURES_AND_TRUTH, present_features, too_many};
use crate::folds::{Folds, tell_moved, tell_quiet};
use crate::novelty::novelty_of;
use crate::penalty::{best_of, means};
use crate::regression::LinearPredictor;
use crate::summed::{add_sums, sums_of};
use crate::unsolved::unsolved;

/// Linear regression of the truth on features, many coefficients being exactly zero.
///
/// Minimises `1/(2n) Σ(y − ŷ)² + α (ρ Σ|w_j| + (1 − ρ)/2 Σ w_j²)` over the coefficients `w`, the intercept free, with
/// `ρ = l1_ratio` (Zou and Hastie 2005). It is solved exactly, by an active set as in Osborne, Presnell and Turlach
/// (2000). Features and truth are standardised, so that `α` means the same in all units. Of features that hang
/// together the lasso keeps one or the other; here the second term lets them share. Note that `α` stands against the
/// *mean* of squares, that of ridge against their sum.
///
/// The port `novelty` shows how far the features are outside of those of the fit, as that of `linear` does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ElasticNet {
    /// The penalty, at least 0; or a table such as `{ folds = 5 }`, and the best of a range is chosen by cross-validation.
    #[serde(default)]
    pub alpha: SparsePenalty,
    /// The share of the absolute values in the penalty, above 0 (towards ridge) up to 1 (lasso).
    #[serde(default = "half")]
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub l1_ratio: f64,
}

fn half() -> f64 {
    0.5
}

/// The penalty of lasso and elastic net.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum SparsePenalty {
    /// This one, at least 0.
    Fixed(#[schemars(range(min = 0.0))] f64),
    /// The one with the best mean R² over folds, from the smallest that leaves out every feature downwards.
    Chosen(Path),
}

/// Which penalties are tried.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Path {
    /// How the rows are cut: a number of contiguous folds, or a table.
    #[serde(default = "Folds::three")]
    pub folds: Folds,
    /// The smallest penalty tried, as a share of the one that leaves out every feature; above 0, below 1. The default is that
    /// of the authors' program glmnet for more rows than features.
    #[serde(default = "ten_thousandth")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0))]
    pub smallest_share: f64,
    /// How many are tried to each factor of ten, 1 to 1000.
    #[serde(default = "twenty")]
    #[schemars(range(min = 1, max = 1000))]
    pub per_decade: u32,
}

fn ten_thousandth() -> f64 {
    1e-4
}

fn twenty() -> u32 {
    20
}

impl Default for SparsePenalty {
    fn default() -> Self {
        Self::Chosen(Path {
            folds: Folds::three(),
            smallest_share: ten_thousandth(),
            per_decade: twenty(),
        })
    }
}

impl<'de> Deserialize<'de> for SparsePenalty {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("a number or a table such as `{ folds = 5 }`")
            .number(Self::Fixed)
            .table(Self::Chosen)
            .read(deserializer)
    }
}

impl Estimator for ElasticNet {
    fn inputs() -> &'static [InputPort] {
        FEATURES_AND_TRUTH
    }

    fn regressors(&self) -> Regressors {
        present_features()
    }

    fn has_novelty(&self) -> bool {
        true
    }

    fn mistakes_for(&self, features: usize) -> Vec<Mistake> {
        too_many(features, 1)
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(SparseTrainer::new(setup, self.alpha, self.l1_ratio))
    }
}

athermal_core::register!(ElasticNet, Estimator, "elastic_net");

/// Takes the rows of a sparse fit as Gram blocks.
#[derive(Debug)]
pub(crate) struct SparseTrainer {
    regressors: Vec<Regressor>,
    alpha: SparsePenalty,
    l1_ratio: f64,
    blocks: GramBlocks,
}

impl SparseTrainer {
    pub(crate) fn new(setup: &TrainingSetup, alpha: SparsePenalty, l1_ratio: f64) -> Self {
        let parts = match alpha {
            SparsePenalty::Fixed(_) => 1,
            SparsePenalty::Chosen(path) => path.folds.cut().parts(),
        };
        let blocks = GramBlocks::with_row_memory(setup.regressors.len(), setup.memory);
        Self {
            regressors: setup.regressors.clone(),
            alpha,
            l1_ratio,
            blocks: blocks.cut_into(parts),
        }
    }

    /// The way to the fit, its penalty chosen.
    fn settle(
        &self,
        gram: &Gram,
        scales: &[f64],
        report: &mut TrainingReport,
    ) -> Result<athermal_numerics::ElasticNet, NumericsError> {
        let deviation = gram.variances()[gram.width()].sqrt();
        let mut how = athermal_numerics::ElasticNet {
            alpha: 0.0,
            l1_ratio: self.l1_ratio,
            target_scale: if deviation > 0.0 { deviation } else { 1.0 },
        };
        let path = match self.alpha {
            SparsePenalty::Fixed(alpha) => {
                how.alpha = alpha;
                return Ok(how);
            }
            SparsePenalty::Chosen(path) => path,
        };
        let all: Vec<usize> = (0..self.regressors.len()).collect();
        let largest = how.largest_alpha(gram, &all, scales)?;
        if largest <= 0.0 {
            return Ok(how);
        }
        let alphas = logarithmic_grid(path.smallest_share * largest, largest, path.per_decade);
        let splits = self.blocks.splits(&path.folds.cut())?;
        let folds = how.cross_validated(&splits, &all, scales, &alphas)?;
        tell_moved(&self.blocks, report);
        tell_quiet(&quiet_folds(&splits), splits.len(), report);
        let means = means(&folds);
        let best = best_of(&means);
        let edge = if best == 0 {
            "; it is the smallest tried, a smaller one may be better"
        } else {
            ""
        };
        report.figure("penalty", alphas[best]);
        report.figure("penalties_tried", alphas.len());
        report.figure("smallest_penalty", alphas[0]);
        report.figure("largest_penalty", largest);
        report.figure("penalty_r2", means[best]);
        report.notes.push(format!(
            "penalty {:.3e} chosen by cross-validation from {} up to {largest:.3e}, R² {:.4}{edge}",
            alphas[best],
            alphas.len(),
            means[best]
        ));
        how.alpha = alphas[best];
        Ok(how)
    }

    fn solve(&self, report: &mut TrainingReport) -> Result<LinearPredictor, NumericsError> {
        let gram = self.blocks.total();
        let standard = Standardization::of(&gram);
        let scales = &standard.scales;
        let how = self.settle(&gram, scales, report)?;
        let all: Vec<usize> = (0..self.regressors.len()).collect();
        let fit = how.solve(&gram, &all, scales)?;
        tell_columns(&gram, |column| &self.regressors[column].name, report);
        report.figure("converged", fit.converged);
        if !fit.converged {
            report.notes.push(
                "the search did not come to its end: a larger penalty or fewer features would help"
                    .to_owned(),
            );
        }
        let kept: Vec<usize> = all
            .into_iter()
            .filter(|&j| fit.coefficients[j] != 0.0)
            .collect();
        report.figure("features_kept", kept.len());
        report.figure("features", self.regressors.len());
        report.notes.push(format!(
            "{} of {} features have a coefficient",
            kept.len(),
            self.regressors.len()
        ));
        report.in_sample_rmse = Some((fit.residual_sum_of_squares / gram.count() as f64).sqrt());
        let novelty = novelty_of(&self.blocks, &standard, &kept);
        Ok(LinearPredictor {
            regressors: kept
                .iter()
                .map(|&j| self.regressors[j].name.clone())
                .collect(),
            coefficients: kept.iter().map(|&j| fit.coefficients[j]).collect(),
            intercept: fit.intercept,
            variance: None,
            novelty,
        })
    }
}

impl Trainer for SparseTrainer {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        self.blocks.push(regressors, truth);
    }

    fn segment(&mut self) {
        self.blocks.segment();
    }

    fn summed(&mut self) -> Option<&mut dyn Summed> {
        if !self.blocks.is_in_stretches() {
            self.blocks = self.blocks.clone().in_stretches();
        }
        Some(self)
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let mut report = TrainingReport::default();
        let predictor = self.solve(&mut report).map_err(unsolved)?;
        Ok(Trained {
            predictor: Box::new(predictor),
            report,
        })
    }
}

impl Summed for SparseTrainer {
    fn sums(&mut self) -> Result<String, TrainingError> {
        sums_of(&self.blocks)
    }

    fn add_sums(&mut self, sums: &str, places: &[usize]) -> Result<(), TrainingError> {
        add_sums(&mut self.blocks, sums, places)
    }

    fn end_stretch(&mut self) {
        self.blocks.end_stretch();
    }
}
