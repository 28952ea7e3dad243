//! Trees from and to JSON, as models store them; places do not survive.

use std::fmt;

use super::tree::{Data, Entry, Table, Value};
use crate::diagnostic::Place;

/// Why JSON is not a tree.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum JsonError {
    /// A null, which graph files do not have.
    Null {
        /// The keys that lead to it, joined by dots.
        path: String,
    },
}

impl fmt::Display for JsonError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            JsonError::Null { path } => write!(f, "\"{path}\" is null, which a graph cannot hold"),
        }
    }
}

impl std::error::Error for JsonError {}

impl Value {
    /// The tree of a JSON value, every part of it at `place`.
    ///
    /// # Errors
    /// A null anywhere.
    pub fn from_json(json: &serde_json::Value, place: Place) -> Result<Value, JsonError> {
        let below = |key: &str, error: JsonError| {
            let JsonError::Null { path } = error;
            JsonError::Null {
                path: if path.is_empty() {
                    key.to_owned()
                } else {
                    format!("{key}.{path}")
                },
            }
        };
        let data = match json {
            serde_json::Value::Null => {
                return Err(JsonError::Null {
                    path: String::new(),
                });
            }
            serde_json::Value::Bool(truth) => Data::Bool(*truth),
            serde_json::Value::Number(number) => match number.as_i64() {
                Some(whole) => Data::Integer(whole),
                None => Data::Float(number.as_f64().unwrap_or(f64::NAN)),
            },
            serde_json::Value::String(text) => Data::Text(text.clone()),
            serde_json::Value::Array(values) => Data::List(
                values
                    .iter()
                    .enumerate()
                    .map(|(index, value)| {
                        Value::from_json(value, place)
                            .map_err(|error| below(&index.to_string(), error))
                    })
                    .collect::<Result<_, _>>()?,
            ),
            serde_json::Value::Object(entries) => Data::Table(
                entries
                    .iter()
                    .map(|(key, value)| {
                        let value =
                            Value::from_json(value, place).map_err(|error| below(key, error))?;
                        Ok((key.clone(), Entry { key: place, value }))
                    })
                    .collect::<Result<Table, _>>()?,
            ),
        };
        Ok(Value::new(place, data))
    }

    /// The tree as JSON: numbers exact, non-finite ones as the texts "NaN", "inf" and "-inf", times as texts.
    pub fn to_json(&self) -> serde_json::Value {
        match &self.data {
            Data::Text(text) | Data::Time(text) => serde_json::Value::String(text.clone()),
            Data::Integer(number) => serde_json::Value::from(*number),
            Data::Float(number) => match serde_json::Number::from_f64(*number) {
                Some(number) => serde_json::Value::Number(number),
                None => serde_json::Value::String(number.to_string()),
            },
            Data::Bool(truth) => serde_json::Value::Bool(*truth),
            Data::List(values) => {
                serde_json::Value::Array(values.iter().map(Value::to_json).collect())
            }
            Data::Table(table) => serde_json::Value::Object(
                table
                    .iter()
                    .map(|(key, entry)| (key.to_owned(), entry.value.to_json()))
                    .collect(),
            ),
        }
    }
}
