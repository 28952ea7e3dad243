//! Ordinary and ridge least squares on chosen columns. Decides which method solves them, how well conditioned they are and
//! what is done when they are not; does not decide which columns to use.

use crate::checks::{check_columns, check_parameter, check_penalty, check_scale};
use crate::normal_equations::{Problem, condition_of, nearly_dependent};
use crate::{Gram, NumericsError, Rows};
use serde::{Deserialize, Serialize};

/// Above this condition number of the standardised design the rows are solved instead of their Gram matrix, whose condition
/// number is its square: at the bound, coefficients from the Gram matrix are exact to some 1e-9.
pub const DEFAULT_CONDITION_BOUND: f64 = 1e3;
/// Above this condition number columns are called collinear; without their rows they are solved with a tiny ridge.
pub const SINGULAR_BOUND: f64 = 1e6;
/// Directions whose singular value is below this share of the largest are left out of a minimum-norm solution.
pub const DEFAULT_RCOND: f64 = 1e-10;

/// Minimises `Σv(y − b₀ − xᵀb)² + α Σ(s_j b_j)²` over the coefficients `b`, with column scales `s` and `b₀` free or 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeastSquares {
    /// The penalty `α`; 0 for ordinary least squares.
    pub alpha: f64,
    /// Whether there is an intercept, which is never penalised.
    pub intercept: bool,
    /// The largest condition number of the (penalised) standardised design for which the Gram matrix is solved while there
    /// are rows; see [`DEFAULT_CONDITION_BOUND`].
    pub condition_bound: f64,
    /// For the minimum-norm solution, see [`DEFAULT_RCOND`].
    pub rcond: f64,
}

/// How the coefficients were found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Cholesky factorisation of the Gram matrix.
    Cholesky,
    /// Singular values of the rows: the solution of minimum norm in the scaled columns.
    Svd {
        /// The number of directions that the rows determine.
        rank: usize,
    },
    /// The rows were not kept, so the standardised Gram matrix (unit diagonal) was solved with `alpha` added to its
    /// diagonal.
    TinyRidge {
        /// What was added.
        alpha: f64,
    },
}

/// A linear model on the original scale of its columns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinearFit {
    /// The columns that were asked for, in that order.
    pub columns: Vec<usize>,
    /// One coefficient per column of `columns`, in target units per column unit.
    pub coefficients: Vec<f64>,
    /// The intercept in target units; 0 without one.
    pub intercept: f64,
    /// The condition number of the standardised design (each column centred, where there is an intercept, and of the same
    /// length), without the penalty and the constant columns; infinite when it is singular.
    pub condition: f64,
    /// The weighted sum of the squared residuals, without the penalty.
    pub residual_sum_of_squares: f64,
    /// How it was solved.
    pub method: Method,
    /// Columns without variance (without an intercept: zero throughout). Their coefficient is 0.
    pub constant: Vec<usize>,
    /// Where the condition number passes [`SINGULAR_BOUND`]: the columns that are nearly a combination of those before them.
    /// Their coefficients are not determined by the rows, only by the method.
    pub collinear: Vec<usize>,
}

impl LinearFit {
    /// The model's value for a whole row of regressors.
    ///
    /// # Panics
    /// When the row lacks one of the columns.
    pub fn predict(&self, x: &[f64]) -> f64 {
        let terms = self.columns.iter().zip(&self.coefficients);
        terms.fold(self.intercept, |sum, (&column, b)| sum + b * x[column])
    }
}

impl LeastSquares {
    /// Without a penalty, with an intercept.
    pub fn ordinary() -> Self {
        Self::ridge(0.0)
    }

    /// With a penalty on the sum of squares in the scaled columns, and an intercept.
    pub fn ridge(alpha: f64) -> Self {
        Self {
            alpha,
            intercept: true,
            condition_bound: DEFAULT_CONDITION_BOUND,
            rcond: DEFAULT_RCOND,
        }
    }

    /// The same through the origin.
    pub fn without_intercept(self) -> Self {
        Self {
            intercept: false,
            ..self
        }
    }

    /// Fits `columns` of the rows in `gram`. `scales` has one positive value per regressor of the rows, used or not. `rows`,
    /// where they are kept, must be the same rows; they are used when the condition number passes the bound.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`], [`NumericsError::Column`], [`NumericsError::RepeatedColumn`], [`NumericsError::Scale`],
    /// [`NumericsError::Width`], [`NumericsError::TooFewRows`] without rows (or when `rows` are fewer than `gram` has),
    /// [`NumericsError::NotFinite`], [`NumericsError::NoConvergence`].
    pub fn solve(
        &self,
        gram: &Gram,
        columns: &[usize],
        scales: &[f64],
        rows: Option<Rows<'_>>,
    ) -> Result<LinearFit, NumericsError> {
        self.check(gram, columns, scales, rows)?;
        let problem = Problem::new(self.intercept, gram, columns, scales);
        let mut fit = LinearFit {
            columns: columns.to_vec(),
            coefficients: vec![0.0; columns.len()],
            intercept: 0.0,
            condition: condition_of(&problem.standard)?,
            residual_sum_of_squares: problem.spread,
            method: Method::Cholesky,
            constant: problem.constant.iter().map(|&k| columns[k]).collect(),
            collinear: Vec::new(),
        };
        if fit.condition > SINGULAR_BOUND {
            fit.collinear = nearly_dependent(&problem.standard, SINGULAR_BOUND)
                .into_iter()
                .map(|k| columns[problem.active[k]])
                .collect();
        }
        let penalised = problem.penalised(self.alpha);
        let solved = if self.alpha > 0.0 {
            condition_of(&penalised.matrix)?
        } else {
            fit.condition
        };
        let bound = match rows {
            Some(_) => self.condition_bound,
            None => SINGULAR_BOUND,
        };
        let direct = (solved <= bound)
            .then(|| penalised.solve(&problem.target, 0.0))
            .flatten();
        let scaled = match (direct, rows) {
            (Some(coefficients), _) => coefficients,
            (None, Some(rows)) => {
                let triangle = problem.factorise(gram, columns, rows)?;
                let solution = triangle.minimum_norm(self.alpha, self.rcond)?;
                fit.condition = triangle.condition()?;
                fit.method = Method::Svd {
                    rank: solution.rank,
                };
                fit.residual_sum_of_squares = solution.residual_sum_of_squares;
                solution.coefficients
            }
            (None, None) => {
                let alpha = penalised.order() as f64 / SINGULAR_BOUND.powi(2);
                fit.method = Method::TinyRidge { alpha };
                penalised
                    .solve(&problem.target, alpha)
                    .ok_or(NumericsError::NoConvergence)?
            }
        };
        if !matches!(fit.method, Method::Svd { .. }) {
            fit.residual_sum_of_squares = problem.residual_sum_of_squares(&scaled);
        }
        for (k, value) in problem.active.iter().zip(&scaled) {
            fit.coefficients[*k] = value / scales[columns[*k]];
        }
        if self.intercept {
            let means = gram.means();
            let terms = columns.iter().zip(&fit.coefficients);
            fit.intercept = terms.fold(means[gram.width()], |rest, (&j, b)| rest - b * means[j]);
        }
        Ok(fit)
    }

    fn check(
        &self,
        gram: &Gram,
        columns: &[usize],
        scales: &[f64],
        rows: Option<Rows<'_>>,
    ) -> Result<(), NumericsError> {
        check_penalty(self.alpha)?;
        let bound = self.condition_bound;
        let fine = (1.0..=SINGULAR_BOUND).contains(&bound);
        check_parameter("condition_bound", bound, fine, "from 1 to 1e6")?;
        let fine = (0.0..1.0).contains(&self.rcond);
        check_parameter("rcond", self.rcond, fine, "from 0 to below 1")?;
        let width = gram.width();
        if scales.len() != width {
            return Err(NumericsError::Width {
                expected: width,
                found: scales.len(),
            });
        }
        check_columns(columns, width)?;
        for &column in columns {
            check_scale(column, scales[column])?;
        }
        if !gram.is_finite() {
            return Err(NumericsError::NotFinite);
        }
        if gram.count() == 0 || gram.weight() <= 0.0 {
            return Err(NumericsError::TooFewRows {
                needed: 1,
                found: gram.count(),
            });
        }
        if let Some(rows) = rows {
            if rows.width() != width {
                return Err(NumericsError::Width {
                    expected: width,
                    found: rows.width(),
                });
            }
            if rows.count() != gram.count() {
                return Err(NumericsError::TooFewRows {
                    needed: gram.count(),
                    found: rows.count(),
                });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GramBlocks, Standardization, oracle};

    struct Oracle {
        rows: Vec<Vec<f64>>,
        coefficients: oracle::Table,
    }

    fn read() -> Option<Oracle> {
        Some(Oracle {
            rows: oracle::table("linear_ridge/input.csv")?.numbers(),
            coefficients: oracle::table("linear_ridge/coefs.csv")?,
        })
    }

    const ALL: [usize; 8] = [0, 1, 2, 3, 4, 5, 6, 7];

    fn blocks(rows: &[Vec<f64>], weighted: bool, row_memory: usize) -> GramBlocks {
        let mut blocks = GramBlocks::with_row_memory(8, row_memory);
        for row in rows {
            blocks.push_weighted(&row[..8], row[8], if weighted { row[9] } else { 1.0 });
        }
        blocks
    }

    fn assert_fit(fit: &LinearFit, expected: &[f64], name: &str) {
        let found = fit.coefficients.iter().chain([&fit.intercept]);
        for (found, wanted) in found.zip(expected) {
            assert!((found - wanted).abs() < 1e-8, "{name}: {found} {wanted}");
        }
    }

    #[test]
    fn every_model_of_the_oracle_is_met() {
        let Some(oracle) = read() else { return };
        let ones = [1.0; 8];
        for record in &oracle.coefficients.records {
            let name = record[0].as_str();
            let gram = blocks(&oracle.rows, name.starts_with('w'), 0).total();
            let how = match name.split_once('_') {
                Some((_, "nointercept")) => LeastSquares::ordinary().without_intercept(),
                Some((_, alpha)) => LeastSquares::ridge(alpha.parse().unwrap()),
                None => LeastSquares::ordinary(),
            };
            let fit = how.solve(&gram, &ALL, &ones, None).unwrap();
            assert_eq!(fit.method, Method::Cholesky, "{name}");
            assert_fit(&fit, &oracle.coefficients.named(name), name);
        }
        assert_eq!(oracle.coefficients.records.len(), 9);
    }

    #[test]
    fn the_rows_give_the_same_as_the_gram_matrix_of_the_oracle() {
        let Some(oracle) = read() else { return };
        for (name, weighted, alpha) in [
            ("ols", false, 0.0),
            ("wls", true, 0.0),
            ("ridge_1.0", false, 1.0),
        ] {
            let blocks = blocks(&oracle.rows, weighted, 1 << 20);
            let strict = LeastSquares {
                condition_bound: 1.0,
                ..LeastSquares::ridge(alpha)
            };
            let gram = blocks.total();
            let fit = strict.solve(&gram, &ALL, &[1.0; 8], blocks.rows()).unwrap();
            assert_eq!(fit.method, Method::Svd { rank: 8 });
            assert_fit(&fit, &oracle.coefficients.named(name), name);
            let direct = LeastSquares::ridge(alpha);
            let direct = direct.solve(&gram, &ALL, &[1.0; 8], None).unwrap();
            assert!((direct.condition / fit.condition - 1.0).abs() < 1e-6);
            let (a, b) = (direct.residual_sum_of_squares, fit.residual_sum_of_squares);
            assert!((a / b - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn the_residuals_have_the_variance_of_the_oracle() {
        let Some(oracle) = read() else { return };
        let text = oracle::text("linear_ridge/ols_stats.json").unwrap();
        let key = "\"sigma2_unbiased\": ";
        let from = text.find(key).unwrap() + key.len();
        let until = from + text[from..].find([',', '\n']).unwrap();
        let sigma2: f64 = text[from..until].parse().unwrap();
        let gram = blocks(&oracle.rows, false, 0).total();
        let fit = LeastSquares::ordinary()
            .solve(&gram, &ALL, &[1.0; 8], None)
            .unwrap();
        let degrees_of_freedom = oracle.rows.len() as f64 - 9.0;
        assert!((fit.residual_sum_of_squares / degrees_of_freedom / sigma2 - 1.0).abs() < 1e-9);
    }

    /// Column 1 is column 0, column 2 is constant, column 3 is independent; `y = 4 x0 + 3 x3 + 10`.
    fn collinear(row_memory: usize) -> GramBlocks {
        let mut blocks = GramBlocks::with_row_memory(4, row_memory);
        for i in 0..1000 {
            let (a, b) = ((0.37 * f64::from(i)).sin(), (0.11 * f64::from(i)).cos());
            blocks.push(
                &[20.0 + a, 20.0 + a, 7.0, b],
                4.0 * (20.0 + a) + 3.0 * b + 10.0,
            );
        }
        blocks
    }

    #[test]
    fn equal_sensors_share_their_weight_and_are_named() {
        let kept = collinear(1 << 20);
        let gram = kept.total();
        let scales = Standardization::of(&gram).scales;
        let how = LeastSquares::ordinary();
        let fit = how
            .solve(&gram, &[0, 1, 2, 3], &scales, kept.rows())
            .unwrap();
        assert_eq!(fit.method, Method::Svd { rank: 2 });
        assert_eq!(fit.condition, f64::INFINITY);
        assert_eq!((fit.constant, fit.collinear), (vec![2], vec![1]));
        for (found, wanted) in fit.coefficients.iter().zip([2.0, 2.0, 0.0, 3.0]) {
            assert!((found - wanted).abs() < 1e-9);
        }
        assert!((fit.intercept - 10.0).abs() < 1e-7);
    }

    #[test]
    fn equal_sensors_without_rows_are_solved_by_a_tiny_ridge_that_is_stated() {
        let gram = collinear(0).total();
        let scales = Standardization::of(&gram).scales;
        let how = LeastSquares::ordinary();
        let fit = how.solve(&gram, &[3, 1, 0], &scales, None).unwrap();
        assert!(matches!(fit.method, Method::TinyRidge { alpha } if alpha > 0.0));
        assert_eq!(fit.collinear, [0]);
        for (found, wanted) in fit.coefficients.iter().zip([3.0, 2.0, 2.0]) {
            assert!((found - wanted).abs() < 1e-3, "{:?}", fit.coefficients);
        }
        let x = [20.5, 20.5, 7.0, 0.5];
        assert!((fit.predict(&x) - (4.0 * 20.5 + 3.0 * 0.5 + 10.0)).abs() < 1e-6);
    }

    #[test]
    fn a_ridge_on_equal_sensors_needs_no_fallback_but_names_them() {
        let gram = collinear(0).total();
        let scales = Standardization::of(&gram).scales;
        let fit = LeastSquares::ridge(1.0)
            .solve(&gram, &[0, 1, 3], &scales, None)
            .unwrap();
        assert_eq!(fit.method, Method::Cholesky);
        assert_eq!(fit.collinear, [1]);
        assert!((fit.coefficients[0] - fit.coefficients[1]).abs() < 1e-9);
    }

    #[test]
    fn fewer_rows_than_columns_give_the_solution_of_minimum_norm() {
        let mut blocks = GramBlocks::new(3);
        blocks.push(&[1.0, 0.0, 0.0], 2.0);
        blocks.push(&[0.0, 1.0, 1.0], 6.0);
        let how = LeastSquares::ordinary().without_intercept();
        let gram = blocks.total();
        let fit = how
            .solve(&gram, &[0, 1, 2], &[1.0; 3], blocks.rows())
            .unwrap();
        assert_eq!(fit.method, Method::Svd { rank: 2 });
        for (found, wanted) in fit.coefficients.iter().zip([2.0, 3.0, 3.0]) {
            assert!((found - wanted).abs() < 1e-12);
        }
        assert!(fit.residual_sum_of_squares < 1e-24);
    }

    #[test]
    fn without_columns_the_mean_is_left() {
        let gram = collinear(0).total();
        let fit = LeastSquares::ordinary()
            .solve(&gram, &[], &[1.0; 4], None)
            .unwrap();
        assert_eq!(fit.intercept, gram.means()[4]);
        assert!(fit.residual_sum_of_squares > 0.0);
    }

    /// Seven days at 1 Hz would be 604,800 rows; an hour of them hangs together as much. A temperature that follows the room
    /// through a first-order lag, and 45 lags of it and of its neighbour.
    fn lagged(row_memory: usize) -> GramBlocks {
        let (mut slow, mut slower) = (0.0, 0.0);
        let mut past = [[0.0; 23]; 2];
        let mut blocks = GramBlocks::with_row_memory(46, row_memory);
        let mut even = crate::draws::uniform(1);
        let mut uniform = || 0.5 * even();
        for t in 0..3600 {
            let room = 21.0 + (f64::from(t) / 600.0).sin() + 0.3 * uniform();
            slow += (room - slow) / 20.0;
            slower += (slow - slower) / 60.0;
            for (line, now) in past.iter_mut().zip([slow, slower]) {
                line.rotate_right(1);
                line[0] = now + 0.001 * uniform();
            }
            if t < 600 {
                continue;
            }
            let row: Vec<f64> = past.iter().flatten().copied().collect();
            let y = 3.0 * (row[0] - row[10]) - 2.0 * row[30] + 0.01 * uniform();
            blocks.push(&row, y);
        }
        blocks
    }

    #[test]
    fn lagged_regressors_at_one_hertz_have_the_coefficients_of_singular_values() {
        let kept = lagged(1 << 24);
        let gram = kept.total();
        let scales = Standardization::of(&gram).scales;
        let columns: Vec<usize> = (0..46).collect();
        let fit = LeastSquares::ordinary().solve(&gram, &columns, &scales, kept.rows());
        let fit = fit.unwrap();
        assert!(
            fit.condition > 1e3 && fit.condition < 1e6,
            "{}",
            fit.condition
        );
        assert_eq!(fit.collinear, Vec::<usize>::new());
        let expected = by_singular_values(&kept, &gram.means(), &scales);
        assert_relative(&fit.coefficients, &expected, 1e-8);
        // Where the Gram matrix is trusted, it is as good.
        let ridge = LeastSquares::ridge(1.0);
        let direct = ridge.solve(&gram, &columns, &scales, kept.rows()).unwrap();
        assert_eq!(direct.method, Method::Cholesky);
        let strict = LeastSquares {
            condition_bound: 1.0,
            ..ridge
        };
        let from_rows = strict.solve(&gram, &columns, &scales, kept.rows()).unwrap();
        assert!(matches!(from_rows.method, Method::Svd { rank: 46 }));
        assert_relative(&direct.coefficients, &from_rows.coefficients, 1e-8);
    }

    /// The coefficients by the singular values of all rows at once.
    fn by_singular_values(blocks: &GramBlocks, means: &[f64], scales: &[f64]) -> Vec<f64> {
        use faer::Mat;
        let rows: Vec<(&[f64], f64, f64)> = blocks.rows().unwrap().iter().collect();
        let width = scales.len();
        let x = Mat::from_fn(rows.len(), width, |i, j| {
            (rows[i].0[j] - means[j]) / scales[j]
        });
        let y = Mat::from_fn(rows.len(), 1, |i, _| rows[i].1 - means[width]);
        let svd = x.thin_svd().unwrap();
        let along = svd.U().transpose() * y;
        let values = svd.S().column_vector();
        let scaled = Mat::from_fn(width, 1, |k, _| along[(k, 0)] / values[k]);
        let weights = svd.V() * scaled;
        (0..width).map(|j| weights[(j, 0)] / scales[j]).collect()
    }

    fn assert_relative(found: &[f64], wanted: &[f64], tolerance: f64) {
        let size = wanted.iter().fold(0.0_f64, |size, b| size.max(b.abs()));
        for (found, wanted) in found.iter().zip(wanted) {
            assert!(
                (found - wanted).abs() < tolerance * size,
                "{found} {wanted}"
            );
        }
    }

    #[test]
    fn wrong_requests_are_refused() {
        let gram = collinear(0).total();
        let how = LeastSquares::ordinary();
        let solve = |columns: &[usize], scales: &[f64]| how.solve(&gram, columns, scales, None);
        let ones = [1.0; 4];
        assert!(matches!(
            solve(&[4], &ones),
            Err(NumericsError::Column {
                column: 4,
                width: 4
            })
        ));
        assert!(matches!(
            solve(&[1, 1], &ones),
            Err(NumericsError::RepeatedColumn { column: 1 })
        ));
        assert!(matches!(
            solve(&[0], &[1.0]),
            Err(NumericsError::Width { .. })
        ));
        assert!(matches!(
            solve(&[0], &[f64::NAN; 4]),
            Err(NumericsError::Scale { column: 0, .. })
        ));
        let negative = LeastSquares::ridge(-1.0).solve(&gram, &[0], &ones, None);
        assert!(matches!(
            negative,
            Err(NumericsError::Parameter { name: "alpha", .. })
        ));
        let none = how.solve(&Gram::new(4), &[0], &ones, None);
        assert!(matches!(none, Err(NumericsError::TooFewRows { .. })));
        let mut broken = gram.clone();
        broken.push(&[f64::NAN, 0.0, 0.0, 0.0], 0.0);
        let broken = how.solve(&broken, &[0], &ones, None);
        assert!(matches!(broken, Err(NumericsError::NotFinite)));
    }
}
