//! Decides which coefficients make the one-step predictions of a model err least; not where the search starts.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

use super::anywhere::Beginning;
use super::missing::Weighted;
use super::residuals::Left;
use super::segment::{Counted, Segment};
use super::{Polynomials, Samples};
use crate::GramBlocks;

/// What a step of the polishing promises that is the last, as a share of the sum.
const SETTLED: f64 = 1e-22;
/// How much smaller the sum of squares must become for a step to be worth another, as a share of it.
pub(super) const TOLERANCE: f64 = 1e-14;
/// A search that ends while it still gains more than this has not converged.
const SMALL: f64 = 1e-6;
const MOST_DAMPING: f64 = 1e12;
/// Sums that differ by this share are the same but for rounding.
const SAME: f64 = 1e-12;
/// Steps by the gradient alone at the end.
const POLISHING: usize = 4;
/// The share of a step of the search at which a polynomial that it would make unstable counts as held: a whole one also makes
/// others so, of which the best lies inside.
const SHARE: f64 = 1e-3;

/// Minimises the sum of squared one-step prediction errors, plus a penalty on the coefficients of `B` and on how far from rest
/// filters begin, by damped Gauss–Newton
/// steps (Levenberg 1944, Marquardt 1963; Ljung 1999, section 10.2) among stable models. Where a filter has more than one pole, or
/// values are missing and the noise has a longer memory, it is searched from several starts, among them the best model with a
/// coefficient less, and the best end is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictionError {
    /// What is added to the sum: so many times the squares of the coefficients of `B`.
    pub penalty: f64,
    /// The most steps; where something is known of starts, of each of two searches.
    pub most_steps: usize,
    /// How far what filters gave before a segment may together be off from what they had given had their inputs always been what
    /// they are first, as a standard deviation above 0. Each is taken to be as far off as it is at samples anywhere, but that their
    /// squares are together no more than the square of this. Infinite where nothing is known of it.
    pub start_spread: f64,
    /// Of a segment of which values are missing nothing is counted before so many of them in a row are known, or as many as the
    /// model needs, whichever are more: models of several orders that are to be compared need the same.
    pub measured: usize,
    /// The level, where it is not looked for but given.
    pub level: Option<f64>,
}

impl Default for PredictionError {
    fn default() -> Self {
        Self {
            penalty: 0.0,
            most_steps: 100,
            start_spread: f64::INFINITY,
            measured: 0,
            level: None,
        }
    }
}

/// A model and how well it predicts.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictionErrorFit {
    /// The model.
    pub model: Polynomials,
    /// What was made least, without the penalty. Where values are missing that is the sum of squared prediction errors, each over
    /// its variance in that of an innovation, times the geometric mean of these variances, and stands for the likelihood as the sum
    /// of squares does elsewhere.
    pub residual_sum_of_squares: f64,
    /// The sum of the squared prediction errors themselves: the same where nothing is missing.
    pub squared_errors: f64,
    /// The geometric mean of the variances of predictions, in that of an innovation: 1 where nothing is missing.
    pub variance_ratio: f64,
    /// Residuals that were counted.
    pub rows: usize,
    /// How many samples of each segment were not.
    pub first: usize,
    /// How many values in a row had to be known before.
    pub measured: usize,
    /// How many values that filters gave before the segments were found beside the coefficients, as far as samples tell them.
    pub starts: usize,
    /// Where the filter of each input begins in a run; nothing where they are taken to be at rest.
    pub beginnings: Vec<Beginning>,
    /// What the square of each of those values counted as much as.
    pub(super) start_counts: Vec<f64>,
    /// Steps of the search, with those that went before to find what starts count.
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
        self.residual_sum_of_squares / left as f64 / self.variance_ratio
    }
}

/// A model beside others.
#[derive(Debug)]
pub(super) struct Judged {
    pub(super) model: Polynomials,
    pub(super) left: Left,
    /// What is made least.
    pub(super) sum: f64,
}

impl PredictionError {
    /// The damping, in the order of [`flat`](Polynomials::flat), of a search that takes what is given for given.
    pub(super) fn given(&self, model: &Polynomials) -> Vec<f64> {
        let mut damping = vec![0.0; model.flat().len()];
        if let (Some(_), Some(level), 0) = (self.level, damping.first_mut(), model.differences) {
            *level = f64::INFINITY;
        }
        damping
    }

    pub(super) fn judged(
        &self,
        model: Polynomials,
        samples: &Samples,
        counted: &Counted,
    ) -> Judged {
        let b = model.flat().into_iter().zip(model.penalised());
        let squares: f64 = b.filter(|(_, of_b)| *of_b).map(|(b, _)| b * b).sum();
        let left = Left::by(&model, samples, counted);
        Judged {
            sum: left.sum() + self.penalty * squares * left.mean,
            model,
            left,
        }
    }

    pub(super) fn search(
        &self,
        start: Judged,
        samples: &Samples,
        counted: &Counted,
        radius: f64,
        tolerance: f64,
    ) -> (Judged, usize, bool) {
        let mut at = start;
        let given = self.given(&at.model).into_iter();
        let mut damping: Vec<f64> = given.map(|of| of.max(1e-3)).collect();
        let mut gained = f64::INFINITY;
        for step in 0..self.most_steps {
            let (hessian, gradient) = self.normal_equations(&at, samples, counted);
            let mut solvable = false;
            loop {
                let tried =
                    descend(&hessian, &gradient, &damping).map(|change| at.model.moved(&change));
                solvable |= tried.is_some();
                // What would become unstable is held back alone: the others go on, and find the best beside it.
                let unstable = tried.as_ref().map(|tried| tried.unstable(radius));
                let unstable = unstable.filter(|of| of.contains(&true));
                let found = tried.filter(|_| unstable.is_none());
                let found = found.map(|tried| self.judged(tried, samples, counted));
                if let Some(tried) = found.filter(|tried| tried.sum <= at.sum) {
                    gained = at.sum - tried.sum;
                    at = tried;
                    for of in &mut damping {
                        *of = (*of / 10.0).max(1e-12);
                    }
                    if gained <= tolerance * at.sum {
                        return (at, step + 1, true);
                    }
                    break;
                }
                for (nth, of) in damping.iter_mut().enumerate() {
                    if unstable.as_ref().is_none_or(|unstable| unstable[nth]) {
                        *of *= 10.0;
                    }
                }
                if damping.iter().all(|of| *of > MOST_DAMPING) {
                    return (at, step, solvable);
                }
            }
        }
        let converged = gained <= SMALL * at.sum;
        (at, self.most_steps, converged)
    }

    /// A few whole steps more, with what is held back from instability at its edge. Where the sum hardly changes it is known less
    /// exactly than its gradient, by which they go.
    pub(super) fn polished(
        &self,
        mut at: Judged,
        samples: &Samples,
        counted: &Counted,
        radius: f64,
    ) -> Judged {
        let most = at.sum * (1.0 + SAME);
        for _ in 0..POLISHING {
            let (mut hessian, mut gradient) = self.normal_equations(&at, samples, counted);
            let given = self.given(&at.model);
            let Some(held) = held(&at.model, &hessian, &gradient, radius, given) else {
                break;
            };
            let mut from = at.model.clone();
            if held.contains(&true) {
                let edge = self.judged(from.on_edge(&held, radius), samples, counted);
                (hessian, gradient) = self.normal_equations(&edge, samples, counted);
                from = edge.model;
            }
            let damping = held
                .iter()
                .map(|&held| if held { f64::INFINITY } else { 0.0 });
            let Some(change) = descend(&hessian, &gradient, &damping.collect::<Vec<_>>()) else {
                break;
            };
            let tried = from.moved(&change);
            if tried.unstable(radius).contains(&true) {
                break;
            }
            let tried = self.judged(tried, samples, counted);
            // Written so that NaN fails.
            let as_good = tried.sum <= most;
            if !as_good {
                break;
            }
            at = tried;
            let gain: f64 = change
                .iter()
                .zip(&gradient)
                .map(|(by, slope)| by * slope)
                .sum();
            if gain <= SETTLED * most {
                break;
            }
        }
        at
    }

    /// `JᵀJ` and `Jᵀε`, with the penalty.
    pub(super) fn normal_equations(
        &self,
        at: &Judged,
        samples: &Samples,
        counted: &Counted,
    ) -> (Mat<f64>, Vec<f64>) {
        let Judged { model, left, .. } = at;
        let flat = model.flat();
        let count = flat.len();
        let mut rows = GramBlocks::with_row_memory(count, 0);
        let weighted = Weighted::new(model, samples, counted, &left.starts, left.mean);
        let mut followed = Mat::<f64>::zeros(count, count);
        for (nth, segment) in samples.segments().enumerate() {
            let segment = Segment::new(model, samples, segment, counted);
            let (start, free) = (&left.starts[nth].values, left.free(nth));
            let residuals = left.residuals[nth].len();
            let lasting = free.lasting(residuals);
            let mut across = Mat::<f64>::zeros(count, free.starts());
            let mut row = 0;
            let take = |residual: f64, by: &[f64]| {
                rows.push(by, residual);
                if row < lasting {
                    free.add_products(row, by, &mut across);
                }
                row += 1;
            };
            match &weighted {
                Some(weighted) => weighted.derivatives(nth, &segment, start, take),
                None => segment.derivatives(start, take),
            }
            if let Some(by_start) = free.followed(&across, residuals) {
                followed += by_start;
            }
        }
        let moments = rows.total().moments_about(&vec![0.0; count + 1]);
        let mut gradient: Vec<f64> = (0..count).map(|i| moments[(count, i)]).collect();
        // The starts of the segments follow where the coefficients go.
        let mut hessian = moments.submatrix(0, 0, count, count) - followed;
        let of_b = model.penalised();
        let penalty = self.penalty * left.mean;
        for i in (0..count).filter(|&i| of_b[i]) {
            hessian[(i, i)] += penalty;
            gradient[i] += penalty * flat[i];
        }
        if let Some(weighted) = weighted {
            let rows = left.residuals.iter().map(Vec::len).sum::<usize>().max(1);
            let square = left.squares / rows as f64;
            weighted.add(&mut hessian, &mut gradient, square, at.sum - left.squares);
        }
        (hessian, gradient)
    }
}

/// The radius inside of which a filter forgets its start within these samples: from segments of `N` samples a root nearer than
/// `1/N` to the unit circle cannot be distinguished from one on it, and through it every error of the model adds up.
pub(super) fn remembered(samples: &Samples) -> f64 {
    1.0 - 1.0 / samples.longest().max(2) as f64
}

/// The step that `(H + diag λ diag H) δ = g` asks for, 0 where the damping `λ` is beyond all bounds; none where it has no solution.
fn descend(hessian: &Mat<f64>, gradient: &[f64], damping: &[f64]) -> Option<Vec<f64>> {
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

/// Which coefficients, in the order of [`flat`](Polynomials::flat), are of a polynomial that would be better outside of the
/// bound of stability, or that the samples tell so little of that it could as well be there; and those whose damping is beyond all
/// bounds from the beginning.
pub(super) fn held(
    model: &Polynomials,
    hessian: &Mat<f64>,
    gradient: &[f64],
    radius: f64,
    mut damping: Vec<f64>,
) -> Option<Vec<bool>> {
    loop {
        let change = descend(hessian, gradient, &damping)?;
        let share: Vec<f64> = change.iter().map(|by| SHARE * by).collect();
        let moved = model.moved(&share);
        let held_before = damping.clone();
        for (of, unstable) in damping.iter_mut().zip(moved.unstable(radius)) {
            if unstable {
                *of = f64::INFINITY;
            }
        }
        if damping == held_before {
            return Some(damping.iter().map(|&of| of > 0.0).collect());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{InputOrders, Orders};
    use super::*;

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
        let (model, steps, converged) = search.search(
            search.judged(start.clone(), &samples, &Counted::from(0)),
            &samples,
            &Counted::from(0),
            0.9,
            TOLERANCE,
        );
        assert_eq!((model.model, steps, converged), (start, 0, false));
    }
}
