//! What went wrong in reading a value as a type, and where; how reading goes on is decided by the repair.

use std::fmt;

use serde::de::{self, Expected, Unexpected};

use super::{Advice, Wanted};
use crate::diagnostic::{Diagnostics, Place, Problem, counted, nearest};
use crate::document::lacks::Lacks;
use crate::document::problem::DocumentProblem;
use crate::document::tree::{Data, Value};
use crate::quantity::{Quantity, QuantityError};
use crate::time::Duration;
use crate::unit::Unit;

/// What is expected where there must be keys.
const A_TABLE: &str = "a table";

/// One step from a value into it.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) enum Step {
    Key(String),
    Index(usize),
}

impl Step {
    pub(super) fn is_key(&self, key: &str) -> bool {
        matches!(self, Step::Key(name) if name == key)
    }
}

/// The keys among steps.
fn keys_of(steps: &[Step]) -> Vec<&str> {
    let keys = steps.iter().filter_map(|step| match step {
        Step::Key(key) => Some(key.as_str()),
        Step::Index(_) => None,
    });
    keys.collect()
}

/// The number that stands where a quantity is needed, and how it was found.
fn bare_number(problem: &DocumentProblem) -> Option<(String, String)> {
    match problem {
        DocumentProblem::WrongType {
            found,
            lacks: Some(Lacks::Unit { number, .. }),
            ..
        } => Some((number.clone(), found.clone())),
        DocumentProblem::Quantity(QuantityError::NoUnit { number }) => {
            Some((number.clone(), format!("the text \"{number}\"")))
        }
        _ => None,
    }
}

/// A problem and the way to it from the decoded value.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mistake {
    pub(super) path: Vec<Step>,
    pub(super) place: Place,
    pub(super) problem: DocumentProblem,
}

impl Mistake {
    pub(super) fn missing_key(&self) -> Option<&str> {
        match &self.problem {
            DocumentProblem::MissingKey { key, .. } => Some(key),
            _ => None,
        }
    }

    /// The choices that there are where the text at `way` is none of them.
    pub(super) fn choices_at(&self, way: &[Step]) -> Option<&[String]> {
        match &self.problem {
            DocumentProblem::UnknownChoice { choices, .. } if self.path == way => Some(choices),
            _ => None,
        }
    }

    /// A missing key in this table, with what a text that is no choice there is told.
    pub(super) fn moved(&mut self, path: Vec<Step>, place: Place, no_choice: Option<&Self>) {
        (self.path, self.place) = (path, place);
        if let (DocumentProblem::MissingKey { advice, .. }, Some(no_choice)) =
            (&mut self.problem, no_choice)
        {
            *advice = no_choice.problem.help();
        }
    }

    /// Whether the key at `way` is unknown.
    pub(super) fn is_unknown(&self, way: &[Step]) -> bool {
        matches!(self.problem, DocumentProblem::UnknownKey { .. }) && self.path == way
    }

    /// The way to the key that an unknown one may be meant for.
    pub(super) fn meant(&self) -> Option<Vec<Step>> {
        let DocumentProblem::UnknownKey { key, known, .. } = &self.problem else {
            return None;
        };
        let near = nearest(key, known.iter().map(String::as_str))?;
        let (_, table) = self.path.split_last()?;
        Some([table, &[Step::Key(near.to_owned())]].concat())
    }

    /// Whether it is an unknown key that another finds missing under its right name.
    pub(super) fn is_meant_for(&self, missing: &Self) -> bool {
        let meant = missing.missing_key().zip(self.meant());
        meant.is_some_and(|(wanted, meant)| match meant.split_last() {
            Some((key, table)) => table == missing.path && key.is_key(wanted),
            None => false,
        })
    }

    /// The same, with what to write where a key of the whole table is missing, or no table.
    pub(super) fn advised(mut self, of: Advice<'_>) -> Self {
        match (&self.path[..], &mut self.problem) {
            ([], DocumentProblem::MissingKey { key, advice, .. }) => {
                *advice = of(Wanted::Key(key)).or(advice.take());
            }
            (
                [Step::Key(key)],
                DocumentProblem::WrongType {
                    expected,
                    lacks: lacks @ None,
                    ..
                },
            ) if expected == A_TABLE => {
                *lacks = of(Wanted::TableOf(key)).map(|example| Lacks::Table { example });
            }
            (path, problem) => {
                if let Some((number, found)) = bare_number(problem)
                    && let Some(example) = of(Wanted::Quantity(&keys_of(path)))
                {
                    *problem = DocumentProblem::WrongType {
                        key: None,
                        expected: format!("a quantity like \"{example}\""),
                        found,
                        lacks: Some(Lacks::unit_of(number, &example)),
                    };
                }
            }
        }
        self
    }

    /// The same, with the keys that are read elsewhere beside those that an unknown one of the whole table may be meant for.
    pub(super) fn beside(mut self, elsewhere: &[&str]) -> Self {
        if self.path.len() == 1
            && let DocumentProblem::UnknownKey { known, .. } = &mut self.problem
        {
            known.extend(elsewhere.iter().map(|&key| key.to_owned()));
        }
        self
    }

    /// Reports it, its table called by the keys that lead there and `what` holds them all.
    pub(super) fn report(mut self, what: &str, diagnostics: &mut Diagnostics) {
        let steps = match self.problem {
            DocumentProblem::UnknownKey { .. } => &self.path[..self.path.len().saturating_sub(1)],
            _ => &self.path[..],
        };
        let keys = keys_of(steps);
        let owner = if keys.is_empty() {
            what.to_owned()
        } else {
            format!("\"{}\" of {what}", keys.join("."))
        };
        let last = keys.last().map(|key| (*key).to_owned());
        match &mut self.problem {
            DocumentProblem::UnknownKey { what, .. } | DocumentProblem::MissingKey { what, .. } => {
                *what = owner
            }
            DocumentProblem::WrongType { key, .. }
            | DocumentProblem::UnknownChoice { key, .. }
            | DocumentProblem::Refused { key, .. } => *key = last,
            _ => {}
        }
        diagnostics.report(self.place, self.problem);
    }
}

/// The error that serde carries: a problem that learns its place on the way up.
#[derive(Debug)]
pub(super) struct DecodeError(Box<State>);

#[derive(Debug)]
enum State {
    Unplaced(DocumentProblem),
    Placed(Mistake),
}

impl DecodeError {
    pub(super) fn of(problem: DocumentProblem) -> Self {
        DecodeError(Box::new(State::Unplaced(problem)))
    }

    /// Places the error at `value`, or inside it where only one part can be meant. An error that has a place keeps it.
    pub(super) fn at(self, value: &Value, path: impl FnOnce() -> Vec<Step>) -> Self {
        match *self.0 {
            State::Placed(_) => self,
            State::Unplaced(problem) => {
                let problem = recognised(value, problem);
                let mut path = path();
                let place = match only_part_meant(value, &problem) {
                    Some((inner, place)) => {
                        path.extend(inner);
                        place
                    }
                    None => value.place,
                };
                DecodeError(Box::new(State::Placed(Mistake {
                    path,
                    place,
                    problem,
                })))
            }
        }
    }

    pub(super) fn into_mistake(self, place: Place) -> Mistake {
        match *self.0 {
            State::Placed(mistake) => mistake,
            State::Unplaced(problem) => Mistake {
                path: Vec::new(),
                place,
                problem,
            },
        }
    }

    pub(super) fn wrong_type(found: String, expected: &dyn Expected) -> Self {
        Self::lacking(found, expected, |_| None)
    }

    /// Another type than the one of a value.
    pub(super) fn not_of(found: &Value, expected: &dyn Expected) -> Self {
        Self::lacking(found.found(), expected, |words| lacks(&found.data, words))
    }

    fn lacking(
        found: String,
        expected: &dyn Expected,
        lacks: impl Fn(&str) -> Option<Lacks>,
    ) -> Self {
        let words = expected.to_string();
        Self::of(DocumentProblem::WrongType {
            key: None,
            expected: plain(&words),
            found,
            lacks: lacks(&words),
        })
    }
}

/// A text refused for what the language itself says of durations, quantities and units is told as everywhere else.
fn recognised(value: &Value, problem: DocumentProblem) -> DocumentProblem {
    let (Data::Text(text), DocumentProblem::Refused { reason, .. }) = (&value.data, &problem)
    else {
        return problem;
    };
    if let Err(error) = text.parse::<Duration>()
        && error.to_string() == *reason
    {
        return DocumentProblem::Duration(error);
    }
    if let Err(error) = text.parse::<Quantity>()
        && error.to_string() == *reason
    {
        return DocumentProblem::Quantity(error);
    }
    match text.parse::<Unit>() {
        Err(error) if error.to_string() == *reason => DocumentProblem::Unit(error),
        _ => problem,
    }
}

/// The only part of a table or list that a problem from a buffered enum can be about.
fn only_part_meant(value: &Value, problem: &DocumentProblem) -> Option<(Vec<Step>, Place)> {
    let mut meant = Vec::new();
    search(value, problem, &mut Vec::new(), &mut meant);
    if meant.len() == 1 { meant.pop() } else { None }
}

fn search(
    value: &Value,
    problem: &DocumentProblem,
    path: &mut Vec<Step>,
    meant: &mut Vec<(Vec<Step>, Place)>,
) {
    let fits = |inner: &Value| match problem {
        DocumentProblem::WrongType { found, .. } => inner.found() == *found,
        DocumentProblem::UnknownChoice { found, .. } => inner.as_text() == Some(found),
        _ => false,
    };
    let mut visit = |step: Step, inner: &Value, key: Place| {
        path.push(step);
        if matches!((problem, path.last()), (DocumentProblem::UnknownKey { key, .. }, Some(step)) if step.is_key(key))
        {
            meant.push((path.clone(), key));
        } else if fits(inner) {
            meant.push((path.clone(), inner.place));
        }
        search(inner, problem, path, meant);
        path.pop();
    };
    match &value.data {
        Data::Table(table) => {
            for (key, entry) in table.iter() {
                visit(Step::Key(key.to_owned()), &entry.value, entry.key);
            }
        }
        Data::List(values) => {
            for (index, inner) in values.iter().enumerate() {
                visit(Step::Index(index), inner, inner.place);
            }
        }
        _ => {}
    }
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &*self.0 {
            State::Unplaced(problem) | State::Placed(Mistake { problem, .. }) => {
                f.write_str(&problem.message())
            }
        }
    }
}

impl std::error::Error for DecodeError {}

impl de::Error for DecodeError {
    fn custom<T: fmt::Display>(reason: T) -> Self {
        let reason = reason.to_string();
        let reason = match reason.strip_prefix("data did not match any variant of untagged enum ") {
            Some(_) => "it has none of the forms that are read here".to_owned(),
            None => reason,
        };
        Self::of(DocumentProblem::Refused { key: None, reason })
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        match data_of(found) {
            Some(data) => Self::not_of(&Value::new(NOWHERE, data), expected),
            None => Self::wrong_type(found_text(found), expected),
        }
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::invalid_type(found, expected)
    }

    fn invalid_length(length: usize, expected: &dyn Expected) -> Self {
        let found = format!("a list of {}", counted(length, "value"));
        Self::wrong_type(found, expected)
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        let choices = expected.iter().map(|choice| (*choice).to_owned()).collect();
        Self::of(DocumentProblem::UnknownChoice {
            key: None,
            found: variant.to_owned(),
            choices,
        })
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        let known = expected.iter().map(|key| (*key).to_owned()).collect();
        Self::of(DocumentProblem::UnknownKey {
            key: field.to_owned(),
            what: String::new(),
            known,
        })
    }

    fn missing_field(field: &'static str) -> Self {
        Self::of(DocumentProblem::MissingKey {
            key: field.to_owned(),
            what: String::new(),
            advice: None,
        })
    }

    fn duplicate_field(field: &'static str) -> Self {
        Self::custom(format_args!(
            "\"{field}\" stands twice, once by another name"
        ))
    }
}

/// What serde found, where it is no list or table.
fn data_of(found: Unexpected<'_>) -> Option<Data> {
    Some(match found {
        Unexpected::Str(text) => Data::Text(text.to_owned()),
        Unexpected::Signed(number) => Data::Integer(number),
        Unexpected::Unsigned(number) => Data::Integer(i64::try_from(number).ok()?),
        Unexpected::Float(number) => Data::Float(number),
        Unexpected::Bool(truth) => Data::Bool(truth),
        _ => return None,
    })
}

/// What a value lacks. Serde hands on what a type expects in words alone, so that here, and nowhere else, they decide.
fn lacks(found: &Data, words: &str) -> Option<Lacks> {
    match words {
        "a sequence" => Lacks::for_texts(found),
        list if list.starts_with("a list of ") => Lacks::for_texts(found),
        duration if duration.starts_with("a duration ") => Lacks::for_duration(found),
        quantity if quantity.starts_with("a quantity ") => {
            Lacks::for_quantity(found, "nm/min", false)
        }
        _ => None,
    }
}

/// What else serde found, in the words of [`Value::found`].
fn found_text(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Unsigned(number) => format!("the number {number}"),
        Unexpected::Seq => "a list".to_owned(),
        Unexpected::Map | Unexpected::StructVariant => A_TABLE.to_owned(),
        Unexpected::UnitVariant => "a name alone".to_owned(),
        other => other.to_string(),
    }
}

const NOWHERE: Place = Place::new(crate::diagnostic::SourceId(u32::MAX), 0, 0);

/// Serde's word for a type, as one says it to who writes TOML.
fn plain(expected: &str) -> String {
    let said = match expected {
        "u8" | "u16" | "u32" | "u64" | "u128" | "usize" => "a whole number, 0 or more",
        "i8" | "i16" | "i32" | "i64" | "i128" | "isize" => "a whole number",
        "f32" | "f64" => "a number",
        "a string" | "string" | "a character" => "a text in quotes",
        "a boolean" => "true or false",
        "a sequence" => "a list",
        "a map" => A_TABLE,
        "variant identifier" | "string or map" | "variant of enum" => "one of its choices",
        "unit" => "nothing",
        _ => {
            return match expected.split_once(' ') {
                Some(("struct" | "internally" | "adjacently", _)) => A_TABLE.to_owned(),
                Some(("enum", _)) => "one of its choices".to_owned(),
                Some(("a", rest)) if rest.starts_with("nonzero") => {
                    "a whole number other than 0".to_owned()
                }
                _ => match (tuple_length(expected), expected) {
                    (Some(length), _) => format!("a list of {length} values"),
                    (None, other) => other.to_owned(),
                },
            };
        }
    };
    said.to_owned()
}

fn tuple_length(expected: &str) -> Option<&str> {
    expected
        .strip_prefix("a tuple of size ")
        .or_else(|| expected.strip_prefix("an array of length "))
}
