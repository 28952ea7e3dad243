//! Robust regression. Decides how coefficients are found that outliers cannot pull; does not decide what is done with the
//! outliers.

use crate::checks::{check_columns, check_parameter, check_penalty, check_scale};
use crate::{Gram, NumericsError, Rows, median, robust_deviation};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

const MOST_STEPS: usize = 100;
/// Where no more than this share of the objective can be gained, one step more is the last.
const NEAR: f64 = 1e-12;
/// Where no more than this share of the objective is promised, rounding may be why no step leads down.
const ROUNDING: f64 = 1e-6;
/// From so many standard deviations on an error is an outlier's.
const OUTLYING: f64 = 3.0;
/// Rows per step of the sums.
const STEP_ROWS: usize = 256;

/// Minimises `Σ (σ + H((y − b₀ − xᵀb)/σ) σ) + α Σ(s_j b_j)²` over the coefficients `b`, `b₀` and the scale `σ`, with
/// `H(z) = z²` up to `|z| = ε` and `2ε|z| − ε²` beyond (Huber 1981, section 7.7; the same as `HuberRegressor` of scikit-learn).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Huber {
    /// From how many scales on an error counts by its size, at least 1.
    pub epsilon: f64,
    /// The penalty `α` on the scaled coefficients.
    pub alpha: f64,
}

/// A robust linear model on the original scale of its columns.
#[derive(Debug, Clone, PartialEq)]
pub struct HuberFit {
    /// One coefficient per column that was asked for.
    pub coefficients: Vec<f64>,
    /// The intercept in target units.
    pub intercept: f64,
    /// The scale `σ` of the minimum, in target units: for normal errors below their standard deviation, at `ε = 1.35` 0.68 of it.
    pub scale: f64,
    /// How many errors are beyond `ε` scales, so that they count by their size.
    pub beyond: u64,
    /// The standard deviation of the errors by the median of their sizes, which outliers hardly move, in target units.
    pub deviation: f64,
    /// The same of the target about its median.
    pub target_deviation: f64,
    /// How many errors are beyond three such deviations; of normal ones 0.3 % are.
    pub outliers: u64,
    /// The sum of the squared residuals of all rows.
    pub residual_sum_of_squares: f64,
    /// The minimum that was found.
    pub objective: f64,
    /// Whether it cannot be lowered any more.
    pub converged: bool,
}

impl Huber {
    /// Fits `columns` of the rows, each centred by its mean and divided by its scale. All rows count alike: there are none here that
    /// weigh more than others.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`], [`NumericsError::Column`], [`NumericsError::RepeatedColumn`], [`NumericsError::Scale`],
    /// [`NumericsError::TooFewRows`] for fewer than two rows, [`NumericsError::NotFinite`].
    pub fn solve(
        &self,
        rows: Rows<'_>,
        columns: &[usize],
        means: &[f64],
        scales: &[f64],
    ) -> Result<HuberFit, NumericsError> {
        let fine = self.epsilon >= 1.0 && self.epsilon.is_finite();
        check_parameter("epsilon", self.epsilon, fine, "1 or more")?;
        check_penalty(self.alpha)?;
        check_columns(columns, rows.width().min(means.len()).min(scales.len()))?;
        for &column in columns {
            check_scale(column, scales[column])?;
        }
        if rows.count() < 2 {
            return Err(NumericsError::TooFewRows {
                needed: 2,
                found: rows.count(),
            });
        }
        for (_, _, weight) in rows.iter() {
            check_parameter("weight", weight, weight == 1.0, "1 for every row")?;
        }
        let mut descent = Descent::new(self, rows, columns, means, scales);
        if !descent.residuals.iter().all(|r| r.is_finite()) {
            return Err(NumericsError::NotFinite);
        }
        let mut reached = Step::Down;
        for _ in 0..MOST_STEPS {
            reached = descent.step()?;
            if reached != Step::Down {
                break;
            }
        }
        Ok(descent.end(reached == Step::End))
    }
}

/// A model and what it leaves of each row. The scale is always the best for the residuals.
struct Descent<'a> {
    how: &'a Huber,
    rows: Rows<'a>,
    columns: &'a [usize],
    means: &'a [f64],
    scales: &'a [f64],
    /// The scaled coefficients and, last, the value at the means.
    weights: Vec<f64>,
    residuals: Vec<f64>,
    sigma: f64,
    objective: f64,
    /// A scale below this is that of rounding.
    least_sigma: f64,
}

impl<'a> Descent<'a> {
    fn new(
        how: &'a Huber,
        rows: Rows<'a>,
        columns: &'a [usize],
        means: &'a [f64],
        scales: &'a [f64],
    ) -> Self {
        let targets: Vec<f64> = rows.iter().map(|(_, y, _)| y).collect();
        let mean = targets.iter().sum::<f64>() / targets.len() as f64;
        let residuals: Vec<f64> = targets.iter().map(|y| y - mean).collect();
        let size = targets.iter().fold(0.0_f64, |size, y| size.max(y.abs()));
        let mut weights = vec![0.0; columns.len() + 1];
        weights[columns.len()] = mean;
        let mut descent = Self {
            how,
            rows,
            columns,
            means,
            scales,
            weights,
            residuals,
            sigma: 0.0,
            objective: 0.0,
            least_sigma: 10.0 * f64::EPSILON * size.max(f64::MIN_POSITIVE),
        };
        descent.sigma = descent.scale_of(&descent.residuals);
        descent.objective = descent.value(&descent.residuals, descent.sigma, &descent.weights);
        descent
    }

    /// The scale that is best for these residuals, from above: `σ² = Σ r² / (n − mε²)` over those within, with the `m`
    /// beyond.
    fn scale_of(&self, residuals: &[f64]) -> f64 {
        let n = residuals.len() as f64;
        let squares: f64 = residuals.iter().map(|r| r * r).sum();
        let mut sigma = (squares / n).sqrt();
        loop {
            let limit = self.how.epsilon * sigma;
            let (mut squares, mut beyond) = (0.0, 0.0);
            for r in residuals {
                if r.abs() <= limit {
                    squares += r * r;
                } else {
                    beyond += 1.0;
                }
            }
            let left = n - beyond * self.how.epsilon * self.how.epsilon;
            let next = (squares / left).sqrt();
            if next <= self.least_sigma {
                return self.least_sigma;
            }
            let falls = next < sigma * (1.0 - 1e-15);
            // One that is not a number does not fall either.
            if !falls {
                return sigma.max(self.least_sigma);
            }
            sigma = next;
        }
    }

    fn value(&self, residuals: &[f64], sigma: f64, weights: &[f64]) -> f64 {
        let epsilon = self.how.epsilon;
        let loss = |r: &f64| {
            if r.abs() <= epsilon * sigma {
                sigma + r * r / sigma
            } else {
                sigma + 2.0 * epsilon * r.abs() - epsilon * epsilon * sigma
            }
        };
        let coefficients = &weights[..self.columns.len()];
        let squares: f64 = coefficients.iter().map(|w| w * w).sum();
        residuals.iter().map(loss).sum::<f64>() + self.how.alpha * squares
    }

    /// One step downhill. Newton's method where it leads down at once, and else the least squares with outliers weighed down, which
    /// always do, though slowly (Huber 1981, section 7.8).
    fn step(&mut self) -> Result<Step, NumericsError> {
        let mut last = None;
        let mut most_promised = 0.0;
        for curvature in [Curvature::Newton, Curvature::Weighted] {
            let (matrix, downhill) = self.second_order(curvature)?;
            let direction = solved(&matrix, &downhill)?;
            // The objective falls by 2/σ of this to first order.
            let slope: f64 = direction.iter().zip(&downhill).map(|(d, g)| d * g).sum();
            let promised = 2.0 / self.sigma * slope;
            let near = if last.is_some() { ROUNDING } else { NEAR };
            if promised <= near * self.objective {
                // Where hardly any rows are within, Newton's matrix says nothing, and promises nothing anywhere.
                last.get_or_insert(direction);
                continue;
            }
            if self.descend(&direction) {
                return Ok(Step::Down);
            }
            most_promised = promised.max(most_promised);
        }
        if most_promised > ROUNDING * self.objective {
            return Ok(Step::Stuck);
        }
        if let Some(direction) = last {
            // Too near for the objective to resolve, and so near that Newton's step ends there; but where rows hardly determine a
            // direction, a step that promises nothing may be so long that it leads up.
            let most = self.objective * (1.0 + NEAR);
            self.go_where(&direction, |reached| reached <= most);
        }
        Ok(Step::End)
    }

    /// Goes along a direction, halving the way until it leads down.
    fn descend(&mut self, direction: &[f64]) -> bool {
        let mut way = direction.to_vec();
        for _ in 0..7 {
            let objective = self.objective;
            if self.go_where(&way, |reached| reached < objective) {
                return true;
            }
            way.iter_mut().for_each(|step| *step *= 0.5);
        }
        false
    }

    /// Goes a way if the objective that it leads to is good enough; whether it did.
    fn go_where(&mut self, way: &[f64], good: impl Fn(f64) -> bool) -> bool {
        let before = (self.weights.clone(), self.residuals.clone());
        let (sigma, objective) = (self.sigma, self.objective);
        self.go(way);
        if good(self.objective) {
            return true;
        }
        (self.weights, self.residuals) = before;
        (self.sigma, self.objective) = (sigma, objective);
        false
    }

    fn go(&mut self, way: &[f64]) {
        let moved: Vec<f64> = self.rows.iter().map(|(x, _, _)| self.at(x, way)).collect();
        for (residual, moved) in self.residuals.iter_mut().zip(&moved) {
            *residual -= moved;
        }
        for (weight, step) in self.weights.iter_mut().zip(way) {
            *weight += step;
        }
        self.sigma = self.scale_of(&self.residuals);
        self.objective = self.value(&self.residuals, self.sigma, &self.weights);
    }

    /// `σ/2` times the matrix of second derivatives (with the best scale put in) or what stands for it, and as much of the
    /// way down.
    fn second_order(&self, curvature: Curvature) -> Result<(Mat<f64>, Vec<f64>), NumericsError> {
        let (width, order) = (self.columns.len(), self.weights.len());
        let mut within = Gram::with_shift(vec![0.0; order])?;
        let mut pulled = vec![0.0; order];
        let mut beyond = Gram::with_shift(vec![0.0; order])?;
        let mut chunk = Vec::with_capacity(STEP_ROWS * order);
        let mut scratch = Vec::new();
        let limit = self.how.epsilon * self.sigma;
        for ((x, _, _), &r) in self.rows.iter().zip(&self.residuals) {
            let scaled = self
                .columns
                .iter()
                .map(|&column| (x[column] - self.means[column]) / self.scales[column]);
            if r.abs() <= limit {
                chunk.extend(scaled.chain([r]));
                if chunk.len() == STEP_ROWS * order {
                    within.add_rows(&chunk, None, &mut scratch);
                    chunk.clear();
                }
            } else {
                for (pull, z) in pulled.iter_mut().zip(scaled.clone().chain([1.0])) {
                    *pull += r.signum() * z;
                }
                if curvature == Curvature::Weighted {
                    let row: Vec<f64> = scaled.chain([0.0]).collect();
                    beyond.add_rows(&row, Some(&[limit / r.abs()]), &mut scratch);
                }
            }
        }
        within.add_rows(&chunk, None, &mut scratch);
        let (within, beyond) = (with_intercept(&within), with_intercept(&beyond));
        let against = |i: usize| within[(i, order)];
        let squares = within[(order, order)].max(f64::MIN_POSITIVE);
        let penalty = |i: usize| {
            if i == width {
                0.0
            } else {
                self.how.alpha * self.sigma
            }
        };
        let matrix = Mat::from_fn(order, order, |i, j| {
            let penalised = within[(i, j)] + if i == j { penalty(i) } else { 0.0 };
            match curvature {
                Curvature::Newton => penalised - against(i) * against(j) / squares,
                Curvature::Weighted => penalised + beyond[(i, j)],
            }
        });
        let downhill =
            (0..order).map(|i| against(i) + limit * pulled[i] - penalty(i) * self.weights[i]);
        Ok((matrix, downhill.collect()))
    }

    fn at(&self, x: &[f64], weights: &[f64]) -> f64 {
        let width = self.columns.len();
        let terms = self.columns.iter().zip(weights);
        terms.fold(weights[width], |sum, (&column, w)| {
            sum + w * (x[column] - self.means[column]) / self.scales[column]
        })
    }

    fn end(self, converged: bool) -> HuberFit {
        let scaled = self.columns.iter().zip(&self.weights);
        let coefficients: Vec<f64> = scaled.map(|(&j, w)| w / self.scales[j]).collect();
        let limit = self.how.epsilon * self.sigma;
        let terms = self.columns.iter().zip(&coefficients);
        let sizes = self.residuals.iter().map(|r| r.abs());
        let deviation = spread(sizes.clone()).max(self.least_sigma);
        let targets = || self.rows.iter().map(|(_, y, _)| y);
        let middle = median(&mut targets().collect::<Vec<_>>()).unwrap_or(f64::NAN);
        HuberFit {
            intercept: terms.fold(self.weights[self.columns.len()], |rest, (&j, b)| {
                rest - b * self.means[j]
            }),
            coefficients,
            scale: self.sigma,
            beyond: sizes.clone().filter(|size| *size > limit).count() as u64,
            deviation,
            target_deviation: spread(targets().map(|y| (y - middle).abs())),
            outliers: sizes.filter(|size| *size > OUTLYING * deviation).count() as u64,
            residual_sum_of_squares: self.residuals.iter().map(|r| r * r).sum(),
            objective: self.objective,
            converged,
        }
    }
}

/// The standard deviation of normal errors of these sizes; NaN of none.
fn spread(sizes: impl Iterator<Item = f64>) -> f64 {
    robust_deviation(&mut sizes.collect::<Vec<_>>()).unwrap_or(f64::NAN)
}

/// Where a step has led.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    Down,
    /// To the minimum.
    End,
    /// Nowhere, though the slope says that it goes on downhill: the objective has an edge there.
    Stuck,
}

/// What a step takes for the matrix of second derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Curvature {
    Newton,
    Weighted,
}

/// The moments about zero of the columns, of a column of ones, and of the target, in this order.
fn with_intercept(gram: &Gram) -> Mat<f64> {
    let target = gram.width();
    let moments = gram.moments_about(&vec![0.0; target + 1]);
    let sums: Vec<f64> = gram
        .means()
        .iter()
        .map(|mean| mean * gram.weight())
        .collect();
    let of = |k: usize| match k.cmp(&target) {
        std::cmp::Ordering::Less => Some(k),
        std::cmp::Ordering::Equal => None,
        std::cmp::Ordering::Greater => Some(target),
    };
    Mat::from_fn(target + 2, target + 2, |i, j| match (of(i), of(j)) {
        (Some(i), Some(j)) => moments[(i, j)],
        (Some(k), None) | (None, Some(k)) => sums[k],
        (None, None) => gram.weight(),
    })
}

/// Solves with as little added to the diagonal as makes the matrix positive definite.
fn solved(matrix: &Mat<f64>, target: &[f64]) -> Result<Vec<f64>, NumericsError> {
    let order = target.len();
    let largest = (0..order).map(|i| matrix[(i, i)]).fold(1.0, f64::max);
    let mut damping = 0.0;
    loop {
        let mut damped = matrix.clone();
        for i in 0..order {
            damped[(i, i)] += damping;
        }
        if let Ok(factor) = damped.llt(Side::Lower) {
            let mut solution = Mat::from_fn(order, 1, |i, _| target[i]);
            factor.solve_in_place(solution.as_mut());
            return Ok((0..order).map(|i| solution[(i, 0)]).collect());
        }
        damping = (damping * 100.0).max(1e-12 * largest);
        if !damping.is_finite() {
            return Err(NumericsError::NotFinite);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GramBlocks, Standardization, oracle};

    fn own() -> (GramBlocks, serde_json::Value) {
        let input = oracle::own_table("selection/input.csv").numbers();
        let target = oracle::own_table("huber/target.csv").numbers();
        let mut blocks = GramBlocks::new(12);
        for (row, y) in input.iter().zip(&target) {
            blocks.push(&row[..12], y[0]);
        }
        let text = oracle::own_text("huber/expected.json");
        (blocks, serde_json::from_str(&text).unwrap())
    }

    const ALL: [usize; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];

    #[test]
    fn the_models_are_those_of_the_own_oracle() {
        let (blocks, expected) = own();
        let standard = Standardization::of(&blocks.total());
        for model in expected.as_array().unwrap() {
            let number = |key: &str| model[key].as_f64().unwrap();
            let how = Huber {
                epsilon: number("epsilon"),
                alpha: number("alpha"),
            };
            let rows = blocks.rows().unwrap();
            let fit = how
                .solve(rows, &ALL, &standard.means, &standard.scales)
                .unwrap();
            assert!(fit.converged);
            assert!(fit.objective <= number("objective") * (1.0 + 1e-12));
            assert!((fit.scale / number("scale") - 1.0).abs() < 1e-8);
            assert_eq!(fit.beyond, model["outliers"]);
            assert!((fit.intercept - number("intercept")).abs() < 1e-8);
            for (found, wanted) in fit
                .coefficients
                .iter()
                .zip(model["coef"].as_array().unwrap())
            {
                assert!((found - wanted.as_f64().unwrap()).abs() < 1e-8, "{how:?}");
            }
        }
    }

    /// The fit that is usual, without a penalty.
    fn usual(blocks: &GramBlocks, columns: &[usize]) -> HuberFit {
        let how = Huber {
            epsilon: 1.35,
            alpha: 0.0,
        };
        let standard = Standardization::of(&blocks.total());
        let rows = blocks.rows().unwrap();
        how.solve(rows, columns, &standard.means, &standard.scales)
            .unwrap()
    }

    #[test]
    fn rows_without_noise_give_the_line_through_most_of_them() {
        let mut blocks = GramBlocks::new(2);
        for i in 0..300 {
            let x = f64::from(i) / 100.0;
            let y = if i % 10 == 0 { 1000.0 } else { 3.0 * x + 2.0 };
            blocks.push(&[x, x], y);
        }
        let fit = usual(&blocks, &[0]);
        assert!((fit.coefficients[0] - 3.0).abs() < 1e-6 && (fit.intercept - 2.0).abs() < 1e-6);
        assert_eq!(fit.outliers, 30);
        // Two equal columns share what one would have.
        let fit = usual(&blocks, &[0, 1]);
        assert!((fit.coefficients.iter().sum::<f64>() - 3.0).abs() < 1e-4);
    }

    #[test]
    fn ordinary_errors_are_no_outliers() {
        let mut blocks = GramBlocks::new(1);
        let count = 3000;
        for i in 0..count {
            // Normal errors, by the sum of the sines of angles that hang together in no way.
            let angle = |k: u32| f64::from(i * i % 7919 + k * i) * (1.0 + f64::from(k) * 0.618);
            let error: f64 = (1..=12).map(|k| angle(k).sin()).sum::<f64>() / 6.0_f64.sqrt();
            let x = f64::from(i) / 1000.0;
            let far = if i % 10 == 0 { 1000.0 } else { 0.0 };
            blocks.push(&[x], 3.0 * x + error + far);
        }
        let fit = usual(&blocks, &[0]);
        let share = |rows: u64| rows as f64 / f64::from(count);
        assert!(
            (0.1..0.11).contains(&share(fit.outliers)),
            "{}",
            fit.outliers
        );
        assert!(share(fit.beyond) > 0.2);
        assert!((0.9..1.3).contains(&fit.deviation), "{}", fit.deviation);
        assert!(fit.target_deviation > 2.0 * fit.deviation);
    }

    #[test]
    fn what_is_told_to_be_the_minimum_is_no_higher_for_a_column_more() {
        let mut converged = 0;
        for seed in 0..40 {
            let mut uniform = crate::draws::uniform(seed);
            let mut blocks = GramBlocks::new(3);
            for _ in 0..200 {
                let (a, b) = (20.0 + uniform(), 300.0 + 50.0 * uniform());
                // Errors of a Cauchy distribution: many of them are large.
                let error = 0.2 * (std::f64::consts::FRAC_PI_2 * uniform()).tan();
                blocks.push(&[a, b, a + b + 1e-6 * uniform()], a + 0.02 * b + error);
            }
            let gram = blocks.total();
            let (means, scales) = (gram.means(), Standardization::of(&gram).scales);
            for epsilon in [1.0, 1.0001, 1.05, 1.35] {
                let how = Huber {
                    epsilon,
                    alpha: 0.0,
                };
                let fit = |columns: &[usize]| {
                    let rows = blocks.rows().unwrap();
                    how.solve(rows, columns, &means, &scales).unwrap()
                };
                let (two, three) = (fit(&[0, 1]), fit(&[0, 1, 2]));
                let most = two.objective * (1.0 + 1e-6);
                assert!(
                    three.objective <= most || !three.converged,
                    "{three:?} instead of at most {most} with {epsilon} of {seed}"
                );
                converged += usize::from(three.converged);
            }
        }
        assert!(converged > 60, "{converged}");
    }

    #[test]
    fn wrong_requests_are_refused() {
        let (mut blocks, _) = own();
        let standard = Standardization::of(&blocks.total());
        let bad = Huber {
            epsilon: 0.5,
            alpha: 0.0,
        };
        let rows = blocks.rows().unwrap();
        assert!(
            bad.solve(rows, &ALL, &standard.means, &standard.scales)
                .is_err()
        );
        let how = Huber {
            epsilon: 1.35,
            alpha: 0.0,
        };
        assert!(
            how.solve(rows, &[12], &standard.means, &standard.scales)
                .is_err()
        );
        let mut weighted = blocks.clone();
        weighted.push_weighted(&[0.0; 12], 0.0, 2.0);
        let rows = weighted.rows().unwrap();
        let found = how.solve(rows, &ALL, &standard.means, &standard.scales);
        assert!(found.is_err_and(|error| error.to_string().starts_with("weight is 2")));
        blocks.push(&[0.0; 12], f64::NAN);
        let rows = blocks.rows().unwrap();
        let found = how.solve(rows, &ALL, &standard.means, &standard.scales);
        assert_eq!(found, Err(NumericsError::NotFinite));
    }
}
