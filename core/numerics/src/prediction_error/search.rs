//! Decides which coefficients make the one-step predictions of a model err least; not where the search starts.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

use super::initial;
use super::precision::held;
use super::residuals::{Counted, Left, Products, Segment, counted_from, inverse_with, left};
use super::{InformationCriteria, Orders, Polynomials, Samples};
use crate::checks::check_penalty;
use crate::{GramBlocks, NumericsError};

/// How much smaller the sum of squares must become for a step to be worth another, as a share of it.
const TOLERANCE: f64 = 1e-14;
/// A search that ends while it still gains more than this has not converged.
const SMALL: f64 = 1e-6;
const MOST_DAMPING: f64 = 1e12;
/// Sums that differ by this share are the same but for rounding.
const SAME: f64 = 1e-12;
/// Steps by the gradient alone at the end.
const POLISHING: usize = 4;

/// Minimises the sum of squared one-step prediction errors, plus a penalty on the coefficients of `B`, by damped Gauss–Newton
/// steps (Levenberg 1944, Marquardt 1963; Ljung 1999, section 10.2) among stable models.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictionError {
    /// What is added to the sum: so many times the squares of the coefficients of `B`.
    pub penalty: f64,
    /// The most steps.
    pub most_steps: usize,
    /// The standard deviation of what filters gave before a segment about what they had given had their inputs always been what
    /// they are first; infinite where nothing is known of it.
    pub start_spread: f64,
}

impl Default for PredictionError {
    fn default() -> Self {
        Self {
            penalty: 0.0,
            most_steps: 100,
            start_spread: f64::INFINITY,
        }
    }
}

/// A model and how well it predicts.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictionErrorFit {
    /// The model.
    pub model: Polynomials,
    /// Without the penalty.
    pub residual_sum_of_squares: f64,
    /// Residuals that were counted.
    pub rows: usize,
    /// How many samples of each segment were not.
    pub first: usize,
    /// How many values that filters gave before the segments were found beside the coefficients, as far as samples tell them.
    pub starts: usize,
    /// What the square of each of them counted as much as.
    pub(super) start_counts: f64,
    /// Steps of the search.
    pub steps: usize,
    /// Whether the search ended since no step was worth it.
    pub converged: bool,
}

impl PredictionErrorFit {
    /// The variance of the innovations, for as many coefficients and starts as there are.
    #[must_use]
    pub fn variance(&self) -> f64 {
        let found = self.model.flat().len() + self.starts;
        let left = self.rows.saturating_sub(found).max(1);
        self.residual_sum_of_squares / left as f64
    }

    /// What it is worth beside others on the same rows.
    #[must_use]
    pub fn criteria(&self) -> InformationCriteria {
        let found = self.model.flat().len() + self.starts;
        InformationCriteria::of(self.rows, found, self.residual_sum_of_squares)
    }
}

impl PredictionError {
    /// Fits a model of these orders. The first `first` samples of each segment are not counted, or those before which the
    /// model lacks something, whichever are more: models of several orders that are to be compared need the same.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`], [`NumericsError::Width`] where the inputs are not those of the samples,
    /// [`NumericsError::TooFewRows`], [`NumericsError::NotFinite`].
    pub fn fit(
        &self,
        orders: &Orders,
        samples: &Samples,
        first: usize,
    ) -> Result<PredictionErrorFit, NumericsError> {
        check_penalty(self.penalty)?;
        if orders.inputs.len() != samples.width() {
            return Err(NumericsError::Width {
                expected: orders.inputs.len(),
                found: samples.width(),
            });
        }
        let first = counted_from(orders, first);
        let rows = samples.counted(first);
        let starts = samples.starts(orders, first);
        let needed = orders.coefficients() + starts + 2;
        if rows < needed {
            return Err(NumericsError::TooFewRows {
                needed: needed as u64,
                found: rows as u64,
            });
        }
        let radius = remembered(samples);
        let begin = initial::starts(orders, samples, self.penalty, radius)?;
        let counted = Counted::from(first);
        if starts == 0 || self.start_spread.is_infinite() {
            return self.best_from(begin, samples, counted, radius);
        }
        self.best_of_starts(begin, samples, counted, radius)
    }

    /// The same where something is known of starts. How large innovations are, and so what a start counts beside them, is known
    /// afterwards: it is searched with what the models to begin with leave wherever their filters begin, then once more.
    fn best_of_starts(
        &self,
        begin: Vec<Polynomials>,
        samples: &Samples,
        counted: Counted,
        radius: f64,
    ) -> Result<PredictionErrorFit, NumericsError> {
        let rows = samples.counted(counted.first) as f64;
        let with = |start: f64| Counted { start, ..counted };
        let of = |sum: f64| with(sum / rows / (self.start_spread * self.start_spread));
        let free = |model: &Polynomials| left(model, samples, with(0.0)).squares;
        let least = begin.iter().map(free).fold(f64::INFINITY, f64::min);
        let found = self.best_from(begin, samples, of(least), radius)?;
        // Of all sums the one that is least is the surest.
        let sum = left(&found.model, samples, of(least)).sum(of(least));
        self.best_from(vec![found.model], samples, of(sum), radius)
    }

    /// Searches from the best of several models.
    fn best_from(
        &self,
        starts: Vec<Polynomials>,
        samples: &Samples,
        counted: Counted,
        radius: f64,
    ) -> Result<PredictionErrorFit, NumericsError> {
        let sums = starts
            .into_iter()
            .map(|start| (self.objective(&start, samples, counted), start));
        let best = sums
            .filter(|(sum, _)| sum.is_finite())
            .min_by(|(sum, _), (other, _)| sum.total_cmp(other));
        let (_, start) = best.ok_or(NumericsError::NotFinite)?;
        let (model, steps, converged) = self.search(start, samples, counted, radius);
        let model = self.polished(model, samples, counted, radius);
        let Left { squares, told, .. } = left(&model, samples, counted);
        Ok(PredictionErrorFit {
            residual_sum_of_squares: squares,
            model,
            rows: samples.counted(counted.first),
            first: counted.first,
            starts: told.round() as usize,
            start_counts: counted.start,
            steps,
            converged,
        })
    }

    fn objective(&self, model: &Polynomials, samples: &Samples, counted: Counted) -> f64 {
        let b = model.flat().into_iter().zip(model.penalised());
        let squares: f64 = b.filter(|(_, of_b)| *of_b).map(|(b, _)| b * b).sum();
        left(model, samples, counted).sum(counted) + self.penalty * squares
    }

    fn search(
        &self,
        start: Polynomials,
        samples: &Samples,
        counted: Counted,
        radius: f64,
    ) -> (Polynomials, usize, bool) {
        let mut model = start;
        let mut least = self.objective(&model, samples, counted);
        let mut damping = vec![1e-3; model.flat().len()];
        let mut gained = f64::INFINITY;
        for step in 0..self.most_steps {
            let (hessian, gradient) = self.normal_equations(&model, samples, counted);
            let flat = model.flat();
            let mut solvable = false;
            loop {
                let tried = descend(&hessian, &gradient, &damping).map(|change| {
                    let moved: Vec<f64> =
                        flat.iter().zip(&change).map(|(at, by)| at - by).collect();
                    model.with(&moved)
                });
                solvable |= tried.is_some();
                // What would become unstable is held back alone: the others go on, and find the best beside it.
                let unstable = tried.as_ref().map(|tried| tried.unstable(radius));
                let unstable = unstable.filter(|of| of.contains(&true));
                let found = tried.filter(|_| unstable.is_none());
                let found = found.map(|tried| (self.objective(&tried, samples, counted), tried));
                if let Some((sum, tried)) = found.filter(|(sum, _)| *sum <= least) {
                    gained = least - sum;
                    (model, least) = (tried, sum);
                    for of in &mut damping {
                        *of = (*of / 10.0).max(1e-12);
                    }
                    if gained <= TOLERANCE * least {
                        return (model, step + 1, true);
                    }
                    break;
                }
                for (nth, of) in damping.iter_mut().enumerate() {
                    if unstable.as_ref().is_none_or(|unstable| unstable[nth]) {
                        *of *= 10.0;
                    }
                }
                if damping.iter().all(|of| *of > MOST_DAMPING) {
                    return (model, step, solvable);
                }
            }
        }
        (model, self.most_steps, gained <= SMALL * least)
    }

    /// A few whole steps more, with what is held back from instability at its edge. Where the sum hardly changes it is known less
    /// exactly than its gradient, by which they go.
    fn polished(
        &self,
        mut model: Polynomials,
        samples: &Samples,
        counted: Counted,
        radius: f64,
    ) -> Polynomials {
        let most = self.objective(&model, samples, counted) * (1.0 + SAME);
        for _ in 0..POLISHING {
            let (hessian, gradient) = self.normal_equations(&model, samples, counted);
            let Some(held) = held(&model, &hessian, &gradient, radius) else {
                break;
            };
            let at_edge = model.clone().on_edge(&held, radius);
            let (hessian, gradient) = self.normal_equations(&at_edge, samples, counted);
            let damping = held
                .iter()
                .map(|&held| if held { f64::INFINITY } else { 0.0 });
            let Some(change) = descend(&hessian, &gradient, &damping.collect::<Vec<_>>()) else {
                break;
            };
            let flat = at_edge.flat();
            let moved: Vec<f64> = flat.iter().zip(&change).map(|(at, by)| at - by).collect();
            let tried = at_edge.with(&moved);
            let stable = !tried.unstable(radius).contains(&true);
            // Written so that NaN fails.
            let as_good = stable && self.objective(&tried, samples, counted) <= most;
            if !as_good {
                break;
            }
            model = tried;
        }
        model
    }

    /// `JᵀJ` and `Jᵀε`, with the penalty.
    pub(super) fn normal_equations(
        &self,
        model: &Polynomials,
        samples: &Samples,
        counted: Counted,
    ) -> (Mat<f64>, Vec<f64>) {
        let flat = model.flat();
        let count = flat.len();
        let mut rows = GramBlocks::with_row_memory(count, 0);
        let starts = model.starts();
        let mut by_starts = Mat::<f64>::zeros(count, count);
        for segment in samples.segments() {
            let segment = Segment::new(model, samples, segment, counted);
            let mut own = Products::new(starts, starts);
            let mut across = Products::new(count, starts);
            segment.derivatives(&segment.start().values, |residual| {
                rows.push(residual.by, residual.value);
                own.add(residual.by_start, residual.by_start);
                across.add(residual.by, residual.by_start);
            });
            let (own, across) = (own.sums(), across.sums());
            if starts > 0
                && let Some(inverse) = inverse_with(counted, own)
            {
                by_starts += &across * inverse * across.transpose();
            }
        }
        let moments = rows.total().moments_about(&vec![0.0; count + 1]);
        let mut gradient: Vec<f64> = (0..count).map(|i| moments[(count, i)]).collect();
        // The starts of the segments follow where the coefficients go.
        let mut hessian = moments.submatrix(0, 0, count, count) - by_starts;
        let of_b = model.penalised();
        for i in (0..count).filter(|&i| of_b[i]) {
            hessian[(i, i)] += self.penalty;
            gradient[i] += self.penalty * flat[i];
        }
        (hessian, gradient)
    }
}

/// The radius inside of which a filter forgets its start within these samples: from segments of `N` samples a root nearer than
/// `1/N` to the unit circle is not told from one on it, and through it every error of the model adds up.
pub(super) fn remembered(samples: &Samples) -> f64 {
    1.0 - 1.0 / samples.longest().max(2) as f64
}

/// The step that `(H + diag λ diag H) δ = g` asks for, 0 where the damping `λ` is beyond all bounds; none where it has no solution.
pub(super) fn descend(hessian: &Mat<f64>, gradient: &[f64], damping: &[f64]) -> Option<Vec<f64>> {
    let count = gradient.len();
    let scales: Vec<f64> = (0..count).map(|i| hessian[(i, i)].sqrt()).collect();
    let scales: Vec<f64> = scales
        .iter()
        .map(|&s| if s > 0.0 { s } else { 1.0 })
        .collect();
    let held = |i: usize| damping[i] > MOST_DAMPING;
    let scaled = Mat::from_fn(count, count, |i, j| match (i == j, held(i) || held(j)) {
        (true, true) => 1.0,
        (false, true) => 0.0,
        (true, false) => hessian[(i, j)] / (scales[i] * scales[j]) + damping[i],
        (false, false) => hessian[(i, j)] / (scales[i] * scales[j]),
    });
    let right = |i: usize| {
        if held(i) {
            0.0
        } else {
            gradient[i] / scales[i]
        }
    };
    let right = Mat::from_fn(count, 1, |i, _| right(i));
    let solved = scaled.llt(Side::Lower).ok()?.solve(&right);
    let step: Vec<f64> = (0..count).map(|i| solved[(i, 0)] / scales[i]).collect();
    step.iter().all(|by| by.is_finite()).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::InputOrders;

    #[test]
    fn a_search_of_which_no_step_can_be_solved_has_not_converged() {
        // The squares of the input are no numbers.
        let mut samples = Samples::new(1);
        for sample in 0..20 {
            let sign = if sample % 3 == 0 { 1.0 } else { -1.0 };
            samples.push([sign * 1e200], sign);
        }
        let input = InputOrders {
            nb: 1,
            nf: 0,
            nk: 0,
        };
        let start = Polynomials::zero(&Orders {
            inputs: vec![input],
            ..Orders::default()
        });
        let search = PredictionError::default();
        let (model, steps, converged) =
            search.search(start.clone(), &samples, Counted::from(0), 0.9);
        assert_eq!((model, steps, converged), (start, 0, false));
    }
}
