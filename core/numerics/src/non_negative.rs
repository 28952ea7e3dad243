//! Least squares with coefficients that are not negative, from normal equations. Decides which coefficients are zero; does not
//! decide what the columns are.

use crate::NumericsError;
use crate::normal_equations::Equilibrated;
use faer::Mat;

/// Minimises `‖Xw − y‖²` over `w ≥ 0`, given `XᵀX` row by row and `Xᵀy`.
///
/// An active set, one column in at a time (Lawson and Hanson 1974, chapter 23; on normal equations Bro and de Jong 1997). A
/// column that is a combination of those already in stays out.
///
/// # Errors
/// When the numbers are not finite, or the search does not end.
///
/// # Panics
/// When `gram` has not as many numbers as the square of those of `target`.
pub fn non_negative_least_squares(gram: &[f64], target: &[f64]) -> Result<Vec<f64>, NumericsError> {
    let order = target.len();
    assert_eq!(gram.len(), order * order, "a Gram matrix is square");
    if !gram.iter().chain(target).all(|number| number.is_finite()) {
        return Err(NumericsError::NotFinite);
    }
    let gram = Mat::from_fn(order, order, |i, j| gram[i * order + j]);
    let mut search = Search {
        gram: &gram,
        target,
        weights: vec![0.0; order],
        active: Vec::new(),
        // A column of zeros has nothing to give.
        barred: (0..order).map(|i| gram[(i, i)] <= 0.0).collect(),
    };
    // Each pass lowers the sum of squares, so that no set of columns comes twice; ten times the order is far more than is ever needed.
    for _ in 0..=10 * order.max(1) {
        let Some(next) = search.steepest() else {
            return Ok(search.weights);
        };
        search.admit(next);
    }
    Err(NumericsError::NoConvergence)
}

/// Below this part of the largest gradient at zero, per unit of each column, a column has nothing to give.
const FLAT: f64 = 1e-12;

struct Search<'a> {
    gram: &'a Mat<f64>,
    target: &'a [f64],
    weights: Vec<f64>,
    /// The columns whose coefficients are above zero.
    active: Vec<usize>,
    barred: Vec<bool>,
}

impl Search<'_> {
    /// The column along which the sum of squares falls fastest, per unit of its own length.
    fn steepest(&self) -> Option<usize> {
        let length = |i: usize| self.gram[(i, i)].sqrt();
        let open = (0..self.target.len()).filter(|&i| !self.barred[i]);
        let most = open.clone().map(|i| (self.target[i] / length(i)).abs());
        let least = FLAT * most.fold(0.0, f64::max);
        let slope = |i: usize| {
            let explained: f64 = self
                .active
                .iter()
                .map(|&j| self.gram[(i, j)] * self.weights[j])
                .sum();
            (self.target[i] - explained) / length(i)
        };
        let outside = open.filter(|i| !self.active.contains(i));
        let steepest = outside
            .map(|i| (i, slope(i)))
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        steepest.filter(|&(_, slope)| slope > least).map(|(i, _)| i)
    }

    /// Lets a column in, and those go that would be negative with it.
    fn admit(&mut self, column: usize) {
        self.active.push(column);
        while let Some(&newest) = self.active.last() {
            let Some(solution) = self.solve() else {
                self.bar(newest);
                continue;
            };
            if newest == column
                && self.weights[column] == 0.0
                && solution[self.active.len() - 1] <= 0.0
            {
                // Only rounding made it look as if it had something to give.
                self.bar(column);
                continue;
            }
            let step = self
                .active
                .iter()
                .zip(&solution)
                .filter(|&(_, &to)| to <= 0.0)
                .map(|(&i, &to)| self.weights[i] / (self.weights[i] - to))
                .fold(1.0, f64::min);
            for (&i, to) in self.active.iter().zip(&solution) {
                self.weights[i] += step * (to - self.weights[i]);
            }
            if step == 1.0 {
                return;
            }
            let lowest = self
                .active
                .iter()
                .zip(&solution)
                .filter(|&(_, &to)| to <= 0.0);
            let gone = lowest
                .map(|(&i, _)| i)
                .min_by(|&a, &b| self.weights[a].total_cmp(&self.weights[b]));
            if let Some(gone) = gone {
                self.weights[gone] = 0.0;
                self.active.retain(|&i| i != gone);
            }
        }
    }

    fn bar(&mut self, column: usize) {
        self.barred[column] = true;
        self.weights[column] = 0.0;
        self.active.retain(|&i| i != column);
    }

    /// The coefficients of the active columns without a bound; nothing where they depend on each other.
    fn solve(&self) -> Option<Vec<f64>> {
        let order = self.active.len();
        let part = Mat::from_fn(order, order, |i, j| {
            self.gram[(self.active[i], self.active[j])]
        });
        let target: Vec<f64> = self.active.iter().map(|&i| self.target[i]).collect();
        Equilibrated::of(&part, 0.0).solve(&target, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle;

    fn solve(rows: &[([f64; 3], f64)]) -> Vec<f64> {
        let places = (0..9).map(|place| (place / 3, place % 3));
        let gram: Vec<f64> = places
            .map(|(i, j)| rows.iter().map(|(x, _)| x[i] * x[j]).sum())
            .collect();
        let target: Vec<f64> = (0..3)
            .map(|i| rows.iter().map(|(x, y)| x[i] * y).sum())
            .collect();
        non_negative_least_squares(&gram, &target).unwrap()
    }

    #[test]
    fn what_would_be_negative_is_zero_and_the_rest_is_solved_without_it() {
        let rows = [
            ([1.0, 0.0, 0.5], 2.0),
            ([0.0, 1.0, 0.5], -1.0),
            ([1.0, 1.0, 1.0], 1.0),
            ([2.0, 0.0, 1.0], 4.0),
        ];
        let found = solve(&rows);
        assert!(found.iter().all(|&w| w >= 0.0), "{found:?}");
        // scipy.optimize.nnls of these rows.
        for (found, expected) in found.iter().zip([11.0 / 6.0, 0.0, 0.0]) {
            assert!((found - expected).abs() < 1e-14, "{found} for {expected}");
        }
    }

    #[test]
    fn of_two_equal_columns_one_does_all() {
        let rows = [
            ([1.0, 1.0, 0.0], 2.0),
            ([3.0, 3.0, 0.0], 6.0),
            ([2.0, 2.0, 0.0], 4.0),
        ];
        let found = solve(&rows);
        assert!((found[0] + found[1] - 2.0).abs() < 1e-14, "{found:?}");
        assert!(found[0] == 0.0 || found[1] == 0.0, "{found:?}");
        assert_eq!(found[2], 0.0);
    }

    #[test]
    fn numbers_that_are_none_are_told() {
        let found = non_negative_least_squares(&[f64::NAN], &[1.0]);
        assert_eq!(found, Err(NumericsError::NotFinite));
    }

    /// Rows of a table under `tests/oracles/`, see its `generate.py`.
    fn table(file: &str) -> Vec<Vec<f64>> {
        let text = oracle::own_text(&format!("non_negative/{file}"));
        let row = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect();
        text.lines().map(row).collect()
    }

    #[test]
    fn oracle_of_nearly_collinear_columns() {
        let rows = table("problems.csv");
        let (mut zeros, mut others) = (0, 0);
        for expected in table("expected.csv") {
            let rows = rows.iter().filter(|row| row[0] == expected[0]);
            let rows: Vec<&[f64]> = rows.map(|row| &row[1..]).collect();
            let order = expected.len() - 1;
            let sum = |i: usize, j: usize| rows.iter().map(|row| row[i] * row[j]).sum::<f64>();
            let gram: Vec<f64> = (0..order * order)
                .map(|place| sum(place / order, place % order))
                .collect();
            let target: Vec<f64> = (0..order).map(|i| sum(i, order)).collect();
            let found = non_negative_least_squares(&gram, &target).unwrap();
            for (found, &expected) in found.iter().zip(&expected[1..]) {
                assert!((found - expected).abs() <= 1e-9, "{found} for {expected}");
                assert_eq!(*found == 0.0, expected == 0.0);
                *(if expected == 0.0 {
                    &mut zeros
                } else {
                    &mut others
                }) += 1;
            }
        }
        assert!(zeros > 20 && others > 40, "{zeros} {others}");
    }
}
