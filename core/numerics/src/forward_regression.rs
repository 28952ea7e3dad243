//! Forward regression by error reduction. Decides which terms a model takes and with which coefficients; does not decide what
//! the terms are.

use crate::checks::check_parameter;
use crate::{Gram, NumericsError};

/// A term whose share that the chosen ones cannot explain is below this does not enter.
const DEPENDENT: f64 = 1e-10;

/// Orthogonal least squares that takes, one after the other, the term that explains most of what is left of the target
/// (Chen, Billings and Luo 1989, section 4). There is no intercept: a constant is a term like the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForwardRegression {
    /// Take at most so many terms, 1 or more.
    pub most: usize,
    /// Stop when the best term left explains a smaller share of the target than this, from 0 to 1.
    pub least_reduction: f64,
}

/// A model of chosen terms.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ForwardModel {
    /// The terms as they were chosen, the best first.
    pub terms: Vec<ErrorReduction>,
    /// The coefficient of each, in the same order.
    pub coefficients: Vec<f64>,
    /// The best term that was not worth it.
    pub refused: Option<ErrorReduction>,
    /// The share of the squared target that the model leaves unexplained.
    pub unexplained: f64,
}

/// A term, and the share of the sum of squares of the target that it explains beyond those before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorReduction {
    /// Its column.
    pub column: usize,
    /// The error-reduction ratio, from 0 to 1.
    pub ratio: f64,
}

impl ForwardRegression {
    /// Chooses among all columns of the rows in `gram`.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`], [`NumericsError::TooFewRows`] without rows, [`NumericsError::NotFinite`].
    pub fn run(&self, gram: &Gram) -> Result<ForwardModel, NumericsError> {
        check_parameter("most", self.most as f64, self.most > 0, "1 or more")?;
        let fine = (0.0..=1.0).contains(&self.least_reduction);
        check_parameter("least_reduction", self.least_reduction, fine, "from 0 to 1")?;
        if gram.count() == 0 {
            return Err(NumericsError::TooFewRows {
                needed: 1,
                found: 0,
            });
        }
        if !gram.is_finite() {
            return Err(NumericsError::NotFinite);
        }
        Ok(Search::over(gram).run(self))
    }
}

/// What is left of every term once the chosen ones are taken out of it.
struct Search {
    /// The products of the terms with those chosen, made orthogonal: for each of these one line.
    chosen: Vec<Line>,
    squares: Vec<f64>,
    own: Vec<f64>,
    /// The products with what is left of the target.
    target: Vec<f64>,
    products: faer::Mat<f64>,
    spread: f64,
}

struct Line {
    reduction: ErrorReduction,
    /// The product of every term with the chosen one, over the square of that.
    shares: Vec<f64>,
    square: f64,
    weight: f64,
}

impl Search {
    fn over(gram: &Gram) -> Self {
        let width = gram.width();
        let products = gram.moments_about(&vec![0.0; width + 1]);
        let own: Vec<f64> = (0..width).map(|j| products[(j, j)]).collect();
        Self {
            chosen: Vec::new(),
            squares: own.clone(),
            own,
            target: (0..width).map(|j| products[(j, width)]).collect(),
            spread: products[(width, width)],
            products,
        }
    }

    fn run(mut self, how: &ForwardRegression) -> ForwardModel {
        let mut refused = None;
        while self.chosen.len() < how.most {
            let Some(best) = self.best() else { break };
            if best.ratio < how.least_reduction {
                refused = Some(best);
                break;
            }
            self.take(best);
        }
        let terms: Vec<ErrorReduction> = self.chosen.iter().map(|line| line.reduction).collect();
        let explained: f64 = terms.iter().map(|term| term.ratio).sum();
        ForwardModel {
            coefficients: self.coefficients(),
            unexplained: (1.0 - explained).max(0.0),
            terms,
            refused,
        }
    }

    fn best(&self) -> Option<ErrorReduction> {
        let open = |&j: &usize| {
            let known = self.chosen.iter().any(|line| line.reduction.column == j);
            !known && self.squares[j] > DEPENDENT * self.own[j]
        };
        let reduction = |column: usize| ErrorReduction {
            column,
            ratio: self.target[column].powi(2) / (self.squares[column] * self.spread),
        };
        let candidates = (0..self.own.len()).filter(open).map(reduction);
        candidates
            .filter(|reduction| reduction.ratio.is_finite())
            .reduce(|a, b| if b.ratio > a.ratio { b } else { a })
    }

    fn take(&mut self, reduction: ErrorReduction) {
        let column = reduction.column;
        let square = self.squares[column];
        let weight = self.target[column] / square;
        let shares: Vec<f64> = (0..self.own.len())
            .map(|j| {
                let explained: f64 = self
                    .chosen
                    .iter()
                    .map(|line| line.shares[column] * line.square * line.shares[j])
                    .sum();
                (self.products[(j, column)] - explained) / square
            })
            .collect();
        for (j, share) in shares.iter().enumerate() {
            self.squares[j] -= share * share * square;
            self.target[j] -= share * square * weight;
        }
        self.chosen.push(Line {
            reduction,
            shares,
            square,
            weight,
        });
    }

    /// From the weights of the orthogonal terms backwards to those of the terms themselves.
    fn coefficients(&self) -> Vec<f64> {
        let mut coefficients: Vec<f64> = self.chosen.iter().map(|line| line.weight).collect();
        for i in (0..coefficients.len()).rev() {
            for later in i + 1..coefficients.len() {
                let column = self.chosen[later].reduction.column;
                coefficients[i] -= self.chosen[i].shares[column] * coefficients[later];
            }
        }
        coefficients
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle;

    fn own() -> (Gram, serde_json::Value) {
        let rows = oracle::own_table("narx/terms.csv").numbers();
        let width = rows[0].len() - 1;
        let mut gram = Gram::new(width);
        for row in rows {
            gram.push(&row[..width], row[width]);
        }
        let text = oracle::own_text("narx/expected.json");
        (gram, serde_json::from_str(&text).unwrap())
    }

    #[test]
    fn terms_ratios_and_coefficients_are_those_of_the_own_oracle() {
        let (gram, expected) = own();
        let numbers = |key: &str| expected[key].as_array().unwrap().clone();
        let how = ForwardRegression {
            most: numbers("order").len(),
            least_reduction: 0.0,
        };
        let found = how.run(&gram).unwrap();
        let order: Vec<u64> = numbers("order")
            .iter()
            .map(|column| column.as_u64().unwrap())
            .collect();
        let columns: Vec<u64> = found.terms.iter().map(|term| term.column as u64).collect();
        assert_eq!(columns, order);
        for (term, ratio) in found.terms.iter().zip(numbers("err")) {
            assert!((term.ratio - ratio.as_f64().unwrap()).abs() < 1e-9);
        }
        for (found, theirs) in found.coefficients.iter().zip(numbers("theta")) {
            let theirs = theirs.as_f64().unwrap();
            assert!(
                (found - theirs).abs() < 1e-7 * theirs.abs().max(1.0),
                "{found} {theirs}"
            );
        }
    }

    #[test]
    fn what_explains_too_little_is_refused_and_told() {
        let (gram, _) = own();
        let how = ForwardRegression {
            most: 30,
            least_reduction: 1e-3,
        };
        let found = how.run(&gram).unwrap();
        assert!(found.terms.iter().all(|term| term.ratio >= 1e-3));
        assert!(found.refused.unwrap().ratio < 1e-3);
        let explained: f64 = found.terms.iter().map(|term| term.ratio).sum();
        assert!((explained + found.unexplained - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_term_that_is_a_combination_of_others_does_not_enter() {
        let mut gram = Gram::new(3);
        for i in 0..200 {
            let (a, b) = ((0.37 * f64::from(i)).sin(), (0.11 * f64::from(i)).cos());
            gram.push(&[a, b, a + b], 3.0 * a + 2.0 * b);
        }
        let how = ForwardRegression {
            most: 3,
            least_reduction: 0.0,
        };
        let found = how.run(&gram).unwrap();
        assert_eq!(found.terms.len(), 2);
        assert!(found.unexplained < 1e-10 && found.coefficients.iter().all(|c| c.is_finite()));
    }

    #[test]
    fn wrong_requests_are_refused() {
        let run = |most, least_reduction| {
            let (gram, _) = own();
            let how = ForwardRegression {
                most,
                least_reduction,
            };
            how.run(&gram)
        };
        assert!(run(0, 0.0).is_err() && run(1, f64::NAN).is_err() && run(1, -0.1).is_err());
        assert!(run(1, 0.0).is_ok());
    }
}
