//! How much regressors stand in for each other. Decides the figures; does not decide what is done about it.

use crate::normal_equations::{Problem, condition_of};
use crate::{Gram, NumericsError};
use faer::Side;

/// How much the columns of a design stand in for each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Collinearity {
    /// The condition number of the standardised design; infinite when it is singular.
    pub condition: f64,
    /// The variance inflation factor of each column, `1 / (1 − R²)` of its regression on the others (Marquardt 1970): how many times
    /// the variance of its coefficient is what it would be alone. 1 where it is unrelated to the others, infinite where it is a
    /// combination of them, NaN where it is constant.
    pub inflation: Vec<f64>,
}

impl Collinearity {
    /// Of `columns` of the rows in `gram`.
    ///
    /// # Errors
    /// [`NumericsError::Column`], [`NumericsError::NotFinite`], [`NumericsError::TooFewRows`] without rows,
    /// [`NumericsError::NoConvergence`].
    pub fn of(gram: &Gram, columns: &[usize]) -> Result<Self, NumericsError> {
        let width = gram.width();
        if let Some(&column) = columns.iter().find(|&&column| column >= width) {
            return Err(NumericsError::Column { column, width });
        }
        if gram.count() == 0 {
            return Err(NumericsError::TooFewRows {
                needed: 1,
                found: 0,
            });
        }
        if !gram.is_finite() {
            return Err(NumericsError::NotFinite);
        }
        let problem = Problem::new(true, gram, columns, &vec![1.0; width]);
        if problem.active.is_empty() {
            return Ok(Self {
                condition: f64::NAN,
                inflation: vec![f64::NAN; columns.len()],
            });
        }
        let condition = condition_of(&problem.standard)?;
        let eigen = problem
            .standard
            .self_adjoint_eigen(Side::Lower)
            .map_err(|_| NumericsError::NoConvergence)?;
        let (vectors, values) = (eigen.U(), eigen.S().column_vector());
        let order = problem.active.len();
        let largest = values[order - 1];
        let rounding = f64::EPSILON * order as f64 * largest;
        // The diagonal of the inverse correlation matrix, direction by direction.
        let inverse = |row: usize| -> f64 {
            let terms = (0..order).map(|k| {
                let share = vectors[(row, k)] * vectors[(row, k)];
                match values[k] > rounding {
                    true => share / values[k],
                    false if share > rounding => f64::INFINITY,
                    false => 0.0,
                }
            });
            terms.sum()
        };
        let mut inflation = vec![f64::NAN; columns.len()];
        for (row, &position) in problem.active.iter().enumerate() {
            inflation[position] = inverse(row);
        }
        Ok(Self {
            condition,
            inflation,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GramBlocks, oracle};

    fn gram(rows: impl Iterator<Item = [f64; 4]>) -> Gram {
        let mut blocks = GramBlocks::new(4);
        for row in rows {
            blocks.push(&row, 0.0);
        }
        blocks.total()
    }

    #[test]
    fn inflation_and_condition_are_those_of_the_oracle() {
        let input = oracle::own_table("collinearity/input.csv").numbers();
        let expected = oracle::own_table("collinearity/expected.csv").numbers();
        let found = gram(input.iter().map(|row| [row[0], row[1], row[2], row[3]]));
        let found = Collinearity::of(&found, &[0, 1, 2, 3]).unwrap();
        let [expected, condition] = [&expected[0][..4], &expected[0][4..]];
        for (found, expected) in found.inflation.iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        }
        assert!((found.condition / condition[0] - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_combination_has_infinite_inflation_and_a_bystander_has_none() {
        let wave = |i: u32, by: f64| (f64::from(i) * by).sin();
        let found = gram((0..4000).map(|i| {
            let (a, b) = (wave(i, 0.7), wave(i, 1.3));
            [a, b, a + b, wave(i, 2.9)]
        }));
        let found = Collinearity::of(&found, &[0, 1, 2, 3]).unwrap();
        assert_eq!(found.condition, f64::INFINITY);
        assert!(found.inflation[..3].iter().all(|factor| *factor > 1e12));
        assert!((found.inflation[3] - 1.0).abs() < 0.01);
    }

    #[test]
    fn of_columns_that_all_stay_as_they_are_nothing_is_known() {
        let found = gram((0..100).map(|_| [1.0, 5.0, 2.0, 1.0]));
        let found = Collinearity::of(&found, &[0, 1]).unwrap();
        assert!(found.condition.is_nan() && found.inflation.iter().all(|of| of.is_nan()));
    }

    #[test]
    fn a_constant_column_is_told_apart_and_no_rows_are_refused() {
        let found = gram((0..100).map(|i| [f64::from(i), 5.0, f64::from(i % 3), 1.0]));
        let found = Collinearity::of(&found, &[0, 1, 2]).unwrap();
        assert!(found.inflation[1].is_nan() && found.inflation[0] >= 1.0);
        assert!(Collinearity::of(&Gram::new(2), &[0]).is_err());
        assert!(Collinearity::of(&Gram::new(2), &[2]).is_err());
    }
}
