//! How single values of a section are read and refused; what they are for is decided by the sections.

use crate::diagnostic::{Diagnostics, Place, Problem, nearest};
use crate::document::hint::Hint;
use crate::document::problem;
use crate::document::tree::{Data, Table, Value};
use crate::quantity::{Quantity, QuantityError};
use crate::time::Duration;

/// Reports every key of `table` that is not `known`.
pub fn known_keys(table: &Table, known: &[&str], what: &str, diagnostics: &mut Diagnostics) {
    for (key, entry) in table.iter().filter(|(key, _)| !known.contains(key)) {
        let known = known.iter().map(|key| (*key).to_owned()).collect();
        diagnostics.report(
            entry.key,
            problem::UnknownKey {
                key: key.to_owned(),
                what: what.to_owned(),
                known,
            },
        );
    }
}

/// Whether a key that is missing is there under a name that [`known_keys`] reports.
pub fn is_misspelt(table: &Table, key: &str, known: &[&str]) -> bool {
    !table.contains(key) && meant(table, key, known).is_some()
}

/// The value of a key, or of a misspelt one, which [`known_keys`] reports, so that nothing follows from its spelling.
pub(super) fn meant<'a>(table: &'a Table, key: &str, known: &[&str]) -> Option<&'a Value> {
    let is_meant =
        |given: &str| !known.contains(&given) && nearest(given, known.iter().copied()) == Some(key);
    let misspelt = || table.iter().find(|(given, _)| is_meant(given));
    let entry = || misspelt().map(|(_, entry)| &entry.value);
    table.get(key).or_else(entry)
}

pub(super) fn wrong_type(value: &Value, key: &str, expected: &str, diagnostics: &mut Diagnostics) {
    lacking(value, key, expected, None, diagnostics);
}

fn lacking(
    value: &Value,
    key: &str,
    expected: &str,
    hint: Option<Hint>,
    diagnostics: &mut Diagnostics,
) {
    let problem = problem::WrongType {
        key: Some(key.to_owned()),
        expected: expected.to_owned(),
        found: value.found(),
        hint,
    };
    diagnostics.report(value.place, problem);
}

pub(super) fn missing(
    table: &Value,
    key: &str,
    what: &str,
    advice: Option<&str>,
    diagnostics: &mut Diagnostics,
) {
    let problem = problem::MissingKey {
        key: key.to_owned(),
        what: what.to_owned(),
        advice: advice.map(str::to_owned),
    };
    diagnostics.report(table.place, problem);
}

pub(super) fn table<'a>(
    value: &'a Value,
    key: &str,
    diagnostics: &mut Diagnostics,
) -> Option<&'a Table> {
    let table = value.as_table();
    if table.is_none() {
        wrong_type(value, key, "a table", diagnostics);
    }
    table
}

pub(super) fn text<'a>(
    value: &'a Value,
    key: &str,
    diagnostics: &mut Diagnostics,
) -> Option<&'a str> {
    let text = value.as_text();
    if text.is_none() {
        wrong_type(value, key, "a text in quotes", diagnostics);
    }
    text
}

/// A list of texts, each with its place; entries of another type are reported and left out.
pub(super) fn texts(
    value: &Value,
    key: &str,
    expected: &str,
    diagnostics: &mut Diagnostics,
) -> Option<Vec<(String, Place)>> {
    let Data::List(values) = &value.data else {
        let hint = Hint::for_texts(&value.data);
        lacking(value, key, expected, hint, diagnostics);
        return None;
    };
    let texts = values
        .iter()
        .filter_map(|value| Some((text(value, key, diagnostics)?.to_owned(), value.place)));
    Some(texts.collect())
}

/// A text or a list of texts, with at least one entry.
pub(super) fn one_or_more(
    value: &Value,
    key: &str,
    what: &str,
    diagnostics: &mut Diagnostics,
) -> Option<Vec<(String, Place)>> {
    if let Some(text) = value.as_text() {
        return Some(vec![(text.to_owned(), value.place)]);
    }
    let texts = texts(value, key, "a text or a list of texts", diagnostics)?;
    if value.as_list().is_some_and(<[Value]>::is_empty) {
        diagnostics.report(
            value.place,
            problem::EmptyList {
                what: what.to_owned(),
            },
        );
        return None;
    }
    Some(texts)
}

/// A duration; a number of samples where `sample` says how long one is.
pub(super) fn duration(
    value: &Value,
    key: &str,
    sample: Option<Duration>,
    diagnostics: &mut Diagnostics,
) -> Option<Duration> {
    let Some(text) = value.as_text() else {
        let hint = Hint::for_duration(&value.data);
        lacking(value, key, "a duration like \"5min\"", hint, diagnostics);
        return None;
    };
    let read = match samples(text) {
        Some(number) => in_samples(text, number, sample),
        None => text
            .parse()
            .map_err(|error| problem::NotADuration { error }.into()),
    };
    read.map_err(|problem| diagnostics.report(value.place, problem))
        .ok()
}

/// A duration above 0.
pub(super) fn length(
    value: &Value,
    key: &'static str,
    sample: Option<Duration>,
    diagnostics: &mut Diagnostics,
) -> Option<Duration> {
    let length = duration(value, key, sample, diagnostics)?;
    if length > Duration::ZERO {
        return Some(length);
    }
    diagnostics.report(value.place, problem::NotPositive { key });
    None
}

/// A quantity in such a unit as this, or where it is known, in this one or one that converts.
pub(super) fn quantity(
    value: &Value,
    key: &str,
    (unit, is_known): (&str, bool),
    diagnostics: &mut Diagnostics,
) -> Option<Quantity> {
    let read = value.as_text().map(str::parse);
    match read {
        Some(Ok(quantity)) => return Some(quantity),
        Some(Err(QuantityError::NoUnit { .. })) | None => {
            let hint = Hint::for_quantity(&value.data, unit, is_known);
            let expected = if is_known {
                format!("a quantity in {unit}")
            } else {
                format!("a quantity like \"5 {unit}\"")
            };
            lacking(value, key, &expected, hint, diagnostics);
        }
        Some(Err(error)) => diagnostics.report(value.place, problem::NotAQuantity { error }),
    }
    None
}

/// The number in `"2 samples"` or `"1 sample"`; `None` for any other text.
pub(super) fn samples(text: &str) -> Option<&str> {
    let text = text.trim();
    let number = text
        .strip_suffix("samples")
        .or_else(|| text.strip_suffix("sample"))?
        .trim_end();
    (!number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())).then_some(number)
}

/// The time that `number` samples take.
pub(super) fn in_samples(
    text: &str,
    number: &str,
    sample: Option<Duration>,
) -> Result<Duration, Box<dyn Problem>> {
    let Some(sample) = sample else {
        let text = text.to_owned();
        return Err(problem::SamplesWithoutClock { text }.into());
    };
    number
        .parse::<i64>()
        .ok()
        .and_then(|number| number.checked_mul(sample.as_ns()))
        .map(Duration::from_ns)
        .ok_or_else(|| {
            let error = crate::time::DurationError::TooLong;
            problem::NotADuration { error }.into()
        })
}
