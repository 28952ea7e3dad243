//! Least squares with a penalty on absolute coefficients, on normal equations. Decides which coefficients are not 0, and finds
//! them exactly; does not decide how large the penalty is.

use crate::normal_equations::Problem;
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

/// A column whose share that those in use cannot explain is below this is a combination of them.
const DEPENDENT: f64 = 1e-13;
/// A slope beyond the threshold by less than this share of the deviations of column and target is rounding.
const ROUNDING: f64 = 1e-12;
/// More than so many changes per column are no progress.
const MOST_CHANGES: usize = 50;

/// Minimises `1/(2n) wᵀGw − cᵀw/n + τ Σ|w_j| + δ/2 Σ w_j²` by changing one member of the set of coefficients that are not 0 at a
/// time (Osborne, Presnell and Turlach 2000; Lee, Battle, Raina and Ng 2007): with their signs given they solve a linear system,
/// and on the way to its solution the first that would change its sign leaves.
pub(crate) struct ActiveSet<'a> {
    problem: &'a Problem,
    rows: f64,
    /// The coefficients; the next search starts from them.
    pub(crate) weights: Vec<f64>,
    /// Those that may differ from 0, in the order in which they came.
    used: Vec<usize>,
    signs: Vec<f64>,
    /// Those that the others in use stand for.
    refused: Vec<bool>,
    /// Less the penalty's, the slopes of the objective, downwards.
    slopes: Vec<f64>,
}

/// What to do with a column that came last.
enum Step {
    /// Go to these weights of the columns in use.
    To(Vec<f64>),
    /// It is the combination of the others with these weights.
    Dependent(Vec<f64>),
}

impl<'a> ActiveSet<'a> {
    pub(crate) fn new(problem: &'a Problem, rows: f64) -> Self {
        let order = problem.target.len();
        Self {
            weights: vec![0.0; order],
            used: Vec::new(),
            signs: vec![0.0; order],
            refused: vec![false; order],
            slopes: vec![0.0; order],
            problem,
            rows,
        }
    }

    /// Goes to the minimum for a threshold and a damping; whether it got there.
    pub(crate) fn run(&mut self, threshold: f64, damping: f64) -> bool {
        let most = MOST_CHANGES * (self.weights.len() + 1);
        self.refused.fill(false);
        let mut changes = 0;
        let mut settled = self.used.is_empty();
        loop {
            while !settled {
                changes += 1;
                if changes > most {
                    return false;
                }
                settled = self.approach(threshold, damping);
            }
            let Some(next) = self.steepest(threshold, damping) else {
                return true;
            };
            self.used.push(next);
            self.signs[next] = self.slopes[next].signum();
            settled = false;
        }
    }

    /// The column outside whose slope is furthest beyond the threshold.
    fn steepest(&mut self, threshold: f64, damping: f64) -> Option<usize> {
        self.find_slopes(damping);
        let deviation = (self.problem.spread / self.rows).sqrt();
        let beyond = |j: usize| {
            let own = (self.problem.gram[(j, j)] / self.rows).sqrt();
            (self.slopes[j].abs() - threshold) / (own * deviation)
        };
        (0..self.weights.len())
            .filter(|&j| !self.refused[j] && !self.used.contains(&j) && beyond(j) > ROUNDING)
            .max_by(|&a, &b| beyond(a).total_cmp(&beyond(b)))
    }

    fn find_slopes(&mut self, damping: f64) {
        for (j, slope) in self.slopes.iter_mut().enumerate() {
            let explained: f64 = self
                .used
                .iter()
                .map(|&k| self.problem.gram[(j, k)] * self.weights[k])
                .sum();
            *slope = (self.problem.target[j] - explained) / self.rows - damping * self.weights[j];
        }
    }

    /// Goes towards the solution for the present signs until one changes; whether it was reached.
    fn approach(&mut self, threshold: f64, damping: f64) -> bool {
        match self.step(threshold, damping) {
            Step::To(goal) => {
                // Without a threshold a sign means nothing.
                let crosses = |at: usize| {
                    let (from, to) = (self.weights[self.used[at]], goal[at]);
                    let sign = self.signs[self.used[at]];
                    (threshold > 0.0 && to * sign <= 0.0).then(|| (at, from / (from - to)))
                };
                let first = (0..goal.len())
                    .filter_map(crosses)
                    .min_by(|a, b| a.1.total_cmp(&b.1));
                let part = first.map_or(1.0, |(_, part)| if part > 0.0 { part } else { 0.0 });
                for (&j, to) in self.used.iter().zip(&goal) {
                    if first.is_some() {
                        self.weights[j] += part * (to - self.weights[j]);
                    } else {
                        self.weights[j] = *to;
                    }
                }
                if let Some((at, _)) = first {
                    self.leave(at);
                }
                first.is_none()
            }
            Step::Dependent(combination) => {
                let last = self.used.len() - 1;
                let sign = self.signs[self.used[last]];
                // In this direction nothing changes but the penalty, which falls until one of the others is 0.
                let reaches = |at: usize| {
                    let rate = sign * combination[at];
                    let distance = self.weights[self.used[at]] / rate;
                    (distance >= 0.0 && distance.is_finite()).then_some((at, distance))
                };
                let first = (0..last)
                    .filter_map(reaches)
                    .min_by(|a, b| a.1.total_cmp(&b.1));
                match first {
                    Some((at, distance)) if threshold > 0.0 => {
                        for (&j, part) in self.used.iter().zip(&combination) {
                            self.weights[j] -= sign * distance * part;
                        }
                        self.weights[self.used[last]] = sign * distance;
                        self.refused[self.used[at]] = true;
                        self.leave(at);
                        false
                    }
                    _ => {
                        self.refused[self.used[last]] = true;
                        self.leave(last);
                        true
                    }
                }
            }
        }
    }

    fn leave(&mut self, at: usize) {
        let gone = self.used.remove(at);
        self.weights[gone] = 0.0;
        self.signs[gone] = 0.0;
    }

    /// The solution for the present signs.
    fn step(&self, threshold: f64, damping: f64) -> Step {
        let order = self.used.len();
        let gram = &self.problem.gram;
        let roots: Vec<f64> = self
            .used
            .iter()
            .map(|&j| (gram[(j, j)] / self.rows + damping).sqrt())
            .collect();
        let scaled = |i: usize, j: usize| {
            let value = gram[(self.used[i], self.used[j])] / self.rows;
            value / (roots[i] * roots[j])
        };
        let matrix = |order: usize| {
            Mat::from_fn(order, order, |i, j| if i == j { 1.0 } else { scaled(i, j) })
        };
        let solved = |order: usize, target: &dyn Fn(usize) -> f64| {
            let factor = matrix(order).llt(Side::Lower).ok()?;
            let own = factor.L()[(order - 1, order - 1)];
            let mut solution = Mat::from_fn(order, 1, |i, _| target(i));
            factor.solve_in_place(solution.as_mut());
            let solution: Vec<f64> = (0..order).map(|i| solution[(i, 0)]).collect();
            let sound = own * own > DEPENDENT && solution.iter().all(|w| w.is_finite());
            sound.then_some(solution)
        };
        let target = |i: usize| {
            let j = self.used[i];
            (self.problem.target[j] / self.rows - threshold * self.signs[j]) / roots[i]
        };
        if let Some(solution) = solved(order, &target) {
            return Step::To(solution.iter().zip(&roots).map(|(w, r)| w / r).collect());
        }
        let last = order - 1;
        let combination = match last {
            0 => None,
            _ => solved(last, &|i| scaled(i, last)),
        };
        let combination = combination.unwrap_or_else(|| vec![0.0; last]);
        Step::Dependent(
            combination
                .iter()
                .zip(&roots)
                .map(|(a, r)| a * roots[last] / r)
                .collect(),
        )
    }
}
