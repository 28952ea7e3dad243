//! A number of bytes as a machine file writes it: "20 GB".

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// A number of bytes, written and read with its unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size(pub u64);

/// The largest first: a size is written in the largest of which it is a whole number.
const UNITS: [(&str, u64); 9] = [
    ("TB", 1_000_000_000_000),
    ("GB", 1_000_000_000),
    ("MB", 1_000_000),
    ("kB", 1_000),
    ("TiB", 1 << 40),
    ("GiB", 1 << 30),
    ("MiB", 1 << 20),
    ("KiB", 1 << 10),
    ("B", 1),
];

/// A text that is no size.
#[derive(Debug)]
pub struct NotASize(String);

impl fmt::Display for NotASize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "a size is a number and a unit of bytes, e.g. \"20 GB\" or \"500 MB\", found \"{}\"",
            self.0
        )
    }
}

impl FromStr for Size {
    type Err = NotASize;

    fn from_str(text: &str) -> Result<Self, NotASize> {
        let wrong = || NotASize(text.to_owned());
        let trimmed = text.trim();
        let end = trimmed
            .find(|c: char| c.is_alphabetic())
            .ok_or_else(wrong)?;
        let (number, unit) = (trimmed[..end].trim_end(), &trimmed[end..]);
        let mut units = UNITS.iter();
        let (_, factor) = units
            .find(|(name, _)| name.eq_ignore_ascii_case(unit))
            .ok_or_else(wrong)?;
        let number: f64 = number.parse().map_err(|_| wrong())?;
        let bytes = number * *factor as f64;
        // Beyond 2^53 bytes a double counts no single ones, nor does anybody.
        let is_size = bytes >= 0.0 && bytes < 2f64.powi(63);
        is_size.then_some(Self(bytes as u64)).ok_or_else(wrong)
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut units = UNITS.iter();
        let whole = units.find(|(_, factor)| self.0 >= *factor && self.0.is_multiple_of(*factor));
        let (unit, factor) = whole.copied().unwrap_or(("B", 1));
        write!(f, "{} {unit}", self.0 / factor)
    }
}

impl Serialize for Size {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Size {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map_err(de::Error::custom)
    }
}

impl JsonSchema for Size {
    fn schema_name() -> Cow<'static, str> {
        "Size".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "description": "A number of bytes: \"20 GB\", \"500 MB\".",
            "pattern": "^\\s*\\.?[0-9]",
            "examples": ["20 GB", "500 MB"]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_is_read_with_its_unit_and_written_as_it_was() {
        for (text, bytes) in [
            ("20 GB", 20_000_000_000),
            ("500 MB", 500_000_000),
            ("64 MiB", 64 << 20),
            ("0 B", 0),
        ] {
            let size: Size = text.parse().unwrap();
            assert_eq!(size.0, bytes);
            assert_eq!(size.to_string(), text);
        }
        assert_eq!("1.5gb".parse::<Size>().unwrap().0, 1_500_000_000);
        for text in ["", "20", "GB", "20 GX", "-1 GB", "NaN GB", "1e40 TB"] {
            assert!(text.parse::<Size>().is_err(), "{text}");
        }
    }
}
