//! Decides which identified models can be, and what one predicts that is not followed.

use athermal_core::node::{Coefficients, Learner, Mistake, Predictor};
use athermal_core::time::Duration;

use super::coefficients;
use super::follow::Following;
use super::model::{Identified, MOST_DIFFERENCES, MOST_SERIES};
use crate::novelty::{novelty_at, novelty_mistakes};
use crate::order::LARGEST;

impl Predictor for Identified {
    fn uses(&self) -> &[String] {
        &self.regressors
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let width = self.regressors.len();
        let mut mistakes = self.scaling.mistakes(width);
        let inputs = &self.model.inputs;
        mistakes.extend(Mistake::of_lengths(width, &[("inputs", inputs.len())]));
        if !self.beginnings.is_empty() {
            let beginnings = [("beginnings", self.beginnings.len())];
            mistakes.extend(Mistake::of_lengths(width, &beginnings));
        }
        let delays = inputs
            .iter()
            .map(|input| ("delay", input.delay, 0..=LARGEST));
        let others = [
            ("differences", self.model.differences, 0..=MOST_DIFFERENCES),
            ("series", self.series, 1..=MOST_SERIES),
        ];
        for (at, found, allowed) in delays.chain(others) {
            if !allowed.contains(&found) {
                let (least, most) = allowed.into_inner();
                let message = format!("`{at}` is {found} and must be {least} to {most}");
                mistakes.push(Mistake::at(at, message));
            }
        }
        if self.step <= Duration::ZERO {
            let message = format!("`step` is {} and must be greater than 0", self.step);
            mistakes.push(Mistake::at("step", message));
        }
        mistakes.extend(coefficients::mistakes(self));
        mistakes.extend(novelty_mistakes(self.novelty.as_ref(), width));
        if self.deviations.is_empty() {
            mistakes.push(Mistake::at("deviations", "`deviations` has no value"));
        }
        if let Some(wrong) = self.deviations.iter().find(|of| **of < 0.0) {
            let message = format!("`deviations` has {wrong} and none may be negative");
            mistakes.push(Mistake::at("deviations", message));
        }
        mistakes
    }

    fn predict(&self, regressors: &[f64]) -> f64 {
        self.at_rest(regressors)
    }

    fn std_dev(&self, _regressors: &[f64]) -> f64 {
        self.deviations.last().copied().unwrap_or(f64::NAN)
    }

    fn novelty(&self, regressors: &[f64]) -> f64 {
        novelty_at(self.novelty.as_ref(), regressors)
    }

    fn centre(&self) -> f64 {
        self.model.at_rest(|_| 0.0)
    }

    fn coefficients(&self) -> Option<Coefficients> {
        Some(coefficients::coefficients(self))
    }

    fn learner(&self) -> Option<Box<dyn Learner>> {
        Some(Box::new(Following::new(self)))
    }
}

athermal_core::predictor!(Identified, "identified");

#[cfg(test)]
mod tests {
    use athermal_core::time::Duration;
    use athermal_numerics::Polynomials;

    use super::super::model::identified;
    use super::*;

    #[test]
    fn a_polynomial_without_standard_errors_is_no_mistake_and_one_with_too_few_is() {
        let mut model = identified(Duration::from_ns(1_000_000_000));
        model.model.a = vec![-0.9, 0.1];
        for (errors, mistakes) in [(vec![], 0), (vec![0.1], 1), (vec![0.1, 0.2], 0)] {
            model.errors = Some(Polynomials {
                a: errors,
                ..model.model.clone()
            });
            assert_eq!(model.mistakes().len(), mistakes);
        }
    }

    #[test]
    fn a_deviation_that_is_negative_is_a_mistake() {
        let mut model = identified(Duration::from_ns(1_000_000_000));
        for (deviations, mistakes) in [(vec![], 1), (vec![1.0, -0.5], 1), (vec![0.0], 0)] {
            model.deviations = deviations;
            assert_eq!(model.mistakes().len(), mistakes);
        }
    }
}
