//! Units of measure: which texts are units, which measure the same, and the factors between them; which unit a place wants is decided there.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

mod in_names;
mod ratio;
mod spelling;

use ratio::Ratio;

/// Longest text that is tried as a unit; the longest sensible ones have about 20 characters.
const LONGEST: usize = 64;

/// What to write for a level above 1 mW.
const LEVEL: &str =
    "a level above 1 W is \"dB[W]\", in which 0 dBm are -30; a difference of levels is in \"dB\"";

/// 0 °C in K (BIPM, SI brochure, 9th edition, 2.3.1).
const CELSIUS_ZERO_K: f64 = 273.15;
/// 0 K is −459.67 °F.
const FAHRENHEIT_ZERO: f64 = 459.67;

/// A unit of measure, read from its UCUM code or a common spelling of it.
///
/// Two units are equal when they mean the same (`"um"` and `"µm"`, `"mm/s"` and `"m/ks"`), however they are written.
/// Logarithmic and arbitrary units (`dB`, `[pH]`) are compatible with themselves and their prefixed forms alone: they are never
/// converted into ratios.
#[derive(Debug, Clone)]
pub struct Unit {
    text: Arc<str>,
    ratio: Ratio,
    dimension: [i8; 7],
    /// Units that UCUM calls special or arbitrary, with their exponents: each is a dimension of its own.
    opaque: BTreeMap<String, i32>,
    point: Option<Scale>,
}

/// A temperature scale with a zero of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scale {
    Celsius,
    Fahrenheit,
}

impl Unit {
    /// Reads a UCUM code (`"nm/min"`, `"mK/min"`, `"Cel"`) or a common spelling (`"°C"`, `"µm"`, `"m²"`).
    ///
    /// # Errors
    /// An unknown or malformed unit, or a temperature scale inside a compound (`Cel/min`), where only K has a meaning.
    pub fn parse(text: &str) -> Result<Self, UnitError> {
        let trimmed = text.trim();
        if trimmed.is_empty() {
            return Err(UnitError::Empty);
        }
        if trimmed.chars().count() > LONGEST {
            return Err(UnitError::TooLong {
                length: trimmed.chars().count(),
            });
        }
        let code = spelling::ucum_code(trimmed);
        let canonical = ucum::canonical(&code).map_err(|error| unknown(trimmed, &error))?;
        let analysis = ucum::analyze(&canonical).map_err(|error| unknown(trimmed, &error))?;
        if let Some(scale) = Scale::of(&canonical) {
            return Ok(scale.unit());
        }
        if !(analysis.factor.is_finite() && analysis.factor > 0.0) {
            return Err(UnitError::Syntax {
                text: trimmed.to_owned(),
                at: 0,
            });
        }
        let syntax = || UnitError::Syntax {
            text: trimmed.to_owned(),
            at: 0,
        };
        let factors = spelling::factors(&canonical).ok_or_else(syntax)?;
        let mut unit = Unit::one();
        for (symbol, exponent) in factors {
            let part = Self::symbol(&symbol, trimmed, &canonical)?;
            unit.ratio = unit.ratio.times(part.ratio.power(exponent));
            for (sum, of_part) in unit.dimension.iter_mut().zip(part.dimension) {
                let added = i32::from(*sum) + i32::from(of_part) * exponent;
                *sum = i8::try_from(added).map_err(|_| syntax())?;
            }
            for name in part.opaque.into_keys() {
                *unit.opaque.entry(name).or_default() += exponent;
            }
        }
        unit.opaque.retain(|_, exponent| *exponent != 0);
        unit.text = canonical.into();
        Ok(unit)
    }

    /// One symbol of a compound, without its exponent.
    fn symbol(symbol: &str, text: &str, canonical: &str) -> Result<Self, UnitError> {
        if symbol.ends_with("Cel") || symbol.ends_with("[degF]") {
            let advice = canonical.replace("Cel", "K").replace("[degF]", "[degR]");
            return Err(UnitError::PointInCompound {
                text: text.to_owned(),
                advice,
            });
        }
        let analysis = ucum::analyze(symbol).map_err(|error| unknown(text, &error))?;
        let mut unit = Unit {
            text: symbol.into(),
            ..Unit::one()
        };
        if analysis.is_special {
            let (prefix, name) = spelling::without_prefix(symbol);
            unit.ratio = Ratio::power_of_ten(prefix);
            unit.opaque.insert(name.to_owned(), 1);
        } else {
            unit.ratio = match symbol {
                "[degR]" => Ratio::whole(5).times(Ratio::whole(9).power(-1)),
                _ => spelling::without_prefix_of_linear(symbol)
                    .and_then(|(prefix, name)| {
                        let base = ucum::analyze(name).ok()?;
                        Some(Ratio::from_f64(base.factor).times(Ratio::power_of_ten(prefix)))
                    })
                    .unwrap_or_else(|| Ratio::from_f64(analysis.factor)),
            };
            unit.dimension = analysis.dimension.0;
        }
        Ok(unit)
    }

    /// The second.
    pub fn second() -> Self {
        Unit {
            text: "s".into(),
            dimension: [0, 1, 0, 0, 0, 0, 0],
            ..Unit::one()
        }
    }

    /// The unit of a bare ratio, `1`.
    pub fn one() -> Self {
        Unit {
            text: "1".into(),
            ratio: Ratio::whole(1),
            dimension: [0; 7],
            opaque: BTreeMap::new(),
            point: None,
        }
    }

    /// The kelvin.
    pub fn kelvin() -> Self {
        Unit {
            text: "K".into(),
            dimension: [0, 0, 0, 0, 1, 0, 0],
            ..Unit::one()
        }
    }

    /// The UCUM code, as it is shown.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// What to write where a scale of temperature was meant, for the two letters that UCUM gives to something else.
    pub fn scale_meant(&self) -> Option<&'static str> {
        match &*self.text {
            "C" => Some("degrees Celsius are \"Cel\"; \"C\" is the coulomb"),
            "F" => Some("degrees Fahrenheit are \"[degF]\"; \"F\" is the farad"),
            _ => None,
        }
    }

    /// True for points on a temperature scale (`Cel`, `[degF]`), which only samples and ranges have.
    pub fn is_temperature_point(&self) -> bool {
        self.point.is_some()
    }

    /// True if both measure the same quantity, so that a factor between them exists.
    pub fn measures_same(&self, other: &Unit) -> bool {
        self.dimension == other.dimension && self.opaque == other.opaque
    }

    /// Whether both measure the same and a number means something else in one than in the other: nm and um, Cel and K.
    #[must_use]
    pub fn is_another_than(&self, other: &Unit) -> bool {
        let same = [0.0, 1.0].iter().all(|&value| {
            let converted = self.convert(value, other);
            converted.is_none_or(|converted| (converted - value).abs() < 1e-9)
        });
        !same
    }

    /// How many of `to` one of this unit is; `None` if they do not measure the same.
    ///
    /// Between temperature scales, and between a scale and K, it is the factor of *differences* (`[degF]` to `K`: 5/9).
    pub fn factor_to(&self, to: &Unit) -> Option<f64> {
        self.measures_same(to)
            .then(|| self.ratio.times(to.ratio.power(-1)).value())
    }

    /// `value`, given in this unit, in the unit `to`; `None` if they do not measure the same.
    ///
    /// Temperatures are converted as points if either side is a scale: 20 Cel are 293.15 K.
    pub fn convert(&self, value: f64, to: &Unit) -> Option<f64> {
        let ratio = self
            .measures_same(to)
            .then(|| self.ratio.times(to.ratio.power(-1)))?;
        Some(match (self.point, to.point) {
            (from, to) if from == to => ratio.of(value),
            (Some(Scale::Celsius), Some(Scale::Fahrenheit)) => value * 9.0 / 5.0 + 32.0,
            (Some(Scale::Fahrenheit), Some(Scale::Celsius)) => (value - 32.0) * 5.0 / 9.0,
            (Some(scale), _) => ratio.of(value + scale.zero()),
            (None, Some(scale)) => ratio.of(value) - scale.zero(),
            (None, None) => ratio.of(value),
        })
    }

    /// The unit of a difference of two values in this unit: `K` for `Cel`, `[degR]` (5/9 K) for `[degF]`, itself for all others.
    pub fn difference(&self) -> Unit {
        match self.point {
            None => self.clone(),
            Some(Scale::Celsius) => Unit::kelvin(),
            Some(Scale::Fahrenheit) => Unit {
                text: "[degR]".into(),
                ratio: self.ratio,
                dimension: self.dimension,
                opaque: BTreeMap::new(),
                point: None,
            },
        }
    }

    /// The unit of the same quantity in which a second, a metre or a kelvin is 1, and no scale has a zero of its own.
    pub fn base(&self) -> Unit {
        let [metre, second, gram, radian, kelvin, coulomb, candela] = self.dimension;
        let named = [
            ("m", metre),
            ("s", second),
            ("g", gram),
            ("rad", radian),
            ("K", kelvin),
            ("C", coulomb),
            ("cd", candela),
        ];
        let opaque = self
            .opaque
            .iter()
            .map(|(name, &power)| (name.as_str(), power));
        let named = named
            .into_iter()
            .map(|(name, power)| (name, i32::from(power)));
        let factors = named.chain(opaque).filter(|(_, power)| *power != 0);
        let text: Vec<_> = factors
            .map(|(name, power)| format!("{name}{power}"))
            .collect();
        Unit {
            text: if text.is_empty() {
                "1".into()
            } else {
                text.join(".").into()
            },
            ratio: Ratio::whole(1),
            point: None,
            ..self.clone()
        }
    }

    /// A text that two units share exactly when they mean the same, up to the last digits of a factor.
    pub fn meaning(&self) -> String {
        let base = self.base();
        let scale = self
            .point
            .map_or(String::new(), |scale| format!(" from {}", scale.zero()));
        format!("{:.11e} {base}{scale}", self.ratio.value())
    }

    /// This unit divided by `other`: nm per min is `nm/min`. Temperature scales are taken as differences.
    pub fn per(&self, other: &Unit) -> Unit {
        let (above, below) = (self.difference(), other.difference());
        let mut dimension = above.dimension;
        for (sum, exponent) in dimension.iter_mut().zip(below.dimension) {
            *sum = sum.saturating_sub(exponent);
        }
        let mut opaque = above.opaque;
        for (name, exponent) in below.opaque {
            *opaque.entry(name).or_default() -= exponent;
        }
        opaque.retain(|_, exponent| *exponent != 0);
        let text = match &*below.text {
            "1" => above.text,
            // A product below the line needs its parentheses; UCUM reads from left to right.
            code if code.contains(['.', '/']) => format!("{}/({code})", above.text).into(),
            code => format!("{}/{code}", above.text).into(),
        };
        Unit {
            text,
            ratio: above.ratio.times(below.ratio.power(-1)),
            dimension,
            opaque,
            point: None,
        }
    }
}

impl Scale {
    fn of(code: &str) -> Option<Self> {
        match code {
            "Cel" => Some(Scale::Celsius),
            "[degF]" => Some(Scale::Fahrenheit),
            _ => None,
        }
    }

    fn unit(self) -> Unit {
        let (text, ratio) = match self {
            Scale::Celsius => ("Cel", Ratio::whole(1)),
            Scale::Fahrenheit => ("[degF]", Ratio::whole(5).times(Ratio::whole(9).power(-1))),
        };
        Unit {
            text: text.into(),
            ratio,
            point: Some(self),
            ..Unit::kelvin()
        }
    }

    /// What to add to a value on this scale to count from absolute zero, in degrees of the scale.
    fn zero(self) -> f64 {
        match self {
            Scale::Celsius => CELSIUS_ZERO_K,
            Scale::Fahrenheit => FAHRENHEIT_ZERO,
        }
    }
}

impl PartialEq for Unit {
    fn eq(&self, other: &Self) -> bool {
        self.measures_same(other) && self.ratio == other.ratio && self.point == other.point
    }
}

/// Why a text is not a unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum UnitError {
    /// The text is empty.
    Empty,
    /// The text is too long to be a unit.
    TooLong {
        /// Number of characters.
        length: usize,
    },
    /// A symbol that UCUM does not have.
    Unknown {
        /// The unit as written.
        text: String,
        /// The symbol in it that is not known.
        symbol: String,
        /// A known unit that is spelt alike.
        suggestion: Option<String>,
    },
    /// A level above a power for which UCUM has no code.
    Level {
        /// The unit as written.
        text: String,
        /// The level in it.
        symbol: String,
    },
    /// The text is not built like a unit.
    Syntax {
        /// The unit as written.
        text: String,
        /// The byte at which reading stopped.
        at: usize,
    },
    /// A temperature scale inside a compound.
    PointInCompound {
        /// The unit as written.
        text: String,
        /// The unit to write in its place.
        advice: String,
    },
}

impl UnitError {
    /// What to write instead, where that is known.
    pub fn advice(&self) -> Option<&str> {
        match self {
            Self::Unknown { suggestion, .. } => suggestion.as_deref(),
            Self::PointInCompound { advice, .. } => Some(advice),
            Self::Empty | Self::TooLong { .. } | Self::Level { .. } | Self::Syntax { .. } => None,
        }
    }

    /// The same in a sentence.
    pub fn help(&self) -> Option<String> {
        if let Self::Level { .. } = self {
            return Some(LEVEL.to_owned());
        }
        let advice = self.advice()?;
        Some(format!("write the unit as \"{advice}\""))
    }

    /// What is wrong, without the advice.
    pub fn reason(&self) -> String {
        match self {
            Self::Empty => "a unit is a UCUM code like \"nm/min\" (\"1\" if there is none), found an empty text".to_owned(),
            Self::TooLong { length } => format!("a unit has at most {LONGEST} characters, found {length}"),
            Self::Unknown { text, symbol, .. } | Self::Level { text, symbol } if symbol == text => format!("\"{text}\" is not a unit that UCUM knows"),
            Self::Unknown { text, symbol, .. } | Self::Level { text, symbol } => format!("\"{symbol}\" in \"{text}\" is not a unit that UCUM knows"),
            Self::Syntax { text, at: 0 } => format!("\"{text}\" is not built like a unit, e.g. \"nm/min\""),
            Self::Syntax { text, at } => {
                format!("\"{text}\" is not built like a unit, e.g. \"nm/min\": reading stopped at byte {at}")
            }
            Self::PointInCompound { text, .. } => {
                format!("\"{text}\" has a temperature scale in a compound, where only differences have a meaning")
            }
        }
    }
}

/// The unit that a text in words means.
fn of_words(text: &str) -> Option<String> {
    let codes = spelling::without_words(text);
    (codes != text && Unit::parse(&codes).is_ok()).then_some(codes)
}

fn unknown(text: &str, error: &ucum::UcumError) -> UnitError {
    match error {
        ucum::UcumError::UnknownAtom { code } if spelling::is_level(code) => UnitError::Level {
            text: text.to_owned(),
            symbol: code.clone(),
        },
        ucum::UcumError::UnknownAtom { code } => UnitError::Unknown {
            text: text.to_owned(),
            symbol: code.clone(),
            suggestion: of_words(text)
                .or_else(|| spelling::near(text).map(str::to_owned))
                .or_else(|| Some(text.replace(code.as_str(), spelling::near(code)?))),
        },
        ucum::UcumError::Parse { pos, .. } => UnitError::Syntax {
            text: text.to_owned(),
            at: *pos,
        },
        _ => UnitError::Syntax {
            text: text.to_owned(),
            at: 0,
        },
    }
}

impl fmt::Display for UnitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.reason())?;
        match self {
            Self::Unknown {
                suggestion: Some(suggestion),
                ..
            } => write!(f, "; did you mean \"{suggestion}\"?"),
            Self::PointInCompound { advice, .. } => write!(f, "; write \"{advice}\""),
            Self::Level { .. } => write!(f, "; {LEVEL}"),
            _ => Ok(()),
        }
    }
}

impl std::error::Error for UnitError {}

impl FromStr for Unit {
    type Err = UnitError;
    fn from_str(text: &str) -> Result<Self, UnitError> {
        Unit::parse(text)
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Serialize for Unit {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.text)
    }
}

impl Unit {
    /// The name by which a deserializer knows the type.
    pub(crate) const TYPE: &str = "athermal::Unit";
    /// What a message names as expected.
    pub(crate) const EXPECTED: &str = "a unit like \"nm/min\"";
}

impl<'de> Deserialize<'de> for Unit {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Unit;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(Unit::EXPECTED)
            }
            fn visit_newtype_struct<D: Deserializer<'de>>(self, of: D) -> Result<Unit, D::Error> {
                of.deserialize_str(self)
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<Unit, E> {
                Unit::parse(text).map_err(E::custom)
            }
        }
        deserializer.deserialize_newtype_struct(Unit::TYPE, Visitor)
    }
}

#[cfg(test)]
mod tests;
