//! Adaptive windowing: the past that has the mean of the present.

use serde::{Deserialize, Serialize};

use super::MeanChange;
use crate::NumericsError;
use crate::checks::check_parameter;

/// How many buckets of a size there are before two of them are put together.
const BUCKETS: usize = 5;
/// Doublings of the size of a bucket that there is room for; 2⁴⁸ values are nine million years of one a second.
const SIZES: usize = 48;

/// How sensitive the window is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdwinOptions {
    /// The probability of a false alarm at a look, between 0 and 1.
    pub confidence: f64,
    /// At every how many values it looks.
    pub clock: u64,
    /// How many values there must have been before an alarm.
    pub first: u64,
    /// The fewest values on either side of a cut.
    pub shortest: u64,
}

impl Default for AdwinOptions {
    fn default() -> Self {
        Self {
            confidence: 0.002,
            clock: 32,
            first: 10,
            shortest: 5,
        }
    }
}

/// Adaptive windowing (Bifet and Gavaldà 2007, ADWIN2): the values since the last change of their mean, in an exponential
/// histogram. There is an alarm where the window has a cut whose sides have means farther apart than chance allows,
/// `ε = √(2/m · σ² · ln(2 ln n / δ)) + 2/(3m) · ln(2 ln n / δ)`, `1/m = 1/(n₁ − s + 1) + 1/(n₂ − s + 1)` of their lengths, `s` being
/// the shortest that is allowed; the window then begins anew, so that one change gives one alarm. Bifet and Gavaldà take the
/// lengths themselves, `s = 1`; river has them less `s − 1`, which makes short sides stand back, and so have the alarms here.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adwin {
    options: AdwinOptions,
    seen: u64,
    window: Part,
    /// By size, each twice the one before; those of a size from the newest to the oldest.
    buckets: Vec<Vec<Part>>,
}

/// The statistics of values in a row.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
struct Part {
    count: u64,
    total: f64,
    /// The sum of squares about the mean.
    squares: f64,
}

impl Part {
    fn mean(self) -> f64 {
        self.total / self.count as f64
    }

    /// The sum of squares that the distance of two means adds.
    fn between(self, other: Self) -> f64 {
        if self.count == 0 || other.count == 0 {
            return 0.0;
        }
        let (a, b) = (self.count as f64, other.count as f64);
        a * b / (a + b) * (self.mean() - other.mean()).powi(2)
    }

    fn with(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            total: self.total + other.total,
            squares: self.squares + other.squares + self.between(other),
        }
    }

    fn without(self, other: Self) -> Self {
        let rest = Self {
            count: self.count - other.count,
            total: self.total - other.total,
            squares: 0.0,
        };
        let squares = self.squares - other.squares - rest.between(other);
        Self {
            squares: squares.max(0.0),
            ..rest
        }
    }
}

impl Adwin {
    /// Before the first value.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`] for options out of range.
    pub fn new(options: AdwinOptions) -> Result<Self, NumericsError> {
        let confidence = options.confidence;
        let fine = confidence > 0.0 && confidence < 1.0;
        check_parameter("confidence", confidence, fine, "between 0 and 1")?;
        for (name, value) in [("clock", options.clock), ("shortest", options.shortest)] {
            check_parameter(name, value as f64, value >= 1, "1 or more")?;
        }
        Ok(Self {
            options,
            seen: 0,
            window: Part::default(),
            buckets: (0..SIZES)
                .map(|_| Vec::with_capacity(BUCKETS + 1))
                .collect(),
        })
    }

    /// Takes a value, without allocating; tells where the mean has gone if it has. A value that is not finite is ignored.
    pub fn push(&mut self, value: f64) -> Option<MeanChange> {
        if !value.is_finite() {
            return None;
        }
        self.seen += 1;
        let one = Part {
            count: 1,
            total: value,
            squares: 0.0,
        };
        self.window = self.window.with(one);
        self.insert(one);
        let looks = self.seen.is_multiple_of(self.options.clock);
        if !looks || self.window.count <= self.options.first {
            return None;
        }
        let change = self.cut();
        if change.is_some() {
            self.clear();
        }
        change
    }

    /// Begins anew.
    pub fn clear(&mut self) {
        self.seen = 0;
        self.window = Part::default();
        self.buckets.iter_mut().for_each(Vec::clear);
    }

    /// The number of values in the window.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.window.count
    }

    /// The mean of the window; NaN before the first value.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.window.mean()
    }

    /// Goes on with other options.
    #[must_use]
    pub fn with(mut self, options: AdwinOptions) -> Self {
        self.options = options;
        // What has been read back must not have to make room later.
        self.buckets
            .iter_mut()
            .for_each(|size| size.reserve(BUCKETS + 1));
        self
    }

    /// How sensitive it is.
    #[must_use]
    pub fn options(&self) -> AdwinOptions {
        self.options
    }

    fn insert(&mut self, mut newest: Part) {
        let sizes = self.buckets.len();
        for (index, size) in self.buckets.iter_mut().enumerate() {
            size.insert(0, newest);
            if size.len() <= BUCKETS || index + 1 == sizes {
                return;
            }
            let (Some(oldest), Some(older)) = (size.pop(), size.pop()) else {
                return;
            };
            newest = older.with(oldest);
        }
    }

    /// Looks for a cut, from the oldest value on.
    fn cut(&self) -> Option<MeanChange> {
        let count = self.window.count as f64;
        let spread = self.window.squares / count;
        let surprise = (2.0 * count.ln() / self.options.confidence).ln();
        let shortest = self.options.shortest;
        let (mut old, mut new) = (Part::default(), self.window);
        for &bucket in self.buckets.iter().rev().flat_map(|size| size.iter().rev()) {
            old = old.with(bucket);
            new = new.without(bucket);
            if new.count < shortest {
                return None;
            }
            if old.count < shortest {
                continue;
            }
            let side = |part: Part| ((part.count - shortest + 1) as f64).recip();
            let inverse = side(old) + side(new);
            let chance =
                (2.0 * inverse * spread * surprise).sqrt() + 2.0 / 3.0 * surprise * inverse;
            let gone = new.mean() - old.mean();
            if gone.abs() > chance {
                return Some(if gone > 0.0 {
                    MeanChange::Up
                } else {
                    MeanChange::Down
                });
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::change::tests::{alarms, ignores_what_is_not_finite};

    #[test]
    fn alarms_are_those_of_the_oracle() {
        let mut window = Adwin::new(AdwinOptions::default()).unwrap();
        let Some(alarms) = alarms(|value| window.push(value)) else {
            return;
        };
        // `adwin_default` of drift_expected.json; the mean goes up at 800 and down at 1500.
        assert_eq!(alarms, [(831, MeanChange::Up), (1535, MeanChange::Down)]);
        assert_eq!(window.count(), 2000 - 1536);
    }

    #[test]
    fn the_window_has_the_statistics_of_its_values() {
        let mut window = Adwin::new(AdwinOptions::default()).unwrap();
        let mut values = Vec::new();
        for i in 0..1000 {
            let value = f64::from(i * 7919 % 101) / 101.0;
            values.push(value);
            window.push(value);
        }
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        assert_eq!(window.count(), 1000);
        assert!((window.mean() - mean).abs() < 1e-12);
        assert!((window.window.squares - squares).abs() < 1e-9 * squares);
        let buckets = window.buckets.iter().flatten();
        let whole = buckets.fold(Part::default(), |sum, &part| sum.with(part));
        assert_eq!(whole.count, 1000);
        assert!((whole.squares - squares).abs() < 1e-9 * squares);
        assert!(window.buckets.iter().all(|size| size.len() <= BUCKETS));
    }

    #[test]
    fn a_value_that_is_not_finite_changes_nothing_and_options_are_checked() {
        let window = Adwin::new(AdwinOptions::default()).unwrap();
        ignores_what_is_not_finite(window, Adwin::push);
        let with = |confidence, clock, shortest| {
            Adwin::new(AdwinOptions {
                confidence,
                clock,
                shortest,
                first: 10,
            })
        };
        assert!(with(0.01, 1, 1).is_ok());
        assert!(with(0.0, 1, 1).is_err() && with(f64::NAN, 1, 1).is_err());
        assert!(with(0.01, 0, 1).is_err() && with(0.01, 1, 0).is_err());
    }
}
