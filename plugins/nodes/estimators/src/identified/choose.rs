//! Decides which of the orders that are asked for a model has; not how one is found of each.

use athermal_core::node::{TrainingError, TrainingReport};
use athermal_numerics::{
    InformationCriteria, NumericsError, Orders, Polynomials, PredictionError, PredictionErrorFit,
    Samples,
};

use super::{Asked, Differences};
use crate::order::{Order, Tried};
use crate::unsolved::unsolved;

/// Steps of the search times coefficients, of which many are never all settled.
const MOST_WORK: usize = 1000;

impl Asked {
    /// The model of the orders that are asked for, or of the best of them; it calls with which of how many it goes to.
    pub(super) fn fit(
        &self,
        samples: &Samples,
        spread: f64,
        report: &mut TrainingReport,
        tell: &mut dyn FnMut(usize, usize),
    ) -> Result<PredictionErrorFit, TrainingError> {
        // By default no order is open.
        let order = self.order.unwrap_or_default();
        let mut candidates = Vec::new();
        for one in order.combinations(self.given()) {
            let tried = self.differences.tried();
            candidates.extend(tried.map(|differences| (one, self.orders(&one, differences))));
        }
        if let [(_, orders)] = &candidates[..]
            && self.order.is_none()
        {
            return self
                .search(orders, self.penalty, 0)
                .fit(orders, samples, 0)
                .map_err(|error| unfit(error, samples));
        }
        let firsts = candidates.iter().map(|(_, orders)| orders.first());
        let first = firsts.max().unwrap_or(0);
        let measured = candidates.iter().map(|(_, orders)| orders.measured());
        let measured = measured.max().unwrap_or(0);
        let mut tried = Vec::new();
        let mut fits = Vec::new();
        let mut failed = None;
        // Those that others contain come before them, as a start.
        let mut in_order: Vec<usize> = (0..candidates.len()).collect();
        in_order.sort_by_key(|&nth| candidates[nth].1.coefficients());
        let mut found: Vec<Option<Result<PredictionErrorFit, NumericsError>>> =
            candidates.iter().map(|_| None).collect();
        for (place, nth) in in_order.into_iter().enumerate() {
            tell(place + 1, candidates.len());
            let orders = &candidates[nth].1;
            let known = best_contained(orders, &candidates, &found);
            // The criteria are made for fits without a penalty: with one, another coefficient could enlarge the residuals.
            let search = self.search(orders, 0.0, measured);
            found[nth] = Some(search.fit_beside(orders, samples, first, &known));
        }
        for ((candidate, orders), fit) in candidates.into_iter().zip(found.into_iter().flatten()) {
            let coefficients = orders.coefficients();
            match fit {
                Ok(fit) => {
                    let squares = fit.residual_sum_of_squares * spread * spread;
                    tried.push(Tried {
                        letters: self.letters(&order, &candidate, orders.differences),
                        coefficients,
                        starts: fit.starts,
                        figures: InformationCriteria::of(
                            fit.rows,
                            coefficients + fit.starts,
                            squares,
                        ),
                    });
                    fits.push((fit, orders));
                }
                Err(error) => failed = Some(error),
            }
        }
        let rows = samples.counted(first, measured);
        let best = order.best(rows, tried, report).map_err(|too_few| {
            let error = failed.unwrap_or(too_few);
            unfit(error, samples)
        })?;
        let (fit, orders) = fits.swap_remove(best);
        let penalised = self.penalty > 0.0 && !orders.inputs.is_empty();
        let as_compared = samples.missing() == 0 || orders.measured() == measured;
        if !penalised && orders.first() == first && as_compared {
            return Ok(fit);
        }
        if penalised {
            report.notes.push(
                "orders are compared without the penalty, with which the chosen one is fitted"
                    .to_owned(),
            );
        }
        // On all rows that it has a past for, and not only on those on which it was compared.
        let search = self.search(&orders, self.penalty, 0);
        let fit = search.fit(&orders, samples, 0);
        fit.map_err(|error| unfit(error, samples))
    }

    pub(super) fn search(&self, orders: &Orders, penalty: f64, measured: usize) -> PredictionError {
        let most = MOST_WORK / orders.coefficients().max(1);
        PredictionError {
            penalty,
            most_steps: most.clamp(20, 100),
            start_spread: START_SPREAD,
            measured,
            level: None,
        }
    }

    /// What is open of an order.
    fn letters(
        &self,
        order: &Order,
        orders: &[usize; 6],
        differences: usize,
    ) -> Vec<(&'static str, usize)> {
        let chosen = matches!(self.differences, Differences::Chosen);
        let differences = chosen.then_some(("differences", differences));
        order.letters(orders).chain(differences).collect()
    }
}

/// Of how many models that another contains the search for it begins too.
const MOST_CONTAINED: usize = 2;

/// The best of those fits whose models a model of these orders contains.
fn best_contained(
    orders: &Orders,
    candidates: &[([usize; 6], Orders)],
    found: &[Option<Result<PredictionErrorFit, NumericsError>>],
) -> Vec<Polynomials> {
    let fits = candidates.iter().zip(found);
    let contained = fits.filter(|((_, other), _)| orders.contains(other));
    let mut fits: Vec<&PredictionErrorFit> = contained
        .filter_map(|(_, fit)| fit.as_ref()?.as_ref().ok())
        .collect();
    fits.sort_by(|a, b| {
        a.residual_sum_of_squares
            .total_cmp(&b.residual_sum_of_squares)
    });
    let best = fits.into_iter().take(MOST_CONTAINED);
    best.map(|fit| fit.model.clone()).collect()
}

/// The largest standard deviation, about rest, of what all filters give where a piece begins, in spreads of the truth, which the
/// truths that are fitted are in. That of filters that do not go along is at most 1; twice the square leaves room for some that do,
/// and none for filters that are large and cancel out.
const START_SPREAD: f64 = std::f64::consts::SQRT_2;

/// Why samples allow no fit: those that count are fewer than all, since others are the past that they are predicted from.
fn unfit(error: NumericsError, samples: &Samples) -> TrainingError {
    match error {
        NumericsError::TooFewRows { needed, found } => TrainingError::Unsolvable {
            reason: format!(
                "{found} of {} rows have all the past that these orders look back on, and at least {needed} are needed: {} would help",
                samples.count(),
                if samples.missing() > samples.count() {
                    "at most steps there is no truth, so that an `every` as long as truths are apart"
                } else {
                    "smaller orders, or more rows without gaps,"
                }
            ),
        },
        error => unsolved(error),
    }
}
