//! Ridge towards what is known of a model's coefficients. Decides how a normal prior and rows make a fit; does not decide where
//! the prior comes from.

use crate::checks::{check_length, check_parameter, check_penalty};
use crate::normal_equations::Equilibrated;
use crate::{Gram, NumericsError, PredictionVariance};
use faer::Mat;
use serde::{Deserialize, Serialize};

/// What is known of a linear model's coefficients before its rows: their mean and covariance.
///
/// The model is `y = a + Σ b_j (x_j − c_j)` with a stated centre `c`. Its coefficients are `θ = (a, b)`, the constant first, in units of
/// the target per unit of the column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoefficientPrior {
    /// What each column is counted from.
    pub centre: Vec<f64>,
    /// The mean `μ`.
    pub mean: Vec<f64>,
    /// The covariance `Σ`, a lower triangle row by row.
    pub covariance: Vec<f64>,
}

/// How hard coefficients are pulled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pull {
    /// The penalty `λ` towards the prior, above 0, in squares of the target's unit: a variance of noise, times the number of rows that
    /// say as much as one would alone.
    pub penalty: f64,
    /// The penalty `α` towards 0 in scaled columns, of columns that the prior does not know.
    pub alpha: f64,
}

/// A fit with the help of a prior.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorFit {
    /// One coefficient per column.
    pub coefficients: Vec<f64>,
    /// The intercept, for columns as they are.
    pub intercept: f64,
    /// The weighted sum of the squared residuals, without the penalties.
    pub residual_sum_of_squares: f64,
    /// How far predictions may be off, where there are more rows than coefficients.
    pub variance: Option<PredictionVariance>,
}

/// A column of a fit: which of the rows' columns it is, and which of the prior's, where that knows it.
pub type Known = (usize, Option<usize>);

impl CoefficientPrior {
    /// How many coefficients it knows, the constant among them.
    pub fn order(&self) -> usize {
        self.mean.len()
    }

    /// Checks that it is whole, finite and a distribution.
    ///
    /// # Errors
    /// [`NumericsError::Length`], [`NumericsError::NotFinite`]; [`NumericsError::NoConvergence`] for a covariance that is not positive
    /// definite.
    pub fn check(&self) -> Result<(), NumericsError> {
        let order = self.centre.len() + 1;
        check_length("mean", order, self.mean.len())?;
        let triangle = order * (order + 1) / 2;
        check_length("covariance", triangle, self.covariance.len())?;
        let mut all = self.centre.iter().chain(&self.mean).chain(&self.covariance);
        if !all.all(|value| value.is_finite()) {
            return Err(NumericsError::NotFinite);
        }
        let places: Vec<usize> = (0..order).collect();
        self.precision(&places).map(|_| ())
    }

    fn of(&self, i: usize, j: usize) -> f64 {
        let (low, high) = (i.min(j), i.max(j));
        self.covariance[high * (high + 1) / 2 + low]
    }

    /// The inverse of the covariance of some of the coefficients. What is left out says nothing of the others: they have the
    /// distribution that they have beside it.
    fn precision(&self, places: &[usize]) -> Result<Mat<f64>, NumericsError> {
        let order = places.len();
        let covariance = Mat::from_fn(order, order, |i, j| self.of(places[i], places[j]));
        if (0..order).any(|i| covariance[(i, i)] <= 0.0) {
            return Err(NumericsError::NoConvergence);
        }
        let root = Equilibrated::of(&covariance, 0.0).inverse_root(0.0);
        let root = root.ok_or(NumericsError::NoConvergence)?;
        Ok(root.transpose() * &root)
    }

    /// Minimises `Σv(y − a − (x − c)ᵀb)² + λ (θ − μ)ᵀ Σ⁻¹ (θ − μ)`, plus `α (s_j b_j)²` for each column that the prior does not know,
    /// with column scales `s`, one positive value per regressor of the rows.
    ///
    /// It is the posterior mean of a normal prior of covariance `Σ` and noise of variance `λ` (Lindley and Smith 1972; Hoerl and
    /// Kennard 1970 with `μ = 0` and `Σ = 1`). The constant is pulled like any coefficient. Columns that the prior does not know are
    /// counted from their means.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`], [`NumericsError::Column`] for a column that the rows or the prior do not have,
    /// [`NumericsError::TooFewRows`] without rows, [`NumericsError::NotFinite`], [`NumericsError::NoConvergence`].
    pub fn fit(
        &self,
        gram: &Gram,
        columns: &[Known],
        scales: &[f64],
        pull: Pull,
    ) -> Result<PriorFit, NumericsError> {
        self.check_request(gram, columns, pull)?;
        let problem = Towards::new(self, gram, columns, scales, pull)?;
        let shift = problem.solve()?;
        let order = problem.order();
        let coefficients: Vec<f64> = (1..order).map(|k| problem.mean[k] + shift[k]).collect();
        let theta: Vec<f64> = [shift[0]].iter().chain(&coefficients).copied().collect();
        let constant = self.mean[0] + shift[0];
        let terms = coefficients.iter().zip(&problem.centre);
        let residual_sum_of_squares = problem.errors(&theta);
        Ok(PriorFit {
            intercept: terms.fold(constant, |rest, (b, c)| rest - b * c),
            coefficients,
            residual_sum_of_squares,
            variance: problem.variance(residual_sum_of_squares, gram.count()),
        })
    }

    fn check_request(
        &self,
        gram: &Gram,
        columns: &[Known],
        pull: Pull,
    ) -> Result<(), NumericsError> {
        check_penalty(pull.alpha)?;
        let fine = pull.penalty > 0.0 && pull.penalty.is_finite();
        check_parameter("penalty", pull.penalty, fine, "finite and above 0")?;
        for &(column, place) in columns {
            let (width, known) = (gram.width(), self.centre.len());
            if column >= width {
                return Err(NumericsError::Column { column, width });
            }
            if let Some(column) = place.filter(|&place| place >= known) {
                return Err(NumericsError::Column {
                    column,
                    width: known,
                });
            }
        }
        if !gram.is_finite() {
            return Err(NumericsError::NotFinite);
        }
        if gram.count() == 0 || gram.weight() <= 0.0 {
            return Err(NumericsError::TooFewRows {
                needed: 1,
                found: 0,
            });
        }
        Ok(())
    }
}

/// Normal equations about a prior: of the constant and the columns, all counted from the prior's centre and mean.
struct Towards {
    centre: Vec<f64>,
    /// 0 for the constant and for what the prior does not know.
    mean: Vec<f64>,
    /// Of the rows alone.
    cross: Mat<f64>,
    target: Vec<f64>,
    squares: f64,
    /// What the penalties add.
    pull: Mat<f64>,
}

impl Towards {
    fn new(
        prior: &CoefficientPrior,
        gram: &Gram,
        columns: &[Known],
        scales: &[f64],
        pull: Pull,
    ) -> Result<Self, NumericsError> {
        let (y, weight) = (gram.width(), gram.weight());
        let means = gram.means();
        let mut about = means.clone();
        about[y] = prior.mean[0];
        for &(column, place) in columns {
            if let Some(place) = place {
                about[column] = prior.centre[place];
            }
        }
        let moments = gram.moments_about(&about);
        let order = columns.len() + 1;
        let sum = |column: usize| weight * (means[column] - about[column]);
        let of = |k: usize| columns[k - 1].0;
        let cross = Mat::from_fn(order, order, |i, j| match (i, j) {
            (0, 0) => weight,
            (0, k) | (k, 0) => sum(of(k)),
            _ => moments[(of(i), of(j))],
        });
        let target = (0..order).map(|k| match k {
            0 => sum(y),
            k => moments[(of(k), y)],
        });
        // The places of what is known, among the coefficients of the fit and among those of the prior.
        let known = columns.iter().zip(1..);
        let known = known.filter_map(|(&(_, place), k)| Some((k, place? + 1)));
        let known: Vec<(usize, usize)> = [(0, 0)].into_iter().chain(known).collect();
        let places: Vec<usize> = known.iter().map(|&(_, place)| place).collect();
        let precision = prior.precision(&places)?;
        let mut pulled = Mat::zeros(order, order);
        let mut mean = vec![0.0; order];
        for (i, &(k, place)) in known.iter().enumerate() {
            if k > 0 {
                mean[k] = prior.mean[place];
            }
            for (j, &(l, _)) in known.iter().enumerate() {
                pulled[(k, l)] = pull.penalty * precision[(i, j)];
            }
        }
        for (&(column, place), k) in columns.iter().zip(1..) {
            if place.is_none() {
                pulled[(k, k)] = pull.alpha * scales[column] * scales[column];
            }
        }
        Ok(Self {
            centre: columns.iter().map(|&(column, _)| about[column]).collect(),
            mean,
            target: target.collect(),
            cross,
            squares: moments[(y, y)],
            pull: pulled,
        })
    }

    fn order(&self) -> usize {
        self.mean.len()
    }

    /// How far the coefficients are from the mean.
    fn solve(&self) -> Result<Vec<f64>, NumericsError> {
        let order = self.order();
        let rest = (0..order).map(|i| {
            let by_mean: f64 = (0..order).map(|j| self.cross[(i, j)] * self.mean[j]).sum();
            self.target[i] - by_mean
        });
        let rest: Vec<f64> = rest.collect();
        // Of a column of zeros that nothing pulls, every coefficient is as good.
        let least = order as f64 * f64::EPSILON;
        let penalised = self.penalised();
        penalised
            .solve(&rest, 0.0)
            .or_else(|| penalised.solve(&rest, least))
            .ok_or(NumericsError::NoConvergence)
    }

    fn penalised(&self) -> Equilibrated {
        Equilibrated::of(&positive(&self.cross + &self.pull), 0.0)
    }

    /// The weighted sum of the squared residuals of these coefficients, those of the columns whole and the constant as it is beyond the
    /// mean.
    fn errors(&self, theta: &[f64]) -> f64 {
        let mut sum = self.squares;
        for (i, of) in theta.iter().enumerate() {
            let fitted: f64 = theta
                .iter()
                .enumerate()
                .map(|(j, other)| self.cross[(i, j)] * other)
                .sum();
            sum += of * (fitted - 2.0 * self.target[i]);
        }
        sum.max(0.0)
    }

    /// As [`PredictionVariance`] has it, with the pull of the constant counted as rows.
    fn variance(&self, errors: f64, rows: u64) -> Option<PredictionVariance> {
        let order = self.order();
        let all = positive(&self.cross + &self.pull);
        let root = Equilibrated::of(&all, 0.0).inverse_root(0.0)?;
        let posterior = root.transpose() * &root;
        let cells = (0..order).flat_map(|i| (0..order).map(move |j| (i, j)));
        let pulled: f64 = cells.map(|at| posterior[at] * self.pull[at]).sum();
        let free = rows as f64 - (order as f64 - pulled);
        // What is left of the columns once the constant has been solved for.
        let of_constant = all[(0, 0)];
        let columns = Mat::from_fn(order - 1, order - 1, |i, j| {
            all[(i + 1, j + 1)] - all[(i + 1, 0)] * all[(0, j + 1)] / of_constant
        });
        let root = Equilibrated::of(&positive(columns), 0.0).inverse_root(0.0)?;
        let triangle = (0..order - 1).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let centre = self.centre.iter().zip(1..);
        (free > 0.0).then(|| PredictionVariance {
            noise: errors / free,
            rows: of_constant as u64,
            centre: centre.map(|(c, k)| c + all[(k, 0)] / of_constant).collect(),
            root: triangle.map(|at| root[at]).collect(),
        })
    }
}

/// The same with 1 in the place of zeros on the diagonal: a column that is nothing but zeros and that nothing pulls has the coefficient 0.
fn positive(mut matrix: Mat<f64>) -> Mat<f64> {
    for i in 0..matrix.nrows() {
        if matrix[(i, i)] <= 0.0 {
            matrix[(i, i)] = 1.0;
        }
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws;
    use crate::{LeastSquares, Standardization};

    const KNOWN: [Known; 2] = [(0, Some(0)), (1, Some(1))];

    fn rows() -> Gram {
        let mut normal = draws::normal(5);
        let mut gram = Gram::new(2);
        for _ in 0..50 {
            let x = [20.0 + normal(), 3.0 * normal()];
            gram.push(&x, 4.0 + 2.0 * x[0] - x[1] + 0.5 * normal());
        }
        gram
    }

    fn prior() -> CoefficientPrior {
        CoefficientPrior {
            centre: vec![19.0, 0.5],
            mean: vec![40.0, 1.0, -2.0],
            covariance: vec![4.0, 0.3, 0.5, -0.2, 0.1, 0.25],
        }
    }

    const PULL: Pull = Pull {
        penalty: 2.0,
        alpha: 1.0,
    };

    #[test]
    fn a_prior_about_zero_that_leaves_the_constant_alone_is_ridge() {
        let gram = rows();
        let scales = Standardization::of(&gram).scales;
        let prior = CoefficientPrior {
            centre: vec![0.0; 2],
            mean: vec![0.0; 3],
            covariance: vec![1e12, 0.0, scales[0].powi(-2), 0.0, 0.0, scales[1].powi(-2)],
        };
        let pull = Pull {
            penalty: 7.0,
            alpha: 0.0,
        };
        let found = prior.fit(&gram, &KNOWN, &scales, pull).unwrap();
        let squares = LeastSquares::ridge(7.0);
        let expected = squares.solve(&gram, &[0, 1], &scales, None).unwrap();
        let of = |intercept, coefficients: &[f64]| [intercept, coefficients[0], coefficients[1]];
        let both = of(found.intercept, &found.coefficients)
            .into_iter()
            .zip(of(expected.intercept, &expected.coefficients));
        for (found, expected) in both {
            assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
        }
        let (found, expected) = (
            found.variance.unwrap(),
            squares
                .prediction_variance(&gram, &scales, &expected)
                .unwrap(),
        );
        let at = [23.0, -4.0];
        assert!((found.at(&at) / expected.at(&at) - 1.0).abs() < 1e-6);
        // A column that the prior does not know is pulled as ridge pulls it.
        let pull = Pull {
            penalty: 7.0,
            alpha: 7.0,
        };
        let unknown = prior
            .fit(&gram, &[(0, Some(0)), (1, None)], &scales, pull)
            .unwrap();
        let coefficients = unknown.coefficients.iter();
        for (found, expected) in coefficients.zip(
            squares
                .solve(&gram, &[0, 1], &scales, None)
                .unwrap()
                .coefficients,
        ) {
            assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
        }
    }

    /// The function that a fit minimises, written out.
    fn objective(gram: &[([f64; 2], f64)], theta: &[f64]) -> f64 {
        let prior = prior();
        let squares = gram.iter().map(|(x, y)| {
            let terms = x.iter().zip(&prior.centre).zip(&theta[1..]);
            let predicted: f64 = terms.map(|((x, c), b)| (x - c) * b).sum();
            (y - theta[0] - predicted).powi(2)
        });
        let apart: Vec<f64> = theta.iter().zip(&prior.mean).map(|(t, m)| t - m).collect();
        let covariance = Mat::from_fn(3, 3, |i, j| prior.of(i, j));
        let solved = faer::linalg::solvers::Solve::solve(
            &covariance.llt(faer::Side::Lower).unwrap(),
            &Mat::from_fn(3, 1, |i, _| apart[i]),
        );
        let penalty: f64 = (0..3).map(|i| apart[i] * solved[(i, 0)]).sum();
        squares.sum::<f64>() + PULL.penalty * penalty
    }

    #[test]
    fn the_fit_is_the_minimum_of_what_is_stated() {
        let (mut normal, mut gram, mut rows) = (draws::normal(9), Gram::new(2), Vec::new());
        for _ in 0..8 {
            let x = [19.5 + normal(), normal()];
            let y = 41.0 + 3.0 * normal();
            gram.push(&x, y);
            rows.push((x, y));
        }
        let fit = prior().fit(&gram, &KNOWN, &[1.0, 1.0], PULL).unwrap();
        let constant = fit.intercept + 19.0 * fit.coefficients[0] + 0.5 * fit.coefficients[1];
        let theta = [constant, fit.coefficients[0], fit.coefficients[1]];
        let least = objective(&rows, &theta);
        for k in 0..3 {
            for step in [-1e-3, 1e-3] {
                let mut beside = theta;
                beside[k] += step;
                assert!(objective(&rows, &beside) > least, "{k}");
            }
        }
        let by_hand: f64 = rows
            .iter()
            .map(|(x, y)| {
                (y - fit.intercept - x[0] * fit.coefficients[0] - x[1] * fit.coefficients[1])
                    .powi(2)
            })
            .sum();
        assert!((fit.residual_sum_of_squares / by_hand - 1.0).abs() < 1e-9);
    }

    #[test]
    fn many_rows_have_their_way_and_a_strong_prior_has_its_own() {
        let gram = rows();
        let weak = Pull {
            penalty: 1e-9,
            ..PULL
        };
        let found = prior().fit(&gram, &KNOWN, &[1.0, 1.0], weak).unwrap();
        let expected = LeastSquares::ordinary()
            .solve(&gram, &[0, 1], &[1.0, 1.0], None)
            .unwrap();
        for (found, expected) in found.coefficients.iter().zip(&expected.coefficients) {
            assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
        }
        let strong = Pull {
            penalty: 1e9,
            ..PULL
        };
        let found = prior().fit(&gram, &KNOWN, &[1.0, 1.0], strong).unwrap();
        assert!((found.coefficients[0] - 1.0).abs() < 1e-5);
        assert!((found.coefficients[1] + 2.0).abs() < 1e-5);
        // The constant at the centre, where both columns are left behind.
        assert!((found.intercept - (40.0 - 19.0 * 1.0 + 0.5 * 2.0)).abs() < 1e-4);
    }

    #[test]
    fn a_column_without_values_of_its_own_keeps_what_the_prior_knows() {
        let mut gram = Gram::new(2);
        let mut normal = draws::normal(2);
        for _ in 0..100 {
            let x = 20.0 + normal();
            gram.push(&[x, 0.5], 40.0 + 1.5 * (x - 19.0));
        }
        let fit = prior().fit(&gram, &KNOWN, &[1.0, 1.0], PULL).unwrap();
        // What the first tells of it: their covariance is 0.1, and the first is 0.5 further than its mean.
        assert!((fit.coefficients[0] - 1.5).abs() < 0.05, "{fit:?}");
        assert!((fit.coefficients[1] + 1.9).abs() < 0.1, "{fit:?}");
    }

    #[test]
    fn a_covariance_that_is_none_is_refused() {
        let mut wrong = prior();
        wrong.covariance[5] = 0.01;
        assert_eq!(wrong.check(), Err(NumericsError::NoConvergence));
        wrong.covariance[5] = f64::NAN;
        assert_eq!(wrong.check(), Err(NumericsError::NotFinite));
        wrong.covariance.pop();
        assert!(matches!(wrong.check(), Err(NumericsError::Length { .. })));
        assert_eq!(prior().check(), Ok(()));
    }
}
