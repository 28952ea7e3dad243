//! Where something stands in which file; it reads no files.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The number of a file among the [`Sources`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SourceId(pub u32);

/// A range of bytes in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Place {
    /// The file.
    pub source: SourceId,
    /// The first byte.
    pub start: u32,
    /// The byte after the last.
    pub end: u32,
}

impl Place {
    /// The bytes `start..end` of `source`.
    pub const fn new(source: SourceId, start: u32, end: u32) -> Self {
        Place { source, start, end }
    }
}

/// The files that were read: their paths as the user knows them, and their texts.
#[derive(Debug, Clone, Default)]
pub struct Sources {
    files: Vec<Source>,
}

#[derive(Debug, Clone)]
struct Source {
    path: String,
    text: Arc<str>,
    /// Byte at which each line starts.
    lines: Vec<u32>,
}

impl Sources {
    /// No files.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a file. Texts beyond 4 GiB cannot be addressed; readers refuse files long before that.
    pub fn add(&mut self, path: impl Into<String>, text: impl Into<Arc<str>>) -> SourceId {
        let text = text.into();
        let starts = text
            .bytes()
            .zip(1u32..)
            .filter(|(byte, _)| *byte == b'\n')
            .map(|(_, next)| next);
        let lines = std::iter::once(0).chain(starts).collect();
        let id = SourceId(self.count());
        self.files.push(Source {
            path: path.into(),
            text,
            lines,
        });
        id
    }

    /// Number of files.
    pub fn count(&self) -> u32 {
        u32::try_from(self.files.len()).unwrap_or(u32::MAX)
    }

    /// The path as it is shown; empty for a number that was not given out.
    pub fn path(&self, source: SourceId) -> &str {
        self.get(source).map_or("", |file| &file.path)
    }

    /// The whole text; empty for a number that was not given out.
    pub fn text(&self, source: SourceId) -> &str {
        self.get(source).map_or("", |file| &file.text)
    }

    /// The bytes at `place` as text, cut to what the file has.
    pub fn slice(&self, place: Place) -> &str {
        let text = self.text(place.source);
        let (start, end) = self.range(place);
        &text[start..end]
    }

    /// Line and column of the start of `place`, both from 1, the column in characters.
    pub fn line_column(&self, place: Place) -> (usize, usize) {
        let Some(file) = self.get(place.source) else {
            return (1, 1);
        };
        let (start, _) = self.range(place);
        let line = file
            .lines
            .partition_point(|&first| first as usize <= start)
            .max(1);
        let first = file.lines.get(line - 1).map_or(0, |&first| first as usize);
        (line, file.text[first.min(start)..start].chars().count() + 1)
    }

    /// The text of a line, the first of which is 1, without its end.
    pub fn line(&self, source: SourceId, line: usize) -> Place {
        let Some(file) = self.get(source) else {
            return Place::new(source, 0, 0);
        };
        let start = line.checked_sub(1).and_then(|nth| file.lines.get(nth));
        let start = start.copied().unwrap_or(0);
        let rest = &file.text[start as usize..];
        let length = rest.lines().next().map_or(0, str::len);
        let end = start.saturating_add(u32::try_from(length).unwrap_or(u32::MAX));
        Place::new(source, start, end)
    }

    /// A relative path as written at `place`: it starts at the folder of the file in which it stands.
    pub fn resolve(&self, place: Place, path: &str) -> PathBuf {
        match Path::new(self.path(place.source)).parent() {
            Some(folder) => folder.join(path),
            None => PathBuf::from(path),
        }
    }

    /// The range of bytes of `place`, within its text and on the borders of characters.
    pub(super) fn range(&self, place: Place) -> (usize, usize) {
        let text = self.text(place.source);
        let border = |at: u32| {
            (0..=(at as usize).min(text.len()))
                .rev()
                .find(|&at| text.is_char_boundary(at))
                .unwrap_or(0)
        };
        let start = border(place.start);
        (start, border(place.end).max(start))
    }

    /// The number of the first line of the bytes `start..end`, and the bytes of all lines that they touch.
    pub(super) fn lines(
        &self,
        source: SourceId,
        start: usize,
        end: usize,
    ) -> (usize, Range<usize>) {
        let Some(file) = self.get(source) else {
            return (1, 0..0);
        };
        let line_at = |at: usize| {
            file.lines
                .partition_point(|&first| first as usize <= at)
                .max(1)
        };
        let (first, last) = (line_at(start), line_at(end));
        let from = file.lines.get(first - 1).map_or(0, |&at| at as usize);
        let to = file
            .lines
            .get(last)
            .map_or(file.text.len(), |&at| at as usize);
        (first, from..to)
    }

    fn get(&self, source: SourceId) -> Option<&Source> {
        self.files.get(source.0 as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_columns_count_characters_from_one() {
        let mut sources = Sources::new();
        let id = sources.add("a/b.toml", "x = 1\n\u{b5}m = 2\r\nend");
        let at = |start| sources.line_column(Place::new(id, start, start + 1));
        assert_eq!(at(0), (1, 1));
        assert_eq!(at(5), (1, 6));
        assert_eq!(at(6), (2, 1));
        // The mu takes two bytes and one column.
        assert_eq!(at(8), (2, 2));
        assert_eq!(at(16), (3, 2));
        assert_eq!(at(1000), (3, 4));
    }

    #[test]
    fn a_line_is_found_by_its_number_and_ends_before_its_end() {
        let mut sources = Sources::new();
        let id = sources.add("a.csv", "one\r\ntwo\n\nend");
        let line = |number| sources.slice(sources.line(id, number));
        assert_eq!([1, 2, 3, 4].map(line), ["one", "two", "", "end"]);
        assert_eq!(sources.line(id, 99), sources.line(id, 1));
    }

    #[test]
    fn a_place_inside_a_character_is_moved_to_its_start() {
        let mut sources = Sources::new();
        let id = sources.add("x", "\u{b5}m");
        assert_eq!(sources.slice(Place::new(id, 1, 3)), "\u{b5}m");
        assert_eq!(sources.slice(Place::new(id, 9, 3)), "");
    }

    #[test]
    fn a_relative_path_starts_at_its_file() {
        let mut sources = Sources::new();
        let id = sources.add("machines/a.toml", "");
        assert_eq!(
            sources.resolve(Place::new(id, 0, 0), "data.csv"),
            PathBuf::from("machines/data.csv")
        );
        assert_eq!(
            sources.resolve(Place::new(id, 0, 0), "/data.csv"),
            PathBuf::from("/data.csv")
        );
    }
}
