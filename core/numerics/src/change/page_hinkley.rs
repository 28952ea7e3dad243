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
    /// What remains at each value of how far the sum has gone, above 0, at most 1.
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

/// The test of Page (1954) and Hinkley (1971), both ways: `g_t = max(0, φ g_{t−1} ± (x_t − x̄_t) − δ)`, an alarm where `g_t` is
/// above `λ`. With `φ = 1` it is how far `m_t = m_{t−1} + x_t − x̄_t ∓ δ` has gone from its smallest or largest value.
///
/// Gama et al. (2013) and river let `m_t` fade and not the way from its extreme. Then `m_t` is drawn to `∓δ/(1 − φ)` and comes back
/// from there by chance, which is an alarm where nothing has changed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PageHinkley {
    options: PageHinkleyOptions,
    count: u64,
    mean: f64,
    up: f64,
    down: f64,
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
        Self {
            options,
            count: 0,
            mean: 0.0,
            up: 0.0,
            down: 0.0,
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
        self.up = (factor * self.up + deviation - tolerance).max(0.0);
        self.down = (factor * self.down - deviation - tolerance).max(0.0);
        let change = if self.count < first {
            None
        } else if self.up > threshold {
            Some(MeanChange::Up)
        } else if self.down > threshold {
            Some(MeanChange::Down)
        } else {
            None
        };
        if change.is_some() {
            self.clear();
        }
        change
    }

    /// Begins anew.
    pub fn clear(&mut self) {
        *self = Self::begin(self.options);
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

    /// Values of mean 0 and deviation 1, nearly normal: sums of twelve that are equally likely from −½ to ½.
    fn noise(count: usize) -> impl Iterator<Item = f64> {
        let mut state = 1_u64;
        let mut uniform = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        (0..count).map(move |_| (0..12).map(|_| uniform()).sum())
    }

    #[test]
    fn what_fades_gives_no_alarm_where_nothing_changes() {
        for factor in [0.99, 0.9999, 1.0] {
            let mut test = PageHinkley::new(PageHinkleyOptions {
                tolerance: 0.5,
                threshold: 30.0,
                factor,
                first: 30,
            })
            .unwrap();
            let alarm = noise(200_000).position(|value| test.push(value).is_some());
            assert_eq!(alarm, None, "{factor}");
            let alarm = noise(200).position(|value| test.push(value + 1.0).is_some());
            assert!(alarm.is_some_and(|after| after < 100), "{factor}");
        }
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
