//! Decides what a channel is and how "no value" is written in one; where values come from is decided elsewhere.

use crate::time::Duration;
use crate::unit::Unit;

/// No value: the bits that travel where a sample is missing.
///
/// Every NaN means absent; this one is the form that the framework writes.
pub const ABSENT: f64 = f64::NAN;

/// What a node gives: what is infinite is no value.
#[inline]
pub fn unless_infinite(value: f64) -> f64 {
    if value.is_infinite() { ABSENT } else { value }
}

/// No value *yet*: the window or lag of the channel reaches back before its first value of the segment.
///
/// It is a NaN with a payload of its own, so that whoever only asks "is there a value" need not know it. Fitting keeps
/// the two apart: a cold instant is no evidence of a bad sensor.
pub const COLD: f64 = f64::from_bits(0x7ff8_0000_0000_c01d);

/// No *new* value: what a node that reads only new values sees of a channel that was given nothing at this tick.
///
/// It differs from [`ABSENT`], which such a node sees when the channel's producer ran and had nothing to give.
pub const UNCHANGED: f64 = f64::from_bits(0x7ff8_0000_0000_01d1);

/// No value of a truth: its window holds a leap of what it is taken over, which is no drift.
pub const LEAPT: f64 = f64::from_bits(0x7ff8_0000_0000_1ea9);

/// Whether a value is absent because of a leap in its window.
#[must_use]
pub fn is_leapt(value: f64) -> bool {
    value.to_bits() == LEAPT.to_bits()
}

/// Whether a fresh read found that the channel was given nothing at this tick.
#[must_use]
pub fn is_unchanged(value: f64) -> bool {
    value.to_bits() == UNCHANGED.to_bits()
}

/// Whether a value is absent because its window is still cold.
#[must_use]
pub fn is_cold(value: f64) -> bool {
    value.to_bits() == COLD.to_bits()
}

/// A scalar series: what one output of a node, or one measured quantity, is.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// The name within its port, such as `plate1@150s`.
    pub name: String,
    /// The unit of its values.
    pub unit: Unit,
    /// The length of past time that one value summarises; zero for a measured sample.
    pub span: Duration,
    /// The horizon of a prediction; zero for measured and derived values.
    pub ahead: Duration,
    /// How long a sample of the underlying signal counts, where the signal defines it.
    pub max_age: Option<Duration>,
}

impl Channel {
    /// How long a held value of this channel counts by default: its span where it has one, else what its signal defines.
    #[must_use]
    pub fn default_max_age(&self) -> Option<Duration> {
        if self.span > Duration::ZERO {
            Some(self.span)
        } else {
            self.max_age
        }
    }
}

/// Between which values something lay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extremes {
    /// The lowest value.
    pub lowest: f64,
    /// The highest value.
    pub highest: f64,
}

/// How far apart values are, as a share of their size, that differ by rounding alone.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

impl Extremes {
    /// Those of no value.
    pub const NONE: Self = Self {
        lowest: f64::INFINITY,
        highest: f64::NEG_INFINITY,
    };

    /// Takes a value in; NaN changes nothing.
    #[inline]
    pub fn include(&mut self, value: f64) {
        // NaN is neither below nor above.
        if value < self.lowest {
            self.lowest = value;
        }
        if value > self.highest {
            self.highest = value;
        }
    }

    /// The largest value, in size; 0 without any.
    #[must_use]
    pub fn largest(self) -> f64 {
        self.highest.max(-self.lowest).max(0.0)
    }

    /// Whether there were values, and all of them are the same but for rounding.
    #[must_use]
    pub fn is_one_value(self) -> bool {
        let width = self.highest - self.lowest;
        width.is_finite() && (0.0..=ROUNDING * self.largest()).contains(&width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cold_and_absent_are_both_no_value_but_differ() {
        assert!(ABSENT.is_nan() && COLD.is_nan());
        assert!(is_cold(COLD) && !is_cold(ABSENT) && !is_cold(0.0));
    }

    #[test]
    fn values_that_only_rounding_tells_apart_are_one() {
        let range = |values: &[f64]| {
            let mut range = Extremes::NONE;
            values.iter().for_each(|&value| range.include(value));
            range
        };
        let next = 20.5_f64.next_up();
        for values in [&[0.0, -0.0][..], &[-20.5], &[20.5, next], &[-20.5, -next]] {
            assert!(range(values).is_one_value(), "{values:?}");
        }
        for values in [&[][..], &[0.0, 1e-300], &[-20.5, 20.5], &[20.5, 20.500_001]] {
            assert!(!range(values).is_one_value(), "{values:?}");
        }
        assert!(!range(&[1.0, f64::INFINITY]).is_one_value());
        assert_eq!(range(&[-3.0, 2.0]).largest(), 3.0);
        assert_eq!(range(&[]).largest(), 0.0);
    }
}
