//! Lines of a byte stream, each as soon as it is there, in constant memory, in UTF-8 also where the stream begins with a
//! mark that says UTF-16. Not what a line means, save that blank lines, comments and the mark of UTF-8 mean nothing.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;
use std::sync::Arc;

use athermal_core::document::Encoding;
use encoding_rs::{UTF_16BE, UTF_16LE, WINDOWS_1252};
use encoding_rs_io::DecodeReaderBytesBuilder;

use crate::detect::begins_json_array;
use crate::runs::Merge;
use crate::unpacked::{NoText, Unpacked};
use crate::{FileError, Format, Place};

/// The longest row, in bytes, so that a stray quote or a binary file cannot fill the memory.
pub(crate) const LONGEST_ROW: usize = 1 << 20;

/// Bytes read ahead, or held back when writing, at most.
pub(crate) const BUFFER: usize = 64 * 1024;

/// What begins a text in UTF-8 that says so. Where files are put behind each other it begins a line.
pub(crate) const MARK: &[u8] = "\u{feff}".as_bytes();

/// The name of `-` in messages.
pub const STANDARD_INPUT: &str = "standard input";

/// A stream cut into lines.
pub(crate) struct Lines {
    pub file: Arc<str>,
    input: BufReader<Box<dyn Read + Send>>,
    line: Vec<u8>,
    number: u64,
    /// Lines that were read and are to come again, the next one last.
    held: Vec<(u64, Vec<u8>)>,
    /// Whether the last line that was read was too long and is not yet read to its end.
    is_cut_short: bool,
    /// Whether comments are content: the header was one, and so may the next be.
    pub comments_count: bool,
    /// Whether a line without an end is no row, whatever it holds.
    pub only_whole: bool,
    /// What gives the lines from here on, in another order.
    pub merge: Option<Box<Merge>>,
}

impl Lines {
    pub fn new(
        file: Arc<str>,
        encoding: Option<Encoding>,
        input: impl Read + Send + 'static,
    ) -> Self {
        let declared = encoding.and_then(|encoding| match encoding {
            Encoding::Utf8 => None,
            Encoding::Utf16Le => Some(UTF_16LE),
            Encoding::Utf16Be => Some(UTF_16BE),
            Encoding::Windows1252 => Some(WINDOWS_1252),
        });
        let decoded = DecodeReaderBytesBuilder::new()
            .encoding(declared)
            .bom_sniffing(encoding.is_none())
            .utf8_passthru(true)
            .strip_bom(true)
            .build(Unpacked::New(Box::new(input)));
        Self {
            file,
            input: BufReader::with_capacity(BUFFER, Box::new(decoded)),
            line: Vec::new(),
            number: 0,
            held: Vec::new(),
            is_cut_short: false,
            comments_count: false,
            only_whole: false,
            merge: None,
        }
    }

    /// A file, or standard input for `-`.
    pub fn open(path: &Path, encoding: Option<Encoding>) -> Result<Self, FileError> {
        Self::open_through(path, encoding, |input| input)
    }

    /// The same, with something between it and the lines.
    pub fn open_through(
        path: &Path,
        encoding: Option<Encoding>,
        through: impl FnOnce(Box<dyn Read + Send>) -> Box<dyn Read + Send>,
    ) -> Result<Self, FileError> {
        if path == Path::new("-") {
            return Ok(Self::new(
                STANDARD_INPUT.into(),
                encoding,
                through(Box::new(io::stdin())),
            ));
        }
        let file: Arc<str> = path.display().to_string().into();
        match File::open(path) {
            Ok(input) => Ok(Self::new(file, encoding, through(Box::new(input)))),
            Err(source) => Err(FileError::cannot_open(path, source)),
        }
    }

    /// Goes to the next line; false at the end of the stream.
    ///
    /// # Errors
    /// The stream cannot be read, or the line is too long; the next one can then be gone to.
    pub fn advance(&mut self) -> Result<bool, FileError> {
        if let Some((number, line)) = self.held.pop() {
            (self.number, self.line) = (number, line);
            return self.check_length();
        }
        if let Some(merge) = &mut self.merge {
            self.line.clear();
            let number = merge.advance(&mut self.line);
            return match number {
                Ok(number) => {
                    self.number = number.unwrap_or(self.number);
                    Ok(number.is_some())
                }
                Err(source) => Err(FileError::Read {
                    place: self.place(),
                    source: Arc::new(source),
                }),
            };
        }
        self.pass_over_rest()?;
        self.line.clear();
        let limit = LONGEST_ROW as u64 + 1;
        let mut input = (&mut self.input).take(limit);
        if let Err(source) = input.read_until(b'\n', &mut self.line) {
            let inner = source.get_ref().and_then(|inner| inner.downcast_ref());
            if let Some(NoText(what)) = inner {
                return Err(FileError::Unfit {
                    file: self.file.clone(),
                    reason: (*what).to_owned(),
                });
            }
            return Err(FileError::Read {
                place: self.place_of(self.number + 1),
                source: Arc::new(source),
            });
        }
        if self.line.is_empty() {
            return Ok(false);
        }
        self.number += 1;
        self.is_cut_short = self.line.len() > LONGEST_ROW && !self.is_complete();
        if self.line.starts_with(MARK) && !self.is_cut_short {
            self.line.drain(..MARK.len());
        }
        self.check_length()
    }

    fn check_length(&self) -> Result<bool, FileError> {
        if self.line.len() <= LONGEST_ROW {
            return Ok(true);
        }
        let place = self.place();
        Err(match begins_json_array(&self.line) {
            true => FileError::JsonArray { place },
            false => FileError::TooLong {
                place,
                limit: LONGEST_ROW,
            },
        })
    }

    /// Passes over what is left of a line that was too long.
    fn pass_over_rest(&mut self) -> Result<(), FileError> {
        if std::mem::take(&mut self.is_cut_short) {
            let passed = self.input.skip_until(b'\n');
            passed.map_err(|source| FileError::Read {
                place: self.place(),
                source: Arc::new(source),
            })?;
        }
        Ok(())
    }

    /// Goes to the next line that is neither blank nor a comment; false at the end of the stream.
    pub fn advance_to_content(&mut self) -> Result<bool, FileError> {
        while self.advance()? {
            if is_content(&self.line) || self.comments_count && !self.line.trim_ascii().is_empty() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The format stated, or the one that the first line of content looks like; all lines stay to be read.
    pub fn format_or(&mut self, stated: Option<Format>) -> Result<Format, FileError> {
        if let Some(format) = stated {
            return Ok(format);
        }
        let mut lines = Vec::new();
        loop {
            if !self.advance()? {
                return Err(FileError::Empty {
                    file: self.file.clone(),
                });
            }
            let is_content = is_content(&self.line);
            let format = Format::from_first_line(&self.line);
            lines.push(self.take());
            if is_content {
                self.hold(lines);
                return Ok(format);
            }
        }
    }

    /// Whether no line that was read is to come again.
    pub fn holds_none(&self) -> bool {
        self.held.is_empty()
    }

    /// Takes the current line out, with its number.
    pub fn take(&mut self) -> (u64, Vec<u8>) {
        (self.number, std::mem::take(&mut self.line))
    }

    /// The same, if there is one.
    pub fn take_any(&mut self) -> Option<(u64, Vec<u8>)> {
        (!self.line.is_empty()).then(|| self.take())
    }

    /// Gives lines with these numbers, the first of them at the next call.
    pub fn hold(&mut self, lines: Vec<(u64, Vec<u8>)>) {
        self.held.extend(lines.into_iter().rev());
    }

    /// The current line with its end, if it has one.
    pub fn text(&self) -> &[u8] {
        &self.line
    }

    /// The number of the current line, from 1.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Whether the current line has an end; only the last one of a stream may not.
    pub fn is_complete(&self) -> bool {
        self.line.ends_with(b"\n")
    }

    /// Whether the current line may be a row.
    pub fn may_be_row(&self) -> bool {
        !self.only_whole || self.is_complete()
    }

    pub fn place(&self) -> Place {
        self.place_of(self.number)
    }

    pub fn place_of(&self, line: u64) -> Place {
        Place {
            file: self.file.clone(),
            line,
        }
    }
}

/// Whether a line is neither blank nor a comment.
pub(crate) fn is_content(line: &[u8]) -> bool {
    !matches!(line.trim_ascii_start().first(), None | Some(b'#'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(bytes: impl Read + Send + 'static) -> Lines {
        Lines::new("test".into(), None, bytes)
    }

    #[test]
    fn blank_lines_and_comments_are_skipped_and_counted() {
        let mut lines = lines(&b"\xef\xbb\xbf# made by hand\n\r\n  # more\n \t\na,b\r\n"[..]);
        assert!(lines.advance_to_content().unwrap());
        assert_eq!((lines.text(), lines.number()), (&b"a,b\r\n"[..], 5));
        assert!(!lines.advance_to_content().unwrap());
    }

    #[test]
    fn the_mark_that_begins_a_file_in_utf_8_is_left_out_wherever_it_begins_a_line() {
        let text = "\u{feff}a\n\u{feff}b\u{feff}\n\u{feff}\n\u{feff}c";
        let mut lines = lines(text.as_bytes());
        for expected in ["a\n", "b\u{feff}\n", "c"] {
            assert!(lines.advance_to_content().unwrap());
            assert_eq!(lines.text(), expected.as_bytes());
        }
        assert!(!lines.advance_to_content().unwrap());
    }

    #[test]
    fn text_of_two_bytes_per_character_is_read_by_its_mark() {
        let text = "\u{feff}t\tWärme [°C]\r\n0\t1\r\n";
        for order in [u16::to_le_bytes, u16::to_be_bytes] {
            let bytes: Vec<u8> = text.encode_utf16().flat_map(order).collect();
            let mut lines = lines(std::io::Cursor::new(bytes));
            assert!(lines.advance().unwrap());
            assert_eq!(lines.text(), "t\tWärme [°C]\r\n".as_bytes());
            assert!(lines.advance().unwrap());
            assert_eq!((lines.text(), lines.number()), (&b"0\t1\r\n"[..], 2));
        }
    }

    #[test]
    fn a_line_that_is_held_comes_again() {
        let mut lines = lines(&b"a\nb"[..]);
        assert!(lines.advance().unwrap());
        let line = lines.take();
        lines.hold(vec![line]);
        assert!(lines.advance().unwrap());
        assert_eq!(
            (lines.text(), lines.number(), lines.is_complete()),
            (&b"a\n"[..], 1, true)
        );
        assert!(lines.advance().unwrap());
        assert_eq!(
            (lines.text(), lines.number(), lines.is_complete()),
            (&b"b"[..], 2, false)
        );
    }

    #[test]
    fn the_line_after_one_that_is_too_long_can_be_read() {
        for length in [LONGEST_ROW, 3 * LONGEST_ROW] {
            let text = format!("a\n{}\nb\n", "x".repeat(length));
            let mut lines = lines(std::io::Cursor::new(text.into_bytes()));
            assert!(lines.advance().unwrap());
            assert!(lines.advance().is_err());
            let long = lines.take();
            assert!(lines.advance().unwrap());
            assert_eq!((lines.text(), lines.number()), (&b"b\n"[..], 3));
            lines.hold(vec![long]);
            assert!(lines.advance().is_err(), "as long as before");
            assert!(!lines.advance().unwrap());
        }
    }

    #[test]
    fn an_endless_line_is_an_error_and_not_a_full_memory() {
        let mut lines = lines(std::io::repeat(b'x'));
        assert!(
            matches!(lines.advance(), Err(FileError::TooLong { place, .. }) if place.line == 1)
        );
    }
}
