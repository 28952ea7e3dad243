//! Means and scales of columns. Decides what counts as constant; does not decide whether columns are scaled.

use crate::Gram;
use serde::{Deserialize, Serialize};

/// Mean, population variance and scale of each column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Standardization {
    /// The mean of each column, in its unit.
    pub means: Vec<f64>,
    /// The population variance of each column.
    pub variances: Vec<f64>,
    /// The root of the variance, 1 for a constant column.
    pub scales: Vec<f64>,
}

impl Standardization {
    /// Of the regressors (without the target) of the rows in `gram`.
    pub fn of(gram: &Gram) -> Self {
        let mut means = gram.means();
        let mut variances = gram.variances();
        means.truncate(gram.width());
        variances.truncate(gram.width());
        Self::from_moments(means, variances)
    }

    fn from_moments(means: Vec<f64>, variances: Vec<f64>) -> Self {
        let scales = variances
            .iter()
            .map(|&v| if v > 0.0 { v.sqrt() } else { 1.0 })
            .collect();
        Self {
            means,
            variances,
            scales,
        }
    }

    /// Replaces each value by its distance from the mean in scales; NaN stays NaN.
    ///
    /// # Panics
    /// When the row has not one value per column.
    pub fn apply(&self, row: &mut [f64]) {
        assert_eq!(row.len(), self.means.len(), "a row has a value per column");
        for ((value, mean), scale) in row.iter_mut().zip(&self.means).zip(&self.scales) {
            *value = (*value - mean) / scale;
        }
    }
}

/// Means and variances of a stream of rows; NaN is left out, column by column.
///
/// The recurrence is that of Welford (1962), "Note on a method for calculating corrected sums of squares and products".
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Standardizer {
    columns: Vec<Running>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
struct Running {
    seen: u64,
    mean: f64,
    squares: f64,
}

impl Standardizer {
    /// No rows yet, of `width` columns.
    pub fn new(width: usize) -> Self {
        Self {
            columns: vec![Running::default(); width],
        }
    }

    /// Adds one row.
    ///
    /// # Panics
    /// When the row has not one value per column.
    pub fn partial_fit(&mut self, row: &[f64]) {
        assert_eq!(
            row.len(),
            self.columns.len(),
            "a row has a value per column"
        );
        for (column, &value) in self.columns.iter_mut().zip(row) {
            if !value.is_nan() {
                column.seen += 1;
                let before = value - column.mean;
                column.mean += before / column.seen as f64;
                column.squares += before * (value - column.mean);
            }
        }
    }

    /// How many values each column had.
    pub fn seen(&self) -> Vec<u64> {
        self.columns.iter().map(|c| c.seen).collect()
    }

    /// What the rows so far give; mean 0 and scale 1 for a column without any value.
    pub fn standardization(&self) -> Standardization {
        let means = self.columns.iter().map(|c| c.mean).collect();
        let variances = self
            .columns
            .iter()
            .map(|c| {
                // Rounding of the mean alone can leave so much behind.
                let rounding = c.seen as f64 * (c.mean * f64::EPSILON).powi(2);
                if c.seen == 0 || c.squares <= c.seen as f64 * rounding {
                    0.0
                } else {
                    c.squares / c.seen as f64
                }
            })
            .collect();
        Standardization::from_moments(means, variances)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle;

    fn close(found: f64, expected: f64) {
        assert!(
            (found - expected).abs() <= 1e-12 * expected.abs().max(1.0),
            "{found} is not {expected}"
        );
    }

    fn compare(found: &Standardization, params: &oracle::Table) {
        for (j, row) in params.numbers().iter().enumerate() {
            close(found.means[j], row[1]);
            close(found.variances[j], row[2]);
            close(found.scales[j], row[3]);
        }
        assert_eq!(params.records.len(), found.scales.len());
    }

    #[test]
    fn a_gram_gives_the_scales_of_the_oracle() {
        let Some(input) = oracle::table("standard_scaler/input.csv") else {
            return;
        };
        let params = oracle::table("standard_scaler/params.csv").unwrap();
        let expected = oracle::table("standard_scaler/expected.csv").unwrap();
        let mut gram = Gram::new(4);
        for row in input.numbers() {
            gram.push(&row, 0.0);
        }
        let found = Standardization::of(&gram);
        compare(&found, &params);
        for (mut row, scaled) in input.numbers().into_iter().zip(expected.numbers()) {
            found.apply(&mut row);
            for (a, b) in row.iter().zip(&scaled) {
                assert!((a - b).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn missing_values_are_left_out_as_in_the_oracle() {
        let Some(input) = oracle::table("standard_scaler/nan_input.csv") else {
            return;
        };
        let params = oracle::table("standard_scaler/nan_params.csv").unwrap();
        let mut stream = Standardizer::new(4);
        for row in input.numbers() {
            stream.partial_fit(&row);
        }
        compare(&stream.standardization(), &params);
        let seen: Vec<f64> = params.numbers().iter().map(|row| row[4]).collect();
        let found: Vec<f64> = stream.seen().iter().map(|&n| n as f64).collect();
        assert_eq!(found, seen);
    }

    #[test]
    fn partial_fits_follow_the_oracle() {
        let Some(input) = oracle::table("standard_scaler/input.csv") else {
            return;
        };
        let steps = oracle::table("standard_scaler/partial_fit_steps.csv").unwrap();
        let mut stream = Standardizer::new(4);
        let mut compared = 0;
        for (index, row) in input.numbers().iter().enumerate() {
            stream.partial_fit(row);
            let step = steps
                .numbers()
                .into_iter()
                .find(|s| s[0] == (index + 1) as f64);
            if let Some(step) = step {
                let found = stream.standardization();
                for j in 0..4 {
                    close(found.means[j], step[1 + j]);
                    close(found.variances[j], step[5 + j]);
                }
                compared += 1;
            }
        }
        assert_eq!(compared, steps.records.len());
    }

    #[test]
    fn a_constant_column_far_from_zero_has_scale_one() {
        let mut stream = Standardizer::new(1);
        let mut gram = Gram::new(1);
        for _ in 0..1000 {
            stream.partial_fit(&[0.1 + 1e6]);
            gram.push(&[0.1 + 1e6], 0.0);
        }
        assert_eq!(stream.standardization().scales, [1.0]);
        assert_eq!(Standardization::of(&gram).scales, [1.0]);
    }
}
