//! What to write instead of a value of another type.

use super::tree::Data;

/// What alone stands between a value and the type that its key needs.
#[derive(Debug, Clone, PartialEq)]
pub enum Hint {
    /// The unit of a duration.
    UnitOfTime,
    /// The unit of a quantity.
    Unit {
        /// The number that stands alone.
        number: String,
        /// A unit that will do.
        unit: String,
        /// Whether it is the one of what is measured.
        known: bool,
    },
    /// The brackets of a list.
    Brackets {
        /// What stands in them.
        around: String,
    },
}

impl Hint {
    /// What a value that is found in the place of a duration lacks.
    pub(super) fn for_duration(found: &Data) -> Option<Self> {
        found.is_number().then_some(Self::UnitOfTime)
    }

    /// What a value that is found in the place of a quantity lacks.
    pub(super) fn for_quantity(found: &Data, unit: &str, known: bool) -> Option<Self> {
        let number = match found {
            Data::Integer(number) => number.to_string(),
            Data::Float(number) => number.to_string(),
            Data::Text(number) => number.trim().to_owned(),
            _ => return None,
        };
        let is_number = number.parse::<f64>().is_ok_and(f64::is_finite);
        is_number.then(|| Self::Unit {
            number,
            unit: unit.to_owned(),
            known,
        })
    }

    /// What a value that is found in the place of a list of texts lacks.
    pub(super) fn for_texts(found: &Data) -> Option<Self> {
        match found {
            Data::Text(text) => Some(Self::Brackets {
                around: toml::Value::from(&**text).to_string(),
            }),
            _ => None,
        }
    }

    /// What a value that is found in the place of a list of tables lacks.
    pub fn for_tables(found: &Data) -> Option<Self> {
        matches!(found, Data::Table(_)).then(|| Self::Brackets {
            around: "{ … }".to_owned(),
        })
    }

    pub(super) fn help(&self) -> String {
        match self {
            Self::UnitOfTime => "a duration needs a unit, e.g. \"5min\"".to_owned(),
            Self::Unit {
                number,
                unit,
                known: true,
            } => format!("write \"{number} {unit}\""),
            Self::Unit { number, unit, .. } => {
                format!("a quantity needs a unit, e.g. \"{number} {unit}\"")
            }
            Self::Brackets { around } => {
                format!("a list stands in brackets, e.g. [{around}]")
            }
        }
    }
}
