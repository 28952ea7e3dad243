//! Decides how many of the lags of a linear model are used, where their number is left open; not how the chosen ones are fitted.

use athermal_core::node::{Mistake, Regressor, TrainingError, TrainingReport};
use athermal_core::time::Duration;
use athermal_numerics::{GramBlocks, InformationCriteria, LeastSquares};

use crate::order::{Order, Tried};
use crate::unsolved::unsolved;

/// How many of the first lags are compared.
#[derive(Debug, Clone)]
pub(crate) struct LagOrder {
    order: Order,
    lags: Vec<Duration>,
    feature_lags: Vec<Duration>,
}

impl LagOrder {
    /// For a model with lags of the truth, and maybe of features.
    pub(crate) fn new(order: Order, lags: &[Duration], feature_lags: &[Duration]) -> Self {
        Self {
            order,
            lags: lags.to_vec(),
            feature_lags: feature_lags.to_vec(),
        }
    }

    pub(crate) fn mistakes(&self, selects: bool) -> Vec<Mistake> {
        let of_features = (!self.feature_lags.is_empty()).then_some(self.feature_lags.len());
        let most = [Some(self.lags.len()), of_features, None, None, None, None];
        let mut mistakes = self.order.mistakes(most);
        if selects {
            let message = "either `order` or `selection` says which lags are used";
            let mistake = Mistake::at("order", message).help("leave one of them out");
            mistakes.push(mistake);
        }
        mistakes
    }

    /// The columns of the best order by least squares, whatever the solver: the criteria are made for them, and with a penalty
    /// another coefficient may enlarge the residuals. All that were compared go into the report.
    pub(crate) fn run(
        &self,
        regressors: &[Regressor],
        blocks: &GramBlocks,
        scales: &[f64],
        report: &mut TrainingReport,
    ) -> Result<Vec<usize>, TrainingError> {
        let gram = blocks.total();
        let rows = usize::try_from(gram.count()).unwrap_or(usize::MAX);
        let given = [self.lags.len(), self.feature_lags.len(), 0, 0, 0, 0];
        let mut tried = Vec::new();
        let mut all = Vec::new();
        for orders in self.order.combinations(given) {
            let columns = self.columns(regressors, orders[0], orders[1]);
            if columns.is_empty() {
                continue;
            }
            let fit = LeastSquares::ordinary()
                .solve(&gram, &columns, scales, blocks.rows())
                .map_err(unsolved)?;
            let coefficients = columns.len() + 1;
            let figures = InformationCriteria::of(rows, coefficients, fit.residual_sum_of_squares);
            tried.push(Tried {
                letters: self.order.letters(&orders).collect(),
                coefficients,
                starts: 0,
                figures,
            });
            all.push(columns);
        }
        if tried.is_empty() {
            return Err(TrainingError::Unsolvable {
                reason: format!(
                    "none of the lags to compare has a value in enough of the {rows} rows"
                ),
            });
        }
        let best = self.order.best(rows, tried, report).map_err(unsolved)?;
        Ok(all.swap_remove(best))
    }

    /// The columns of the first lags of the truth and of the features.
    fn columns(&self, regressors: &[Regressor], na: usize, nb: usize) -> Vec<usize> {
        let (lags, feature_lags) = (&self.lags[..na], &self.feature_lags[..nb]);
        let used = regressors.iter().enumerate().filter(|(_, regressor)| {
            let first = if regressor.of_truth {
                lags
            } else {
                feature_lags
            };
            first.contains(&regressor.lag)
        });
        used.map(|(column, _)| column).collect()
    }
}
