//! JSON lines as rows of cells: one flat object per line. Not what a cell means.

use std::fmt;
use std::ops::Range;

use athermal_core::time::TimeColumns;
use serde::de::{DeserializeSeed, Error, IgnoredAny, MapAccess, Visitor};
use serde_json::Deserializer;
use serde_json::value::RawValue;

use crate::cells::Cells;
use crate::columns;
use crate::detect::begins_json_array;
use crate::ledger::Ledger;
use crate::lines::Lines;
use crate::{FileError, Layout, Place};

/// The rows of a JSON lines file.
pub(crate) struct JsonRows {
    lines: Lines,
    keys: Vec<Key>,
    /// What gives the time; it has the first keys.
    time: TimeColumns,
    /// For each channel of the layout, its key.
    channels: Vec<usize>,
    /// The keys of the first object, for a message about those that lack.
    found: Option<Vec<String>>,
    /// Whether an object had the time.
    has_begun: bool,
    /// The cells of the current row, one after the other.
    text: Vec<u8>,
    repaired: Vec<u8>,
}

/// A key that is wanted.
struct Key {
    name: String,
    optional: bool,
    ever_seen: bool,
    /// Where its cell stands in the text of the row.
    cell: Option<Range<usize>>,
}

impl JsonRows {
    pub fn new(mut lines: Lines, layout: &Layout) -> Result<Self, FileError> {
        if !lines.advance_to_content()? {
            return Err(FileError::Empty { file: lines.file });
        }
        if begins_json_array(lines.text()) {
            return Err(FileError::JsonArray {
                place: lines.place(),
            });
        }
        let first = lines.take();
        lines.hold(vec![first]);
        let time = layout.time.columns.clone();
        let of_time = time.names().iter().map(|name| Key::new(name, false));
        let mut keys: Vec<Key> = of_time.collect();
        let mut channels = Vec::with_capacity(layout.channels.len());
        for channel in &layout.channels {
            let known = keys.iter().position(|key| key.name == channel.column);
            channels.push(known.unwrap_or(keys.len()));
            if known.is_none() {
                keys.push(Key::new(&channel.column, channel.optional));
            }
        }
        Ok(Self {
            lines,
            keys,
            time,
            channels,
            found: None,
            has_begun: false,
            text: Vec::new(),
            repaired: Vec::new(),
        })
    }

    fn read_object(&mut self) -> Result<(), serde_json::Error> {
        let line = self.lines.text().trim_ascii();
        let mut names = self.found.is_none().then(Vec::new);
        let mut object = Object {
            keys: &mut self.keys,
            text: &mut self.text,
            names: names.as_mut(),
        };
        object.read(line).or_else(|error| {
            if !repair_non_finite(line, &mut self.repaired) {
                return Err(error);
            }
            object.read(&self.repaired)
        })?;
        self.found = self.found.take().or(names);
        Ok(())
    }

    /// The error for keys that no object has had, if there are such.
    fn never_seen(&self) -> Option<FileError> {
        let never = self
            .keys
            .iter()
            .filter(|key| !key.ever_seen && !key.optional);
        let mut never = never.map(|key| key.name.as_str()).peekable();
        match &self.found {
            Some(found) if never.peek().is_some() => {
                Some(columns::missing(self.lines.place(), never, found, ""))
            }
            _ => None,
        }
    }
}

impl Key {
    fn new(name: &str, optional: bool) -> Self {
        Self {
            name: name.to_owned(),
            optional,
            ever_seen: false,
            cell: None,
        }
    }
}

impl Cells for JsonRows {
    fn advance(&mut self, ledger: &mut Ledger) -> Result<bool, FileError> {
        loop {
            match self.lines.advance_to_content() {
                Ok(true) => {}
                Ok(false) => break,
                Err(error) if error.is_of_line() && self.found.is_some() => {
                    ledger.refuse_row(|| error)?;
                    continue;
                }
                Err(error) => return Err(error),
            }
            if !self.lines.may_be_row() {
                ledger.report.truncated = Some(self.lines.place());
                break;
            }
            match self.read_object() {
                Ok(()) if self.of_time().all(|key| key.ever_seen) => {
                    // Most likely misspelt, though a later object may have them.
                    let is_first = !std::mem::replace(&mut self.has_begun, true);
                    if is_first && let Some(error) = self.never_seen() {
                        ledger.report_early(|| error);
                    }
                    return Ok(true);
                }
                // The time must stand in every object; what else this one lacks may stand in the next.
                Ok(()) => {
                    let found = self.found.as_deref().unwrap_or_default();
                    let time = self.of_time().filter(|key| !key.ever_seen);
                    let time = time.map(|key| key.name.as_str());
                    let missing = columns::missing(self.lines.place(), time, found, "");
                    ledger.refuse_row(|| missing)?;
                }
                Err(_) if !self.lines.is_complete() => {
                    ledger.report.truncated = Some(self.lines.place());
                    break;
                }
                Err(error) => ledger.refuse_row(|| FileError::BadObject {
                    place: self.lines.place(),
                    reason: reason(&error),
                })?,
            }
        }
        // Of what never ends that was reported at the first object, and another may have them when it goes on.
        match self.never_seen() {
            Some(error) if ledger.on_first.is_none() => Err(error),
            _ => Ok(false),
        }
    }

    fn time(&self, column: usize) -> &[u8] {
        self.cell(column)
    }

    fn channel(&self, index: usize) -> &[u8] {
        self.cell(self.channels[index])
    }

    fn place(&self) -> Place {
        self.lines.place()
    }
}

impl JsonRows {
    /// Which channels some object had.
    pub fn present(&self) -> Vec<bool> {
        let seen = |&key: &usize| self.keys[key].ever_seen;
        self.channels.iter().map(seen).collect()
    }

    /// The keys of the first object.
    pub fn names(&self) -> Vec<String> {
        self.found.clone().unwrap_or_default()
    }

    /// The keys of the time.
    fn of_time(&self) -> impl Iterator<Item = &Key> {
        self.keys[..self.time.names().len()].iter()
    }

    fn cell(&self, key: usize) -> &[u8] {
        match &self.keys[key].cell {
            Some(range) => &self.text[range.clone()],
            None => &[],
        }
    }
}

/// The parser counts lines within the line that it is given, and says so at the end of its message.
fn reason(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let place = format!(" at line {} column {}", error.line(), error.column());
    match text.strip_suffix(&place) {
        Some(what) => format!("{what} at column {}", error.column()),
        None => text,
    }
}

/// Reads one object, keeping the cells of the wanted keys.
struct Object<'r> {
    keys: &'r mut [Key],
    text: &'r mut Vec<u8>,
    names: Option<&'r mut Vec<String>>,
}

impl Object<'_> {
    fn read(&mut self, line: &[u8]) -> Result<(), serde_json::Error> {
        self.text.clear();
        self.keys.iter_mut().for_each(|key| key.cell = None);
        if let Some(names) = &mut self.names {
            names.clear();
        }
        let mut deserializer = Deserializer::from_slice(line);
        serde::Deserializer::deserialize_map(&mut deserializer, &mut *self)?;
        deserializer.end()
    }

    fn keep<E: Error>(&mut self, key: usize, raw: &str) -> Result<(), E> {
        let key = &mut self.keys[key];
        if key.cell.is_some() {
            return Err(E::custom(format_args!(
                "the key `{}` stands twice",
                key.name
            )));
        }
        let start = self.text.len();
        match raw.strip_prefix('"').and_then(|s| s.strip_suffix('"')) {
            Some(_) if raw.contains('\\') => {
                let plain: String = serde_json::from_str(raw).map_err(E::custom)?;
                self.text.extend_from_slice(plain.as_bytes());
            }
            Some(plain) => self.text.extend_from_slice(plain.as_bytes()),
            None if raw == "null" => {}
            None => self.text.extend_from_slice(raw.as_bytes()),
        }
        key.cell = Some(start..self.text.len());
        key.ever_seen = true;
        Ok(())
    }
}

impl<'de> Visitor<'de> for &mut Object<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<(), M::Error> {
        let mut expected = 0;
        while let Some(key) = map.next_key_seed(KeySeed {
            keys: self.keys,
            expected,
            names: self.names.as_deref_mut(),
        })? {
            match key {
                Some(key) => {
                    let raw: &RawValue = map.next_value()?;
                    self.keep(key, raw.get())?;
                    expected = key + 1;
                }
                None => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
        }
        Ok(())
    }
}

/// Finds a key among those wanted, first where the order of the last row lets it be expected.
struct KeySeed<'r> {
    keys: &'r [Key],
    expected: usize,
    names: Option<&'r mut Vec<String>>,
}

impl<'de> DeserializeSeed<'de> for KeySeed<'_> {
    type Value = Option<usize>;

    fn deserialize<D: serde::Deserializer<'de>>(
        self,
        deserializer: D,
    ) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl Visitor<'_> for KeySeed<'_> {
    type Value = Option<usize>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E>(self, name: &str) -> Result<Self::Value, E> {
        if let Some(names) = self.names {
            names.push(name.to_owned());
        }
        let later = self.expected..self.keys.len();
        let earlier = 0..self.expected.min(self.keys.len());
        Ok(later
            .chain(earlier)
            .find(|&key| self.keys[key].name == name))
    }
}

/// Some programs write `NaN` and `Infinity`, which JSON lacks. False if there is none outside of strings.
fn repair_non_finite(line: &[u8], repaired: &mut Vec<u8>) -> bool {
    repaired.clear();
    let mut rest = line;
    let (mut quoted, mut found) = (false, false);
    while let Some(&byte) = rest.first() {
        let (taken, written): (usize, &[u8]) = match byte {
            b'\\' if quoted => (rest.len().min(2), &rest[..rest.len().min(2)]),
            b'N' if !quoted && rest.starts_with(b"NaN") => (3, b"null"),
            b'I' if !quoted && rest.starts_with(b"Infinity") => (8, b"1e999"),
            _ => (1, &rest[..1]),
        };
        quoted ^= byte == b'"';
        found |= taken > 2;
        repaired.extend_from_slice(written);
        rest = &rest[taken..];
    }
    found
}

#[cfg(test)]
mod tests;
