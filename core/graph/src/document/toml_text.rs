//! TOML text into a tree with places, every syntax error reported; what the keys mean is decided by others.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::problem::DocumentProblem;
use super::salvage::{self, Lost, SyntaxError, salvage};
use super::slip;
use super::tree::{Data, Entry, Table, Value};
use crate::diagnostic::{Diagnostics, Place, SourceId};

/// How deep keys may nest; the stack of a thread bears several times as much.
const DEEPEST: usize = 64;

/// The most values of one list: as many as a graph may have instances. A tree of the millions that a file has room for would take
/// a hundred bytes for each before anybody could refuse them.
const LONGEST_LIST: usize = 200_000;

/// What could be read of a text.
pub(super) struct Parsed {
    pub(super) table: Table,
    /// What syntax errors cost, of which has been told.
    pub(super) lost: Vec<Lost>,
}

/// Reads `text`. After a syntax error the tree holds what the error does not touch; `None` where that cannot be told.
pub(super) fn parse(source: SourceId, text: &str, diagnostics: &mut Diagnostics) -> Option<Parsed> {
    if let Some((byte, problem)) = too_much(text) {
        diagnostics.report(at(source, &(byte..byte + 1)), problem);
        return None;
    }
    let (root, errors) = DeTable::parse_recoverable(text);
    if errors.is_empty() {
        return Some(Reader::new(source, diagnostics).parsed(root.into_inner(), Vec::new()));
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
        let slip = slip::of(text, &bytes);
        let problem = DocumentProblem::Syntax { reason, bare, slip };
        diagnostics.report(at(source, &bytes), problem);
    }
    let left = left?;
    let (root, _) = DeTable::parse_recoverable(&left.text);
    Some(Reader::new(source, diagnostics).parsed(root.into_inner(), left.lost))
}

fn at(source: SourceId, span: &std::ops::Range<usize>) -> Place {
    let byte = |at: usize| u32::try_from(at).unwrap_or(u32::MAX);
    Place::new(source, byte(span.start), byte(span.end))
}

/// Sections of which it does no harm to leave a key out: of the named things in them something may be missing.
const NAMED: [&str; 3] = ["sets", "signals", "nodes"];

/// What the parser gives, on its way into a tree.
struct Reader<'a> {
    source: SourceId,
    diagnostics: &'a mut Diagnostics,
    /// The keys down to what is read.
    way: Vec<String>,
    lost: Vec<Lost>,
}

impl<'a> Reader<'a> {
    fn new(source: SourceId, diagnostics: &'a mut Diagnostics) -> Self {
        Self {
            source,
            diagnostics,
            way: Vec::new(),
            lost: Vec::new(),
        }
    }

    fn parsed(mut self, root: DeTable<'_>, mut lost: Vec<Lost>) -> Parsed {
        let table = self.table(root);
        lost.append(&mut self.lost);
        Parsed { table, lost }
    }

    fn table(&mut self, table: DeTable<'_>) -> Table {
        let mut entries = Vec::with_capacity(table.len());
        for (key, spanned) in table {
            let key_place = at(self.source, &key.span());
            self.way.push(key.into_inner().into_owned());
            let value = self.value(spanned);
            let (Some(key), Some(mut value)) = (self.way.pop(), value) else {
                continue;
            };
            // A dotted key or an implied header has no text of its own.
            if value.place.start == value.place.end {
                value.place = key_place;
            }
            let entry = Entry {
                key: key_place,
                value,
            };
            entries.push((key, entry));
        }
        entries.into_iter().collect()
    }

    /// A number that nothing can hold is told. Whoever reads it would take what stands for it for what was meant, so it is left out
    /// where that can be known; none then.
    fn too_large(&mut self, place: Place, number: String, instead: Data) -> Option<Data> {
        let problem = DocumentProblem::NumberTooLarge { number };
        self.diagnostics.report(place, problem);
        let first = self.way.first().map_or("", String::as_str);
        if self.way.len() < 3 || !NAMED.contains(&first) {
            return Some(instead);
        }
        self.lost.push(Lost {
            way: Some(self.way.clone()),
            around: Vec::new(),
        });
        None
    }

    fn value(&mut self, spanned: Spanned<DeValue<'_>>) -> Option<Value> {
        let place = at(self.source, &spanned.span());
        let data = match spanned.into_inner() {
            DeValue::String(text) => Data::Text(text.into_owned()),
            DeValue::Integer(number) => {
                match i64::from_str_radix(number.as_str(), number.radix()) {
                    Ok(number) => Data::Integer(number),
                    Err(_) => self.too_large(place, number.to_string(), Data::Integer(0))?,
                }
            }
            DeValue::Float(number) => match number.as_str().parse::<f64>() {
                Ok(read) if read.is_infinite() && !number.as_str().contains("inf") => {
                    self.too_large(place, number.to_string(), Data::Float(0.0))?
                }
                Ok(read) => Data::Float(read),
                // After a syntax error the parser leaves what it could not read; that error is reported already.
                Err(_) => Data::Float(0.0),
            },
            DeValue::Boolean(truth) => Data::Bool(truth),
            DeValue::Datetime(time) => Data::Time(time.to_string()),
            DeValue::Array(values) => {
                let values = values.into_iter();
                Data::List(values.filter_map(|element| self.value(element)).collect())
            }
            DeValue::Table(entries) => Data::Table(self.table(entries)),
        };
        Some(Value::new(place, data))
    }
}

/// The first byte of what is too much to be parsed: a key with more parts than may be nested, since the parser does not limit them
/// and everything behind it is recursive; or a list with more values than any may have.
fn too_much(text: &str) -> Option<(usize, DocumentProblem)> {
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
            return Some((at_byte, DocumentProblem::TooDeep { limit: DEEPEST }));
        }
        if values > LONGEST_LIST {
            let limit = LONGEST_LIST;
            return Some((list, DocumentProblem::LongList { limit }));
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
