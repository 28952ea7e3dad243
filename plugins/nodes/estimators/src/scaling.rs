//! Decides how a fitted model brings regressors to a common scale, and what makes no scale.

use athermal_core::diagnostic::count;
use athermal_core::node::{Mistake, TrainingReport};
use athermal_core::node::{number, numbers};
use serde::{Deserialize, Serialize};

/// What each regressor varies about and how far, as a model file has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Scaling {
    #[serde(with = "numbers")]
    pub(crate) means: Vec<f64>,
    #[serde(with = "numbers")]
    pub(crate) scales: Vec<f64>,
    /// The mean of the truth, where that is subtracted too.
    #[serde(default, with = "number", skip_serializing_if = "is_zero")]
    pub(crate) truth: f64,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl Scaling {
    /// The scaled values of a row, by their places.
    pub(crate) fn of<'a>(&'a self, row: &'a [f64]) -> impl Fn(usize) -> f64 + 'a {
        |nth| (row[nth] - self.means[nth]) / self.scales[nth]
    }

    /// What is wrong with it for so many regressors.
    pub(crate) fn mistakes(&self, width: usize) -> Vec<Mistake> {
        let mut mistakes = scale_mistakes(width, ("means", &self.means), ("scales", &self.scales));
        if !self.truth.is_finite() {
            let message = format!("`truth` is {} and must be finite", self.truth);
            mistakes.push(Mistake::at("truth", message));
        }
        mistakes
    }
}

/// What is wrong with means and scales of so many regressors.
pub(crate) fn scale_mistakes(
    width: usize,
    means: (&str, &[f64]),
    scales: (&str, &[f64]),
) -> Vec<Mistake> {
    let lists = [(means.0, means.1.len()), (scales.0, scales.1.len())];
    let mut mistakes = Mistake::of_lengths(width, &lists);
    let (at, means) = means;
    if let Some(mean) = means.iter().find(|mean| !mean.is_finite()) {
        let message = format!("`{at}` has {mean} and must have finite values");
        mistakes.push(Mistake::at(at, message));
    }
    let (at, scales) = scales;
    if let Some(scale) = scales
        .iter()
        .find(|scale| !(**scale > 0.0 && scale.is_finite()))
    {
        mistakes.push(Mistake::at(
            at,
            format!("`{at}` has {scale} and must have finite values above 0"),
        ));
    }
    mistakes
}

/// What is wrong with terms whose variables stand at these places, of so many.
pub(crate) fn term_mistake(
    width: usize,
    mut places: impl Iterator<Item = usize>,
) -> Option<Mistake> {
    let place = places.find(|&place| place >= width)?;
    let message = format!("`terms` names regressor {place} and there are {width}, from 0 on");
    Some(Mistake::at("terms", message))
}

/// Tells where regressors are centred and scaled by fewer rows than the fit has: what came after did not fit in memory.
pub(crate) fn tell_first_rows(found_from: usize, rows: u64, report: &mut TrainingReport) {
    if (found_from as u64) < rows {
        report.figure("scaled_by_first_rows", found_from);
        report.notes.push(format!(
            "the rows did not fit in memory, so features are centred and scaled by the first {} of {} rows",
            count(found_from),
            count(rows)
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_scales_and_a_truth_that_are_no_numbers_are_told_each() {
        let fine = Scaling {
            means: vec![0.0, -3.0],
            scales: vec![1.0, 0.5],
            truth: 2.0,
        };
        assert_eq!(fine.mistakes(2), []);
        for value in [f64::NAN, f64::INFINITY] {
            let wrong = Scaling {
                means: vec![0.0, value],
                scales: vec![value, 1.0],
                truth: value,
            };
            let mistakes = wrong.mistakes(2);
            let told: Vec<&str> = mistakes.iter().map(|mistake| &*mistake.message).collect();
            let expected = [
                format!("`means` has {value} and must have finite values"),
                format!("`scales` has {value} and must have finite values above 0"),
                format!("`truth` is {value} and must be finite"),
            ];
            assert_eq!(told, expected);
        }
    }
}
