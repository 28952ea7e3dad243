//! Instants and durations in whole nanoseconds, and how durations are written; where times come from is decided elsewhere.

use std::fmt;
use std::ops::{Add, AddAssign, Neg, Sub, SubAssign};
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::decimal_comma;

mod columns;
mod format;
mod zone;

pub use columns::{TimeColumns, TimeColumnsError};
pub use format::{TimeFormat, TimeFormatError};
pub use zone::{Civil, UnknownZone, Zone};

const NS_PER_US: i64 = 1_000;
const NS_PER_MS: i64 = 1_000_000;
const NS_PER_S: i64 = 1_000_000_000;
const NS_PER_MIN: i64 = 60 * NS_PER_S;
const NS_PER_H: i64 = 60 * NS_PER_MIN;
const NS_PER_D: i64 = 24 * NS_PER_H;

/// The spellings of the units of time, each with its length in nanoseconds. `m` is the minute, as in `1h30m`.
const UNITS: [(&str, i64); 10] = [
    ("ns", 1),
    ("us", NS_PER_US),
    ("\u{b5}s", NS_PER_US),
    ("\u{3bc}s", NS_PER_US),
    ("ms", NS_PER_MS),
    ("s", NS_PER_S),
    ("min", NS_PER_MIN),
    ("m", NS_PER_MIN),
    ("h", NS_PER_H),
    ("d", NS_PER_D),
];

/// A point in time: nanoseconds since an origin that the data choose (the Unix epoch for absolute times).
///
/// Arithmetic saturates at the ends of the range, about 292 years on either side of the origin.
/// In serialised form it is the integer number of nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Instant(i64);

impl Instant {
    /// The earliest instant.
    pub const MIN: Instant = Instant(i64::MIN);
    /// The latest instant.
    pub const MAX: Instant = Instant(i64::MAX);

    /// The instant `ns` nanoseconds after the origin.
    pub const fn from_ns(ns: i64) -> Self {
        Instant(ns)
    }

    /// Nanoseconds since the origin.
    pub const fn as_ns(self) -> i64 {
        self.0
    }
}

/// A signed length of time in nanoseconds.
///
/// Arithmetic saturates at about ±292 years. It is written as text, `"5min"` or `"429.089s"`, and read from text only,
/// so that a number without a unit is never taken for seconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Duration(i64);

impl Duration {
    /// No time at all.
    pub const ZERO: Duration = Duration(0);
    /// The longest duration.
    pub const MAX: Duration = Duration(i64::MAX);

    /// A duration of `ns` nanoseconds.
    pub const fn from_ns(ns: i64) -> Self {
        Duration(ns)
    }

    /// The length in nanoseconds.
    pub const fn as_ns(self) -> i64 {
        self.0
    }

    /// The duration nearest to `secs` seconds; `None` if that is not finite or beyond about 292 years.
    pub fn from_secs_f64(secs: f64) -> Option<Self> {
        let ns = (secs * NS_PER_S as f64).round();
        // 2^63 is exact in f64 and is the first value that does not fit.
        (ns >= -(2f64.powi(63)) && ns < 2f64.powi(63)).then_some(Duration(ns as i64))
    }

    /// The length in seconds, rounded to the nearest `f64`.
    pub fn secs(self) -> f64 {
        // Dividing whole seconds and remainder apart would round twice; one division rounds once below 2^53 ns (104 days).
        self.0 as f64 / NS_PER_S as f64
    }

    /// True for a length of zero.
    pub const fn is_zero(self) -> bool {
        self.0 == 0
    }

    /// True for a length below zero.
    pub const fn is_negative(self) -> bool {
        self.0 < 0
    }
}

impl Add<Duration> for Instant {
    type Output = Instant;
    fn add(self, rhs: Duration) -> Instant {
        Instant(self.0.saturating_add(rhs.0))
    }
}

impl Sub<Duration> for Instant {
    type Output = Instant;
    fn sub(self, rhs: Duration) -> Instant {
        Instant(self.0.saturating_sub(rhs.0))
    }
}

impl Sub for Instant {
    type Output = Duration;
    fn sub(self, rhs: Instant) -> Duration {
        Duration(self.0.saturating_sub(rhs.0))
    }
}

impl Add for Duration {
    type Output = Duration;
    fn add(self, rhs: Duration) -> Duration {
        Duration(self.0.saturating_add(rhs.0))
    }
}

impl Sub for Duration {
    type Output = Duration;
    fn sub(self, rhs: Duration) -> Duration {
        Duration(self.0.saturating_sub(rhs.0))
    }
}

impl AddAssign for Duration {
    fn add_assign(&mut self, rhs: Duration) {
        *self = *self + rhs;
    }
}

impl SubAssign for Duration {
    fn sub_assign(&mut self, rhs: Duration) {
        *self = *self - rhs;
    }
}

impl Neg for Duration {
    type Output = Duration;
    fn neg(self) -> Duration {
        Duration(self.0.saturating_neg())
    }
}

/// Why a text is not a duration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DurationError {
    /// The text is empty.
    Empty,
    /// A number stands where no unit follows.
    NoUnit {
        /// The number.
        number: String,
    },
    /// Something stands where a number was due.
    NoNumber {
        /// What was found.
        found: String,
    },
    /// A unit that is not one of time.
    UnknownUnit {
        /// The unit as written.
        unit: String,
    },
    /// A minus sign.
    Negative,
    /// Longer than about 292 years.
    TooLong,
    /// Finer than a nanosecond.
    TooFine,
    /// Units out of order or twice, as in `5s1h`.
    Order {
        /// The unit that came too late.
        unit: String,
    },
    /// A comma stands where a decimal point belongs.
    DecimalComma {
        /// What was found.
        found: String,
        /// The same with a point.
        instead: String,
    },
}

impl DurationError {
    /// What is wrong, without the advice.
    pub fn reason(&self) -> String {
        match self {
            Self::DecimalComma { found, .. } => decimal_comma::reason(found),
            other => other.to_string(),
        }
    }

    /// What to write instead, in a sentence, where that is known.
    pub fn help(&self) -> Option<String> {
        match self {
            Self::DecimalComma { instead, .. } => Some(decimal_comma::help(instead)),
            Self::Negative => Some(
                "what is ahead is known of plans alone: only a `lag` may be negative, of a signal with `known_ahead`".to_owned(),
            ),
            _ => None,
        }
    }
}

impl fmt::Display for DurationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const ALLOWED: &str = "the units are ns, us, ms, s, min (or m), h and d";
        match self {
            Self::Empty => write!(
                f,
                "a duration is a number and a unit, e.g. \"5min\", found an empty text"
            ),
            Self::NoUnit { number } => write!(
                f,
                "the number {number} needs a unit of time, e.g. \"{number}s\"; {ALLOWED}"
            ),
            Self::NoNumber { found } => write!(
                f,
                "a duration is a number and a unit, e.g. \"5min\", found \"{found}\""
            ),
            Self::UnknownUnit { unit } => write!(f, "\"{unit}\" is not a unit of time; {ALLOWED}"),
            Self::Negative => write!(f, "a duration here is 0 or more, found a negative one"),
            Self::DecimalComma { found, instead } => {
                let (reason, help) = (decimal_comma::reason(found), decimal_comma::help(instead));
                write!(f, "{reason}; {help}")
            }
            Self::TooLong => write!(f, "a duration is at most 106751 d (292 years)"),
            Self::TooFine => write!(f, "a duration is a whole number of nanoseconds"),
            Self::Order { unit } => {
                write!(
                    f,
                    "units go from large to small, each once, as in \"1h30m\"; \"{unit}\" is out of order"
                )
            }
        }
    }
}

impl std::error::Error for DurationError {}

impl FromStr for Duration {
    type Err = DurationError;

    fn from_str(text: &str) -> Result<Self, DurationError> {
        Self::read(text).map_err(|error| match decimal_comma::with_point(text) {
            Some(instead)
                if matches!(
                    Self::read(&instead),
                    Ok(_) | Err(DurationError::NoUnit { .. })
                ) =>
            {
                let found = excerpt(text.trim());
                DurationError::DecimalComma { found, instead }
            }
            _ => error,
        })
    }
}

impl Duration {
    fn read(text: &str) -> Result<Self, DurationError> {
        let mut rest = text.trim();
        if rest.is_empty() {
            return Err(DurationError::Empty);
        }
        if rest.starts_with(['-', '\u{2212}']) {
            return Err(DurationError::Negative);
        }
        let mut total: i64 = 0;
        let mut previous = i64::MAX;
        while !rest.is_empty() {
            let digits = rest
                .find(|c: char| !c.is_ascii_digit() && c != '.')
                .unwrap_or(rest.len());
            let (number, tail) = rest.split_at(digits);
            if !number.contains(|c: char| c.is_ascii_digit()) {
                return Err(DurationError::NoNumber {
                    found: excerpt(rest),
                });
            }
            let tail = tail.trim_start();
            let letters = tail
                .find(|c: char| !c.is_alphabetic())
                .unwrap_or(tail.len());
            let (unit, tail) = tail.split_at(letters);
            if unit.is_empty() {
                return Err(match tail.chars().next() {
                    None => DurationError::NoUnit {
                        number: excerpt(number),
                    },
                    Some(_) => DurationError::NoNumber {
                        found: excerpt(rest),
                    },
                });
            }
            let Some(&(_, scale)) = UNITS.iter().find(|(name, _)| *name == unit) else {
                return Err(DurationError::UnknownUnit {
                    unit: excerpt(unit),
                });
            };
            if scale >= previous {
                return Err(DurationError::Order {
                    unit: unit.to_owned(),
                });
            }
            previous = scale;
            total = total
                .checked_add(scaled(number, scale)?)
                .ok_or(DurationError::TooLong)?;
            rest = tail.trim_start();
        }
        Ok(Duration(total))
    }
}

/// The decimal `number` times `scale`, exactly.
fn scaled(number: &str, scale: i64) -> Result<i64, DurationError> {
    let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
    if fraction.contains('.') {
        return Err(DurationError::NoNumber {
            found: excerpt(number),
        });
    }
    let mut total: i128 = 0;
    for digit in whole.bytes() {
        total = total * 10 + i128::from(digit - b'0');
        if total > i128::from(i64::MAX) {
            return Err(DurationError::TooLong);
        }
    }
    total *= i128::from(scale);
    let fraction = fraction.trim_end_matches('0');
    if !fraction.is_empty() {
        // A day has fewer than 20 factors of 2 and of 5 in nanoseconds: with more decimals no fraction of it is whole.
        if fraction.len() > 20 {
            return Err(DurationError::TooFine);
        }
        let mut parts: i128 = 0;
        let mut whole_parts: i128 = 1;
        for digit in fraction.bytes() {
            parts = parts * 10 + i128::from(digit - b'0');
            whole_parts *= 10;
        }
        let product = parts
            .checked_mul(i128::from(scale))
            .ok_or(DurationError::TooFine)?;
        if product % whole_parts != 0 {
            return Err(DurationError::TooFine);
        }
        total += product / whole_parts;
    }
    i64::try_from(total).map_err(|_| DurationError::TooLong)
}

/// At most 40 characters of `text`, so that an error about a long text stays short.
fn excerpt(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}\u{2026}", &text[..end]),
        None => text.to_owned(),
    }
}

impl fmt::Display for Duration {
    /// A short exact form: whole minutes in `d`, `h` and `min`, all else with decimals in the largest of `s`, `ms`, `us` and `ns` that it reaches.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ns = self.0.unsigned_abs();
        if self.is_negative() {
            f.write_str("-")?;
        }
        if ns > 0 && ns.is_multiple_of(NS_PER_D.unsigned_abs()) {
            return write!(f, "{}d", ns / NS_PER_D.unsigned_abs());
        }
        if ns > 0 && ns.is_multiple_of(NS_PER_MIN.unsigned_abs()) {
            let (hours, minutes) = (
                ns / NS_PER_H.unsigned_abs(),
                ns % NS_PER_H.unsigned_abs() / NS_PER_MIN.unsigned_abs(),
            );
            if hours > 0 {
                write!(f, "{hours}h")?;
            }
            return if minutes > 0 {
                write!(f, "{minutes}min")
            } else {
                Ok(())
            };
        }
        let decimal_units = [
            ("s", NS_PER_S),
            ("ms", NS_PER_MS),
            ("us", NS_PER_US),
            ("ns", 1),
        ];
        let (name, scale) = decimal_units
            .into_iter()
            .find(|(_, scale)| ns >= scale.unsigned_abs())
            .unwrap_or(("s", NS_PER_S));
        write_decimal(f, ns, scale.unsigned_abs())?;
        f.write_str(name)
    }
}

impl fmt::Display for Instant {
    /// The exact number of seconds since the origin, without a unit: `1700000000.123456789`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 < 0 {
            f.write_str("-")?;
        }
        write_decimal(f, self.0.unsigned_abs(), NS_PER_S.unsigned_abs())
    }
}

/// `ns` in a unit of a power of ten nanoseconds, with as many decimals as it takes.
fn write_decimal(f: &mut fmt::Formatter<'_>, ns: u64, scale: u64) -> fmt::Result {
    let (whole, mut rest) = (ns / scale, ns % scale);
    write!(f, "{whole}")?;
    if rest == 0 {
        return Ok(());
    }
    let mut width = scale.ilog10() as usize;
    while rest.is_multiple_of(10) {
        (rest, width) = (rest / 10, width - 1);
    }
    write!(f, ".{rest:0width$}")
}

impl Serialize for Duration {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl Duration {
    /// The name by which a deserializer knows the type.
    pub(crate) const TYPE: &str = "athermal::Duration";
    /// What a message names as expected.
    pub(crate) const EXPECTED: &str = "a duration like \"5min\"";
}

impl<'de> Deserialize<'de> for Duration {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Duration;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(Duration::EXPECTED)
            }
            fn visit_newtype_struct<D: Deserializer<'de>>(
                self,
                of: D,
            ) -> Result<Duration, D::Error> {
                of.deserialize_str(self)
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<Duration, E> {
                text.parse().map_err(E::custom)
            }
        }
        deserializer.deserialize_newtype_struct(Duration::TYPE, Visitor)
    }
}

#[cfg(test)]
mod tests;
