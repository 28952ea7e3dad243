//! Decides what a fit takes, and what it reports of the model that it finds; not how that is searched for.

use super::anywhere::beginnings;
use super::begin::Begun;
use super::search::{Judged, TOLERANCE, remembered};
use super::{Orders, Polynomials, PredictionError, PredictionErrorFit, Samples};
use crate::NumericsError;
use crate::checks::{check_parameter, check_penalty};

impl PredictionError {
    /// Fits a model of these orders. The first `first` samples of each segment are not counted, or those before which the
    /// model lacks something, whichever are more: models of several orders that are to be compared need the same.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`], [`NumericsError::Width`] where the inputs are not those of the samples,
    /// [`NumericsError::TooFewRows`], [`NumericsError::NotFinite`].
    pub fn fit(
        &self,
        orders: &Orders,
        samples: &Samples,
        first: usize,
    ) -> Result<PredictionErrorFit, NumericsError> {
        self.fit_beside(orders, samples, first, &[])
    }

    /// The same where models that this one contains are known, which it then errs no more than. Others among them are passed over.
    ///
    /// # Errors
    /// As [`fit`](Self::fit).
    pub fn fit_beside(
        &self,
        orders: &Orders,
        samples: &Samples,
        first: usize,
        known: &[Polynomials],
    ) -> Result<PredictionErrorFit, NumericsError> {
        check_penalty(self.penalty)?;
        let spread = self.start_spread;
        check_parameter("start_spread", spread, spread > 0.0, "above 0")?;
        if orders.inputs.len() != samples.width() {
            return Err(NumericsError::Width {
                expected: orders.inputs.len(),
                found: samples.width(),
            });
        }
        let first = first.max(orders.first());
        let measured = self.measured.max(orders.measured());
        let rows = samples.counted(first, measured);
        // Of which nothing is known beforehand, samples must tell.
        let starts = if self.start_spread.is_infinite() {
            samples.starts(orders, first, measured)
        } else {
            0
        };
        let needed = orders.coefficients() + starts + 2;
        if rows < needed {
            return Err(NumericsError::TooFewRows {
                needed: needed as u64,
                found: rows as u64,
            });
        }
        let radius = remembered(samples);
        let Begun {
            counted,
            start,
            steps: before,
        } = self.begun(orders, samples, first, radius, known)?;
        let (found, steps, converged) = self.search(start, samples, &counted, radius, TOLERANCE);
        let Judged { model, left, .. } = self.polished(found, samples, &counted, radius);
        Ok(PredictionErrorFit {
            residual_sum_of_squares: left.squares,
            squared_errors: left.squared_errors,
            variance_ratio: left.mean,
            beginnings: beginnings(&model, samples, &left.starts),
            model,
            rows,
            first,
            measured,
            starts: left.determined().round() as usize,
            start_counts: counted.starts,
            steps: before + steps,
            converged,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::InputOrders;
    use crate::draws::uniform;

    #[test]
    fn samples_that_do_not_tell_every_start_are_enough_where_something_is_known_of_starts() {
        let (mut samples, mut u) = (Samples::new(1), uniform(7));
        for _ in 0..4 {
            samples.segment();
            (0..2).for_each(|_| samples.push([u()], u()));
        }
        let input = InputOrders {
            nb: 1,
            nf: 1,
            nk: 0,
        };
        let orders = Orders {
            inputs: vec![input],
            ..Orders::default()
        };
        let fit = |start_spread| {
            let search = PredictionError {
                start_spread,
                ..PredictionError::default()
            };
            search.fit(&orders, &samples, 0)
        };
        // Of eight samples three coefficients, four starts and two more.
        let few = NumericsError::TooFewRows {
            needed: 9,
            found: 8,
        };
        assert_eq!(fit(f64::INFINITY), Err(few));
        assert!(fit(1.0).unwrap().variance().is_finite());
    }

    #[test]
    fn a_level_that_is_given_is_kept_and_has_no_standard_error() {
        let (mut samples, mut u, mut value) = (Samples::new(0), uniform(3), 0.0);
        for _ in 0..400 {
            value = 0.8 * value + u();
            samples.push([], 2.0 + value);
        }
        let orders = Orders {
            na: 1,
            nc: 1,
            ..Orders::default()
        };
        let search = |level| PredictionError {
            level,
            ..PredictionError::default()
        };
        let free = search(None).fit(&orders, &samples, 0).unwrap();
        for (level, most) in [(free.model.level, 1.0 + 1e-9), (3.0, 1.2)] {
            let given = search(Some(level));
            let fit = given.fit(&orders, &samples, 0).unwrap();
            assert_eq!(fit.model.level, level);
            let more = fit.residual_sum_of_squares / free.residual_sum_of_squares;
            assert!((1.0 - 1e-9..most).contains(&more), "{level}: {more}");
            let errors = given.standard_errors(&fit, &samples).unwrap();
            assert!(errors.level.is_nan() && errors.a[0] > 0.0, "{errors:?}");
        }
    }
}
