//! The test of Page and Hinkley: cumulative sums of deviations from the running mean.

use serde::{Deserialize, Serialize};

use super::MeanChange;
use crate::NumericsError;
use crate::checks::check_parameter;

/// How sensitive the test is, in the unit of the series.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PageHinkleyOptions {
    /// How many values there must have been before an alarm.
    pub first: u64,
    /// A change of the mean that is not worth an alarm, 0 or more.
    pub tolerance: f64,
    /// How far the cumulative sum must have gone from its extreme, above 0.
    pub threshold: f64,
    /// What remains of the cumulative sum at each value, above 0, at most 1.
    pub factor: f64,
}

impl Default for PageHinkleyOptions {
    fn default() -> Self {
        Self {
            first: 30,
            tolerance: 0.005,
            threshold: 50.0,
            factor: 0.9999,
        }
    }
}

/// The test of Page (1954) and Hinkley (1971), both ways, with the fading sums of Gama et al. (2013):
/// `m_t = φ m_{t−1} + x_t − x̄_t ∓ δ`, an alarm where `m_t` has gone `λ` from its smallest or largest value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PageHinkley {
    options: PageHinkleyOptions,
    count: u64,
    mean: f64,
    up: f64,
    lowest: f64,
    down: f64,
    highest: f64,
}

impl PageHinkley {
    /// Before the first value.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`] for options out of range.
    pub fn new(options: PageHinkleyOptions) -> Result<Self, NumericsError> {
        let PageHinkleyOptions {
            tolerance,
            threshold,
            factor,
            ..
        } = options;
        let fine = tolerance >= 0.0 && tolerance.is_finite();
        check_parameter("tolerance", tolerance, fine, "0 or more")?;
        let fine = threshold > 0.0 && threshold.is_finite();
        check_parameter("threshold", threshold, fine, "above 0")?;
        let fine = factor > 0.0 && factor <= 1.0;
        check_parameter("factor", factor, fine, "above 0 and at most 1")?;
        Ok(Self::begin(options))
    }

    fn begin(options: PageHinkleyOptions) -> Self {
        // The sums are 0 before the first value, whose own deviation is 0.
        Self {
            options,
            count: 0,
            mean: 0.0,
            up: 0.0,
            lowest: f64::MAX,
            down: 0.0,
            highest: f64::MIN,
        }
    }

    /// Takes a value; the test begins anew after an alarm. A value that is not finite is ignored.
    pub fn push(&mut self, value: f64) -> Option<MeanChange> {
        if !value.is_finite() {
            return None;
        }
        let PageHinkleyOptions {
            first,
            tolerance,
            threshold,
            factor,
        } = self.options;
        self.count += 1;
        self.mean += (value - self.mean) / self.count as f64;
        let deviation = value - self.mean;
        self.up = factor * self.up + deviation - tolerance;
        self.down = factor * self.down + deviation + tolerance;
        self.lowest = self.lowest.min(self.up);
        self.highest = self.highest.max(self.down);
        let change = if self.count < first {
            None
        } else if self.up - self.lowest > threshold {
            Some(MeanChange::Up)
        } else if self.highest - self.down > threshold {
            Some(MeanChange::Down)
        } else {
            None
        };
        if change.is_some() {
            *self = Self::begin(self.options);
        }
        change
    }

    /// Goes on with other options.
    #[must_use]
    pub fn with(mut self, options: PageHinkleyOptions) -> Self {
        self.options = options;
        self
    }

    /// How sensitive it is.
    #[must_use]
    pub fn options(&self) -> PageHinkleyOptions {
        self.options
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::change::tests::{alarms, ignores_what_is_not_finite};

    #[test]
    fn alarms_are_those_of_the_oracle() {
        let mut test = PageHinkley::new(PageHinkleyOptions::default()).unwrap();
        let Some(alarms) = alarms(|value| test.push(value)) else {
            return;
        };
        // `page_hinkley_default` of drift_expected.json; the mean goes up at 800 and down at 1500.
        assert_eq!(alarms, [(833, MeanChange::Up), (1505, MeanChange::Down)]);
    }

    #[test]
    fn a_value_that_is_not_finite_changes_nothing_and_options_are_checked() {
        let test = PageHinkley::new(PageHinkleyOptions::default()).unwrap();
        ignores_what_is_not_finite(test, PageHinkley::push);
        let with = |tolerance, threshold, factor| {
            PageHinkley::new(PageHinkleyOptions {
                tolerance,
                threshold,
                factor,
                first: 30,
            })
        };
        assert!(with(0.0, 1.0, 1.0).is_ok());
        assert!(with(-1.0, 1.0, 1.0).is_err() && with(f64::NAN, 1.0, 1.0).is_err());
        assert!(with(0.0, 0.0, 1.0).is_err() && with(0.0, 1.0, 1.1).is_err());
    }
}
