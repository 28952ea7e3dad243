//! What went wrong in reading a value as a type, and where.

use std::fmt;

use serde::de::{self, Expected, Unexpected};

use crate::diagnostic::{Diagnostics, Place, Problem, counted, nearest};
use crate::document::hint::Hint;
use crate::document::problem::{
    MissingKey, NotADuration, NotAQuantity, NotAUnit, Refused, UnknownChoice, UnknownKey, WrongType,
};
use crate::document::tree::{Data, Value};
use crate::quantity::Quantity;
use crate::time::Duration;
use crate::unit::Unit;

/// A problem, its place, and the keys from the decoded value to the value or table that it is about.
#[derive(Debug)]
pub(super) struct Mistake {
    pub(super) keys: Vec<String>,
    pub(super) place: Place,
    pub(super) cause: Cause,
}

/// What is wrong; of the first ones the key or the table is not known before they are reported.
#[derive(Debug)]
pub(super) enum Cause {
    UnknownKey(UnknownKey),
    MissingKey(MissingKey),
    WrongType(WrongType),
    UnknownChoice(UnknownChoice),
    Refused(Refused),
    Value(Box<dyn Problem>),
}

impl Cause {
    fn as_problem(&self) -> &dyn Problem {
        match self {
            Self::UnknownKey(problem) => problem,
            Self::MissingKey(problem) => problem,
            Self::WrongType(problem) => problem,
            Self::UnknownChoice(problem) => problem,
            Self::Refused(problem) => problem,
            Self::Value(problem) => &**problem,
        }
    }
}

impl Mistake {
    /// Whether it is an unknown key that another finds missing under its right name.
    pub(super) fn is_meant_for(&self, missing: &Self) -> bool {
        match (&self.cause, &missing.cause) {
            (Cause::UnknownKey(unknown), Cause::MissingKey(missed)) => {
                let near = nearest(&unknown.key, unknown.known.iter().map(String::as_str));
                self.keys == missing.keys && near == Some(&missed.key)
            }
            _ => false,
        }
    }

    /// Reports it, its table called by the keys that lead there and `what` holds them all.
    pub(super) fn report(
        mut self,
        what: &str,
        elsewhere: &[&str],
        of_missing: &dyn Fn(&str) -> Option<String>,
        diagnostics: &mut Diagnostics,
    ) {
        let owner = match &self.keys[..] {
            [] => what.to_owned(),
            keys => format!("\"{}\" of {what}", keys.join(".")),
        };
        let is_outermost = self.keys.is_empty();
        match &mut self.cause {
            Cause::UnknownKey(unknown) => {
                unknown.what = owner;
                if is_outermost {
                    let elsewhere = elsewhere.iter().map(|&key| key.to_owned());
                    unknown.known.extend(elsewhere);
                }
            }
            Cause::MissingKey(missing) => {
                missing.what = owner;
                if is_outermost {
                    missing.advice = of_missing(&missing.key);
                }
            }
            Cause::WrongType(WrongType { key, .. })
            | Cause::UnknownChoice(UnknownChoice { key, .. })
            | Cause::Refused(Refused { key, .. }) => *key = self.keys.pop(),
            Cause::Value(_) => {}
        }
        diagnostics.report_borrowed(self.place, self.cause.as_problem());
    }
}

/// The error that serde carries: a problem that learns its place on the way up.
#[derive(Debug)]
pub(super) struct DecodeError(Box<Unplaced>);

#[derive(Debug)]
struct Unplaced {
    cause: Cause,
    at: Option<(Vec<String>, Place)>,
}

impl DecodeError {
    pub(super) fn of(cause: Cause) -> Self {
        DecodeError(Box::new(Unplaced { cause, at: None }))
    }

    /// Places the error at `value`, or at a key or choice of it that a buffered enum names. An error that has a place keeps it.
    pub(super) fn at(mut self, value: &Value, keys: impl FnOnce() -> Vec<String>) -> Self {
        if self.0.at.is_none() {
            let table = value.as_table();
            let inner = table.and_then(|table| match &self.0.cause {
                Cause::UnknownKey(unknown) => Some(table.entry(&unknown.key)?.key),
                Cause::UnknownChoice(UnknownChoice { found, .. }) => {
                    let mut values = table.iter().map(|(_, entry)| &entry.value);
                    Some(values.find(|value| value.as_text() == Some(found))?.place)
                }
                _ => None,
            });
            self.0.at = Some((keys(), inner.unwrap_or(value.place)));
        }
        self
    }

    pub(super) fn into_mistake(self, place: Place) -> Mistake {
        let Unplaced { cause, at } = *self.0;
        let (keys, place) = at.unwrap_or((Vec::new(), place));
        Mistake { keys, place, cause }
    }

    /// Another type than `expected`.
    pub(super) fn wrong_type(found: String, expected: &str, hint: Option<Hint>) -> Self {
        Self::of(Cause::WrongType(WrongType {
            key: None,
            expected: expected.to_owned(),
            found,
            hint,
        }))
    }

    /// What is wrong with a value in the place of a duration, a quantity or a unit, by the name of that type.
    pub(super) fn in_place_of(type_name: &str, value: &Value) -> Option<Self> {
        let text = value.as_text();
        let read = match type_name {
            Duration::TYPE => text.map(|text| {
                let error = text.parse::<Duration>().err()?;
                Some(NotADuration { error }.into())
            }),
            Quantity::TYPE => text.map(|text| {
                let error = text.parse::<Quantity>().err()?;
                Some(NotAQuantity { error }.into())
            }),
            Unit::TYPE => text.map(|text| {
                let error = Unit::parse(text).err()?;
                Some(NotAUnit { error }.into())
            }),
            _ => return None,
        };
        match (read, type_name) {
            (Some(problem), _) => problem.map(|problem| Self::of(Cause::Value(problem))),
            (None, Duration::TYPE) => Some(Self::wrong_type(
                value.found(),
                Duration::EXPECTED,
                Hint::for_duration(&value.data),
            )),
            (None, Quantity::TYPE) => Some(Self::wrong_type(
                value.found(),
                Quantity::EXPECTED,
                Hint::for_quantity(&value.data, "nm/min", false),
            )),
            (None, _) => Some(Self::wrong_type(value.found(), Unit::EXPECTED, None)),
        }
    }
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.cause.as_problem().message())
    }
}

impl std::error::Error for DecodeError {}

impl de::Error for DecodeError {
    fn custom<T: fmt::Display>(reason: T) -> Self {
        let reason = reason.to_string();
        Self::of(Cause::Refused(Refused { key: None, reason }))
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        let expected = plain(&expected.to_string());
        let hint = match found {
            Unexpected::Str(text) if expected.starts_with("a list") => {
                Hint::for_texts(&Data::Text(text.to_owned()))
            }
            _ => None,
        };
        Self::wrong_type(found_text(found), &expected, hint)
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::invalid_type(found, expected)
    }

    fn invalid_length(length: usize, expected: &dyn Expected) -> Self {
        let found = format!("a list of {}", counted(length, "value"));
        Self::wrong_type(found, &plain(&expected.to_string()), None)
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        let choices = expected.iter().map(|choice| (*choice).to_owned()).collect();
        Self::of(Cause::UnknownChoice(UnknownChoice {
            key: None,
            found: variant.to_owned(),
            choices,
        }))
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        let known = expected.iter().map(|key| (*key).to_owned()).collect();
        Self::of(Cause::UnknownKey(UnknownKey {
            key: field.to_owned(),
            what: String::new(),
            known,
        }))
    }

    fn missing_field(field: &'static str) -> Self {
        Self::of(Cause::MissingKey(MissingKey {
            key: field.to_owned(),
            what: String::new(),
            advice: None,
        }))
    }

    fn duplicate_field(field: &'static str) -> Self {
        Self::custom(format_args!(
            "\"{field}\" stands twice, once by another name"
        ))
    }
}

/// What serde found, in the words of [`Value::found`].
fn found_text(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Str(text) => Data::Text(text.to_owned()).found(),
        Unexpected::Signed(number) => Data::Integer(number).found(),
        Unexpected::Unsigned(number) => format!("the number {number}"),
        Unexpected::Float(number) => Data::Float(number).found(),
        Unexpected::Bool(truth) => truth.to_string(),
        Unexpected::Seq => "a list".to_owned(),
        Unexpected::Map | Unexpected::StructVariant => "a table".to_owned(),
        Unexpected::UnitVariant => "a name alone".to_owned(),
        other => other.to_string(),
    }
}

/// Serde's word for a type, for somebody who writes TOML. An unknown one stays as it is.
fn plain(expected: &str) -> String {
    let tuple = ["a tuple of size ", "an array of length "];
    if let Some(length) = tuple.iter().find_map(|of| expected.strip_prefix(of)) {
        return format!("a list of {length} values");
    }
    let first = expected.split(' ').next().unwrap_or_default();
    let plain = match (expected, first) {
        ("u8" | "u16" | "u32" | "u64" | "usize", _) => "a whole number, 0 or more",
        ("i8" | "i16" | "i32" | "i64" | "isize", _) => "a whole number",
        ("f32" | "f64", _) => "a number",
        ("a string" | "string" | "a character", _) => "a text in quotes",
        ("a boolean", _) => "true or false",
        ("a sequence", _) => "a list",
        ("a map", _) | (_, "struct" | "internally" | "adjacently") => "a table",
        ("variant identifier" | "variant of enum", _) | (_, "enum") => "one of its choices",
        _ if expected.starts_with("a nonzero") => "a whole number other than 0",
        _ => expected,
    };
    plain.to_owned()
}
