//! A number with its unit, as in "150 nm/min"; which units a place accepts is decided there.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::decimal_comma;
use crate::unit::{Unit, UnitError};

/// A finite number and its unit. It is written and read as one text: `"150 nm/min"`, `"-20 Cel"`, `"5e-3 K"`.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// The number, in `unit`; finite.
    pub value: f64,
    /// The unit of `value`.
    pub unit: Unit,
}

impl Quantity {
    /// The value in another unit, or `None` if the two do not measure the same. Points on a temperature scale keep their offset.
    pub fn in_unit(&self, unit: &Unit) -> Option<f64> {
        self.unit.convert(self.value, unit)
    }

    /// The value as a difference, or as a size about zero, in another unit, or `None` if the two do not measure the same: 2 Cel
    /// are 2 K.
    pub fn as_difference(&self, unit: &Unit) -> Option<f64> {
        let factor = self.unit.factor_to(unit)?;
        Some(self.value * factor)
    }
}

/// Why a text is not a quantity.
#[derive(Debug, Clone, PartialEq)]
pub enum QuantityError {
    /// The text is empty.
    Empty,
    /// The text does not begin with a number.
    NoNumber {
        /// What was found.
        found: String,
    },
    /// The number stands alone.
    NoUnit {
        /// The number as written.
        number: String,
    },
    /// NaN or infinite, or too large for a double.
    NotFinite {
        /// The number as written.
        number: String,
    },
    /// A comma stands where a decimal point belongs.
    DecimalComma {
        /// What was found.
        found: String,
        /// The same with a point.
        instead: String,
    },
    /// The unit is not understood.
    Unit(UnitError),
}

impl QuantityError {
    /// What is wrong, without the advice.
    pub fn reason(&self) -> String {
        match self {
            Self::Unit(error) => error.reason(),
            Self::DecimalComma { found, .. } => decimal_comma::reason(found),
            other => other.to_string(),
        }
    }

    /// What to write instead, in a sentence, where that is known.
    pub fn help(&self) -> Option<String> {
        match self {
            Self::Unit(error) => error.help(),
            Self::DecimalComma { instead, .. } => Some(decimal_comma::help(instead)),
            _ => None,
        }
    }
}

impl fmt::Display for QuantityError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(
                f,
                "a quantity is a number and a unit, e.g. \"150 nm/min\", found an empty text"
            ),
            Self::NoNumber { found } => {
                write!(
                    f,
                    "a quantity is a number and a unit, e.g. \"150 nm/min\", found \"{found}\""
                )
            }
            Self::NoUnit { number } => write!(
                f,
                "the number {number} needs a unit, e.g. \"{number} nm/min\" (\"{number} 1\" if it has none)"
            ),
            Self::NotFinite { number } => {
                write!(f, "a quantity is a finite number, found {number}")
            }
            Self::DecimalComma { found, instead } => {
                let (reason, help) = (decimal_comma::reason(found), decimal_comma::help(instead));
                write!(f, "{reason}; {help}")
            }
            Self::Unit(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for QuantityError {}

impl FromStr for Quantity {
    type Err = QuantityError;

    fn from_str(text: &str) -> Result<Self, QuantityError> {
        Self::read(text).map_err(|error| match decimal_comma::with_point(text) {
            Some(instead)
                if matches!(
                    Self::read(&instead),
                    Ok(_) | Err(QuantityError::NoUnit { .. })
                ) =>
            {
                let found = text.trim().to_owned();
                QuantityError::DecimalComma { found, instead }
            }
            _ => error,
        })
    }
}

impl Quantity {
    fn read(text: &str) -> Result<Self, QuantityError> {
        let text = text.trim();
        if text.is_empty() {
            return Err(QuantityError::Empty);
        }
        let (number, unit) = text.split_at(number_length(text));
        if number.is_empty() {
            let word = text.split_whitespace().next().unwrap_or(text);
            return Err(
                match word
                    .trim_start_matches(['+', '-'])
                    .to_ascii_lowercase()
                    .as_str()
                {
                    "nan" | "inf" | "infinity" => QuantityError::NotFinite {
                        number: word.to_owned(),
                    },
                    _ => QuantityError::NoNumber {
                        found: text.chars().take(40).collect(),
                    },
                },
            );
        }
        let value: f64 = number.parse().map_err(|_| QuantityError::NoNumber {
            found: text.chars().take(40).collect(),
        })?;
        if !value.is_finite() {
            return Err(QuantityError::NotFinite {
                number: number.to_owned(),
            });
        }
        let unit = unit.trim();
        if unit.is_empty() {
            return Err(QuantityError::NoUnit {
                number: number.to_owned(),
            });
        }
        Ok(Quantity {
            value,
            unit: Unit::parse(unit).map_err(QuantityError::Unit)?,
        })
    }
}

/// Length of the decimal number at the start of `text`; an `e` counts only if digits follow, so that `"5 eV"` and `"5eV"` are read.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| {
        bytes[from..]
            .iter()
            .take_while(|b| b.is_ascii_digit())
            .count()
    };
    let mut at = usize::from(matches!(bytes.first(), Some(b'+' | b'-')));
    let whole = digits(at);
    at += whole;
    let mut fraction = 0;
    if bytes.get(at) == Some(&b'.') {
        fraction = digits(at + 1);
        if whole + fraction > 0 {
            at += 1 + fraction;
        }
    }
    if whole + fraction == 0 {
        return 0;
    }
    if matches!(bytes.get(at), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(at + 1), Some(b'+' | b'-')));
        let exponent = bytes
            .get(at + 1 + sign..)
            .map_or(0, |_| digits(at + 1 + sign));
        if exponent > 0 {
            at += 1 + sign + exponent;
        }
    }
    at
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let magnitude = self.value.abs();
        if magnitude != 0.0 && !(1e-5..1e15).contains(&magnitude) {
            write!(f, "{:e} {}", self.value, self.unit)
        } else {
            write!(f, "{} {}", self.value, self.unit)
        }
    }
}

impl Serialize for Quantity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl Quantity {
    /// The name by which a deserializer knows the type.
    pub(crate) const TYPE: &str = "athermal::Quantity";
    /// What a message names as expected.
    pub(crate) const EXPECTED: &str = "a quantity like \"150 nm/min\"";
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Quantity;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(Quantity::EXPECTED)
            }
            fn visit_newtype_struct<D: Deserializer<'de>>(
                self,
                of: D,
            ) -> Result<Quantity, D::Error> {
                of.deserialize_str(self)
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<Quantity, E> {
                text.parse().map_err(E::custom)
            }
        }
        deserializer.deserialize_newtype_struct(Quantity::TYPE, Visitor)
    }
}

#[cfg(test)]
mod tests;
