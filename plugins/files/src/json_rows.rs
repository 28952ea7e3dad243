//! JSON lines as rows of cells: one flat object per line. Not what a cell means.

use std::fmt;
use std::ops::Range;

use athermal_core::time::TimeColumns;
use serde::de::{DeserializeSeed, Error, IgnoredAny, MapAccess, Visitor};
use serde_json::Deserializer;
use serde_json::value::RawValue;

use crate::cell::trim;
use crate::cells::Cells;
use crate::columns;
use crate::format::begins_json_array;
use crate::ledger::Ledger;
use crate::lines::Lines;
use crate::{FileError, Layout, Place};

/// The rows of a JSON lines file.
pub(crate) struct JsonRows {
    lines: Lines,
    keys: Vec<Key>,
    /// What gives the time; it has the first keys.
    time: TimeColumns,
    /// The text of the time of the current row, where it is put together from several cells.
    joined: Vec<u8>,
    /// For each channel of the layout, its key.
    channels: Vec<usize>,
    /// The keys of the first object, for a message about those that lack.
    found: Option<Vec<String>>,
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
            joined: Vec::new(),
            channels,
            found: None,
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
                Some(columns::missing(self.lines.place(), never, found, false))
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
            let is_first = self.found.is_none();
            match self.read_object() {
                Ok(()) if self.of_time().all(|key| key.ever_seen) => {
                    // Most likely misspelt, though a later object may have them.
                    if is_first && let Some(error) = self.never_seen() {
                        ledger.tell_early(|| error);
                    }
                    if !self.time.is_one() {
                        self.join_time();
                    }
                    return Ok(true);
                }
                // The time must stand in every object; what else this one lacks may stand in the next.
                Ok(()) => {
                    let found = self.found.as_deref().unwrap_or_default();
                    let time = self.of_time().filter(|key| !key.ever_seen);
                    let time = time.map(|key| key.name.as_str());
                    return Err(columns::missing(self.lines.place(), time, found, false));
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
        // Of what never ends whoever asked was told at the first object, and another may have them when it goes on.
        match self.never_seen() {
            Some(error) if ledger.tell.is_none() => Err(error),
            _ => Ok(false),
        }
    }

    fn time(&self) -> &[u8] {
        match self.time.is_one() {
            true => self.cell(0),
            false => &self.joined,
        }
    }

    fn channel(&self, index: usize) -> &[u8] {
        self.cell(self.channels[index])
    }

    fn decimal_comma(&self) -> bool {
        false
    }

    fn place(&self) -> Place {
        self.lines.place()
    }
}

impl JsonRows {
    /// The keys of the time.
    fn of_time(&self) -> impl Iterator<Item = &Key> {
        self.keys[..self.time.names().len()].iter()
    }

    /// Puts the time of the current row together.
    fn join_time(&mut self) {
        let mut text = std::mem::take(&mut self.joined);
        self.time.join(&mut text, |key| trim(self.cell(key)));
        self.joined = text;
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
mod tests {
    use crate::{FileError, Layout, Options, Reader, Row, TimeForm};

    fn read_with(text: &str, lenient: bool) -> Result<(String, Reader), FileError> {
        let layout = Layout::new("t", TimeForm::SECONDS, ["a", "b"]);
        let options = Options {
            lenient,
            ..Options::default()
        };
        let input = std::io::Cursor::new(text.to_owned());
        let mut reader = Reader::from_read("standard input", input, layout, options)?;
        let mut row = Row::default();
        let mut told = Vec::new();
        while reader.next_into(&mut row)? {
            told.push(format!("{} {:?}", row.time_text, row.values));
        }
        Ok((told.join("; "), reader))
    }

    fn read(text: &str) -> String {
        read_with(text, false).unwrap().0
    }

    fn error(text: &str) -> String {
        read_with(text, false).err().unwrap().to_string()
    }

    #[test]
    fn an_object_is_known_by_its_brace_and_its_keys_may_stand_in_any_order() {
        assert_eq!(
            read(
                "{\"t\": 0.3, \"a\": 1, \"b\": 2.5}\n\n{\"x\": {\"a\": [7]}, \"b\": 3e0, \"t\": 1, \"a\": -1}\r\n"
            ),
            "0.3 [1.0, 2.5]; 1 [-1.0, 3.0]"
        );
    }

    #[test]
    fn files_with_a_mark_that_are_put_behind_each_other_are_read_as_one() {
        let line = |t: u32| format!("\u{feff}{{\"t\":{t},\"a\":1,\"b\":2}}\n");
        assert_eq!(read(&(line(0) + &line(1))), "0 [1.0, 2.0]; 1 [1.0, 2.0]");
    }

    #[test]
    fn null_and_a_missing_key_are_no_value() {
        assert_eq!(
            read("{\"t\":0,\"a\":null}\n{\"t\":1,\"b\":2,\"a\":1}\n{\"t\":2}\n"),
            "0 [NaN, NaN]; 1 [1.0, 2.0]; 2 [NaN, NaN]"
        );
    }

    #[test]
    fn non_finite_numbers_are_read_as_text_and_as_python_writes_them() {
        assert_eq!(
            read(
                "{\"t\":0,\"a\":\"-inf\",\"b\":\"NaN\"}\n{\"t\":1,\"a\":-Infinity,\"b\":NaN,\"n\":\"\\\"NaN\"}\n"
            ),
            "0 [-inf, NaN]; 1 [-inf, NaN]"
        );
    }

    #[test]
    fn text_with_escapes_is_the_same_text() {
        assert_eq!(
            read("{\"\\u0074\":\"\\u0030\",\"a\":1,\"b\":\"2\"}"),
            "0 [1.0, 2.0]"
        );
    }

    #[test]
    fn a_flag_is_one_or_zero() {
        assert_eq!(
            read("{\"t\":0,\"a\":true,\"b\":\"False\"}\n"),
            "0 [1.0, 0.0]"
        );
    }

    #[test]
    fn a_value_that_is_no_number_is_an_error_with_line_and_key() {
        for value in ["[1]", "{}", "\"off\""] {
            let text = format!("{{\"t\":0,\"a\":1,\"b\":2}}\n{{\"t\":1,\"a\":{value}}}\n");
            let found = value.trim_matches('"');
            assert!(
                error(&text).starts_with(&format!(
                    "standard input:2: column `a`: expected a number, found `{found}`"
                )),
                "{value}"
            );
            let (rows, reader) = read_with(&text, true).unwrap();
            assert_eq!(rows, "0 [1.0, 2.0]; 1 [NaN, NaN]");
            assert_eq!(reader.report().bad_cells.count, 1);
        }
    }

    #[test]
    fn a_line_that_is_no_object_is_an_error_or_left_out() {
        let text = "{\"t\":0,\"a\":1,\"b\":2}\n{\"t\":1 \"a\":1}\n[1]\n{\"t\":1} {}\n{\"t\":2,\"t\":3}\n{\"t\":4}\n";
        assert_eq!(
            error(text),
            "standard input:2: expected one JSON object on the line: expected `,` or `}` at column 8; write one object per line, or read leniently (`--lenient`) to leave the line out"
        );
        let (rows, reader) = read_with(text, true).unwrap();
        assert_eq!(rows, "0 [1.0, 2.0]; 4 [NaN, NaN]");
        let refused = &reader.report().refused_rows;
        assert_eq!(refused.count, 4);
        assert!(
            matches!(&refused.first, Some(FileError::BadObject { place, .. }) if place.line == 2)
        );
    }

    #[test]
    fn an_array_is_an_error_that_asks_for_one_object_a_line() {
        let object = "{\"t\":0,\"a\":1,\"b\":2}";
        let long = format!("[{}{object}]", format!("{object},").repeat(50_000));
        let arrays = [
            format!("[{object},{object}]"),
            format!("[{object}]\n"),
            format!("[\n  {object},\n  {object}\n]\n"),
            "[[0,1,2]]".to_owned(),
            long,
        ];
        for text in arrays {
            for lenient in [false, true] {
                let told = read_with(&text, lenient).err().unwrap().to_string();
                assert!(
                    told.starts_with("standard input:1: a JSON array begins here, where one object a line is expected"),
                    "{told}"
                );
            }
        }
        let layout = Layout::new("[s]", TimeForm::SECONDS, ["a"]);
        let header = &b"[s],a\n0,1\n"[..];
        assert!(Reader::from_read("f", header, layout, Options::default()).is_ok());
    }

    #[test]
    fn a_line_without_time_is_an_error_or_left_out() {
        let text = "{\"t\":0,\"a\":1,\"b\":2}\n{\"a\":1}\n";
        assert!(
            error(text).starts_with(
                "standard input:2: column `t`: expected a decimal number, found nothing"
            )
        );
        assert_eq!(
            read_with(text, true).unwrap().1.report().refused_rows.count,
            1
        );
    }

    #[test]
    fn keys_that_never_come_are_an_error_that_lists_those_found() {
        assert_eq!(
            error("{\"time\":0,\"a\":1}\n"),
            "standard input:1: there is no column `t`; found `time`, `a`; correct the name, or make it optional if it is a channel"
        );
        assert_eq!(
            error("{\"t\":0,\"a\":1,\"bb\":1}\n{\"t\":1}\n"),
            "standard input:2: there is no column `b`; found `t`, `a`, `bb`; did you mean `bb`?"
        );
        assert_eq!(
            error("{\"t\":0,\"aa\":1,\"bb\":1}\n{\"t\":1}\n"),
            "standard input:2: there are no columns `a`, `b`; found `t`, `aa`, `bb`; did you mean `aa` for `a`, `bb` for `b`?"
        );
    }

    #[test]
    fn keys_that_the_first_object_lacks_are_told_at_once_where_that_is_asked_for() {
        use std::sync::{Arc, Mutex};
        let layout = Layout::new("t", TimeForm::SECONDS, ["a", "b"]);
        let text = &b"{\"t\":0,\"a\":1,\"bb\":1}\n{\"t\":1}\n{\"t\":2,\"b\":1}\n"[..];
        let mut reader = Reader::from_read("pipe", text, layout, Options::default()).unwrap();
        let told = Arc::new(Mutex::new(Vec::new()));
        reader.tell_first({
            let told = Arc::clone(&told);
            move |first| told.lock().unwrap().push(first.to_string())
        });
        let expected = ["pipe:1: there is no column `b`; found `t`, `a`, `bb`; did you mean `bb`?"];
        let mut row = Row::default();
        while reader.next_into(&mut row).unwrap() {
            assert_eq!(*told.lock().unwrap(), expected);
        }
    }

    #[test]
    fn a_line_that_is_too_long_is_an_error_or_left_out_and_the_next_is_read() {
        for long in ["{\"x\":\"", "["] {
            let long = long.to_owned() + &"y".repeat(3_000_000);
            let text =
                format!("{{\"t\":0,\"a\":1,\"b\":2}}\n{long}\n{{\"t\":1,\"a\":3,\"b\":4}}\n");
            assert!(read_with(&text, false).is_err());
            let (rows, reader) = read_with(&text, true).unwrap();
            assert_eq!(rows, "0 [1.0, 2.0]; 1 [3.0, 4.0]");
            assert_eq!(reader.report().refused_rows.count, 1);
        }
    }

    #[test]
    fn a_last_object_that_was_cut_off_is_reported_and_the_rest_used() {
        let (rows, reader) = read_with("{\"t\":0,\"a\":1,\"b\":2}\n{\"t\":1,\"a\"", false).unwrap();
        assert_eq!(rows, "0 [1.0, 2.0]");
        assert_eq!(
            reader.report().truncated.as_ref().map(|place| place.line),
            Some(2)
        );
        let (rows, reader) = read_with("{\"t\":0,\"a\":1,\"b\":2}", false).unwrap();
        assert_eq!(rows, "0 [1.0, 2.0]");
        assert!(reader.report().truncated.is_none());
    }

    #[test]
    fn a_last_object_without_a_line_end_is_left_out_where_more_comes_later() {
        let options = Options {
            goes_on: true,
            ..Options::default()
        };
        let layout = Layout::new("t", TimeForm::SECONDS, ["a"]);
        let text = &b"{\"t\":0,\"a\":1}\n{\"t\":1,\"a\":2}"[..];
        let mut reader = Reader::from_read("pipe", text, layout, options).unwrap();
        let mut row = Row::default();
        assert!(reader.next_into(&mut row).unwrap());
        assert!(!reader.next_into(&mut row).unwrap());
        assert_eq!(reader.report().truncated.as_ref().unwrap().line, 2);
    }
}
