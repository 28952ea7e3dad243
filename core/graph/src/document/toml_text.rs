//! TOML text into a tree with places, or all syntax errors.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue, Error};

use super::foreign_syntax;
use super::problem;
use super::tree::{Data, Entry, Table, Value};
use crate::diagnostic::{Diagnostics, Place, Problem, SourceId};

/// How deep keys may nest; the stack of a thread bears several times as much.
const DEEPEST: usize = 64;

/// The most values of one list: as many as a graph may have instances. A tree of the millions that a file has room for would take
/// a hundred bytes for each before anybody could refuse them.
const LONGEST_LIST: usize = 200_000;

/// What the parser says of a key that stands twice.
pub(super) const DUPLICATE_KEY: &str = "duplicate key";

/// Reads `text`; `None` where there are syntax errors or numbers that nothing holds, all of which are reported.
pub(super) fn parse(source: SourceId, text: &str, diagnostics: &mut Diagnostics) -> Option<Table> {
    if let Some((byte, problem)) = too_much(text) {
        diagnostics.report(at(source, &(byte..byte + 1)), problem);
        return None;
    }
    let (root, errors) = DeTable::parse_recoverable(text);
    if errors.is_empty() {
        return table(source, root.into_inner(), diagnostics);
    }
    let place = |error: &Error| error.span().unwrap_or(text.len()..text.len());
    let mut errors: Vec<_> = errors.iter().map(|error| (place(error), error)).collect();
    errors.sort_by_key(|(bytes, _)| bytes.start);
    // Behind the first error of a line the parser takes the rest of it for what it is not.
    errors.dedup_by(|(next, _), (first, _)| {
        let between = text.get(first.start..next.start).unwrap_or_default();
        !between.contains('\n')
    });
    for (bytes, error) in errors {
        let reason = error.message().to_owned();
        let problem = problem::Syntax {
            bare: bare(text, &bytes).filter(|_| reason != DUPLICATE_KEY),
            foreign: foreign_syntax::of(text, &bytes),
            reason,
        };
        diagnostics.report(at(source, &bytes), problem);
    }
    None
}

/// The text of a value that has no quotes, where it should have.
fn bare(text: &str, span: &Range<usize>) -> Option<String> {
    let found = text.get(span.clone())?;
    let is_value = text[..span.start].trim_end().ends_with(['=', '[', ',']);
    let is_key = text[span.end..].trim_start().starts_with(['=', '.']);
    let is_word = found.starts_with(char::is_alphanumeric)
        && found.contains(char::is_alphabetic)
        && !found.contains(['"', '\'', '\n']);
    (is_value && !is_key && is_word).then(|| found.to_owned())
}

fn at(source: SourceId, span: &Range<usize>) -> Place {
    let byte = |at: usize| u32::try_from(at).unwrap_or(u32::MAX);
    Place::new(source, byte(span.start), byte(span.end))
}

fn table(source: SourceId, table: DeTable<'_>, diagnostics: &mut Diagnostics) -> Option<Table> {
    // All values are read before any is given up, so that each number that is too large is reported.
    let entries = table.into_iter().map(|(key, spanned)| {
        let key_place = at(source, &key.span());
        let mut value = value(source, spanned, diagnostics)?;
        // A dotted key or an implied header has no text of its own.
        if value.place.start == value.place.end {
            value.place = key_place;
        }
        let entry = Entry {
            key: key_place,
            value,
        };
        Some((key.into_inner().into_owned(), entry))
    });
    let entries: Vec<_> = entries.collect();
    entries.into_iter().collect()
}

fn value(
    source: SourceId,
    spanned: Spanned<DeValue<'_>>,
    diagnostics: &mut Diagnostics,
) -> Option<Value> {
    let place = at(source, &spanned.span());
    let mut too_large = |number: String| {
        diagnostics.report(place, problem::NumberTooLarge { number });
        None
    };
    let data = match spanned.into_inner() {
        DeValue::String(text) => Data::Text(text.into_owned()),
        DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
            Ok(number) => Data::Integer(number),
            Err(_) => return too_large(number.to_string()),
        },
        DeValue::Float(number) => match number.as_str().parse::<f64>() {
            Ok(read) if read.is_finite() || !number.as_str().contains(char::is_numeric) => {
                Data::Float(read)
            }
            _ => return too_large(number.to_string()),
        },
        DeValue::Boolean(truth) => Data::Bool(truth),
        DeValue::Datetime(time) => Data::Time(time.to_string()),
        DeValue::Array(values) => {
            let values = values.into_iter();
            let values: Vec<_> = values
                .map(|element| value(source, element, diagnostics))
                .collect();
            Data::List(values.into_iter().collect::<Option<_>>()?)
        }
        DeValue::Table(entries) => Data::Table(table(source, entries, diagnostics)?),
    };
    Some(Value::new(place, data))
}

/// The first byte of what is too much to be parsed: a key with more parts than may be nested, since the parser does not limit them
/// and everything behind it is recursive; or a list with more values than any may have.
fn too_much(text: &str) -> Option<(usize, Box<dyn Problem>)> {
    let bytes = text.as_bytes();
    let mut dots = 0;
    let (mut list, mut values) = (0, 0);
    let mut at_byte = 0;
    while let Some(&byte) = bytes.get(at_byte) {
        match byte {
            b'"' | b'\'' => {
                at_byte = after_string(bytes, at_byte, byte);
                continue;
            }
            b'#' => {
                while bytes.get(at_byte).is_some_and(|&byte| byte != b'\n') {
                    at_byte += 1;
                }
                continue;
            }
            b'.' => dots += 1,
            b'\n' | b'=' | b',' | b'{' | b'[' => dots = 0,
            _ => {}
        }
        match byte {
            b'=' => (list, values) = (at_byte, 0),
            b',' => values += 1,
            _ => {}
        }
        if dots >= DEEPEST {
            return Some((at_byte, problem::TooDeep { limit: DEEPEST }.into()));
        }
        if values > LONGEST_LIST {
            let limit = LONGEST_LIST;
            return Some((list, problem::LongList { limit }.into()));
        }
        at_byte += 1;
    }
    None
}

/// The byte after the string that starts at `start`; strings on one line end with it.
fn after_string(bytes: &[u8], start: usize, quote: u8) -> usize {
    let escapes = quote == b'"';
    let triple = [quote; 3];
    let multi_line = bytes[start..].starts_with(&triple);
    let mut at = start + if multi_line { 3 } else { 1 };
    while let Some(&byte) = bytes.get(at) {
        match byte {
            b'\\' if escapes => at += 1,
            b'\n' if !multi_line => return at,
            _ if multi_line && bytes[at..].starts_with(&triple) => return at + 3,
            _ if !multi_line && byte == quote => return at + 1,
            _ => {}
        }
        at += 1;
    }
    bytes.len()
}
