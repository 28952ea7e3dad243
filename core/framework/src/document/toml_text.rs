//! TOML text into a tree with places, every syntax error reported; what the keys mean is decided by others.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::problem::DocumentProblem;
use super::salvage::{self, Lost, SyntaxError, salvage};
use super::tree::{Data, Entry, Table, Value};
use crate::diagnostic::{Diagnostics, Place, SourceId};

/// How deep keys may nest; the stack of a thread bears several times as much.
const DEEPEST: usize = 64;

/// What could be read of a text.
pub(super) struct Parsed {
    pub(super) table: Table,
    /// What syntax errors cost, of which has been told.
    pub(super) lost: Vec<Lost>,
}

/// Reads `text`. After a syntax error the tree holds what the error does not touch; `None` where that cannot be told.
pub(super) fn parse(source: SourceId, text: &str, diagnostics: &mut Diagnostics) -> Option<Parsed> {
    if let Some(place) = too_deep(source, text) {
        // The parser does not limit dotted keys, and everything behind it is recursive.
        diagnostics.report(place, DocumentProblem::TooDeep { limit: DEEPEST });
        return None;
    }
    let (root, errors) = DeTable::parse_recoverable(text);
    if errors.is_empty() {
        let table = table(source, root.into_inner(), diagnostics);
        let lost = Vec::new();
        return Some(Parsed { table, lost });
    }
    let mut left = salvage(text);
    let told = left.as_mut().map(|left| std::mem::take(&mut left.errors));
    let told = told.filter(|told| !told.is_empty());
    for error in told.unwrap_or_else(|| salvage::errors(text, 0)) {
        let SyntaxError {
            bytes,
            reason,
            bare,
        } = error;
        let problem = DocumentProblem::Syntax { reason, bare };
        diagnostics.report(at(source, &bytes), problem);
    }
    let left = left?;
    let (root, _) = DeTable::parse_recoverable(&left.text);
    let table = table(source, root.into_inner(), diagnostics);
    let lost = left.lost;
    Some(Parsed { table, lost })
}

fn at(source: SourceId, span: &std::ops::Range<usize>) -> Place {
    let byte = |at: usize| u32::try_from(at).unwrap_or(u32::MAX);
    Place::new(source, byte(span.start), byte(span.end))
}

fn table(source: SourceId, table: DeTable<'_>, diagnostics: &mut Diagnostics) -> Table {
    table
        .into_iter()
        .map(|(key, spanned)| {
            let key_place = at(source, &key.span());
            let mut value = value(source, spanned, diagnostics);
            // A dotted key or an implied header has no text of its own.
            if value.place.start == value.place.end {
                value.place = key_place;
            }
            (
                key.into_inner().into_owned(),
                Entry {
                    key: key_place,
                    value,
                },
            )
        })
        .collect()
}

fn value(source: SourceId, spanned: Spanned<DeValue<'_>>, diagnostics: &mut Diagnostics) -> Value {
    let place = at(source, &spanned.span());
    let data = match spanned.into_inner() {
        DeValue::String(text) => Data::Text(text.into_owned()),
        DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
            Ok(number) => Data::Integer(number),
            Err(_) => {
                diagnostics.report(
                    place,
                    DocumentProblem::NumberTooLarge {
                        number: number.to_string(),
                    },
                );
                Data::Integer(0)
            }
        },
        DeValue::Float(number) => match number.as_str().parse::<f64>() {
            Ok(read) if read.is_infinite() && !number.as_str().contains("inf") => {
                diagnostics.report(
                    place,
                    DocumentProblem::NumberTooLarge {
                        number: number.to_string(),
                    },
                );
                Data::Float(0.0)
            }
            Ok(read) => Data::Float(read),
            Err(_) => {
                // After a syntax error the parser leaves what it could not read; that error is reported already.
                Data::Float(0.0)
            }
        },
        DeValue::Boolean(truth) => Data::Bool(truth),
        DeValue::Datetime(time) => Data::Time(time.to_string()),
        DeValue::Array(values) => Data::List(
            values
                .into_iter()
                .map(|element| value(source, element, diagnostics))
                .collect(),
        ),
        DeValue::Table(entries) => Data::Table(table(source, entries, diagnostics)),
    };
    Value::new(place, data)
}

/// The first key with more parts than may be nested.
fn too_deep(source: SourceId, text: &str) -> Option<Place> {
    let bytes = text.as_bytes();
    let mut dots = 0;
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
        if dots >= DEEPEST {
            return Some(at(source, &(at_byte..at_byte + 1)));
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
