//! Which format a file has: from its name, else from its first bytes. Not how it is read.

use std::path::Path;

use crate::typed::kind_by_name;

/// A format of recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// A line of column names, then rows of cells; separated by `,`, `;`, tab or `|`.
    Csv,
    /// One JSON object per line.
    JsonLines,
    /// A kind that is no text, which another crate brings.
    Typed,
}

impl Format {
    /// The format that a file's name promises: `.csv`, `.tsv`, `.txt`, or `.jsonl`, `.ndjson`, `.json`, or what crates bring; `None`
    /// for others.
    pub fn from_path(path: &Path) -> Option<Self> {
        Self::of_text(path).or_else(|| kind_by_name(path).map(|_| Self::Typed))
    }

    /// The same of texts alone.
    pub(crate) fn of_text(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "csv" | "tsv" | "txt" => Some(Self::Csv),
            "jsonl" | "ndjson" | "json" => Some(Self::JsonLines),
            _ => None,
        }
    }

    /// The same of a file that is read, which may be packed: `.csv.gz`.
    pub(crate) fn of_file(path: &Path) -> Option<Self> {
        let is_packed = path.extension().is_some_and(|ending| ending == "gz");
        let inner = path.file_stem().filter(|_| is_packed).map(Path::new);
        Self::from_path(inner.unwrap_or(path))
    }

    /// The format of a text that starts with this line.
    pub(crate) fn from_first_line(line: &[u8]) -> Self {
        match line.trim_ascii_start().first() {
            Some(b'{') => Self::JsonLines,
            _ if begins_json_array(line) => Self::JsonLines,
            _ => Self::Csv,
        }
    }
}

/// Whether a first line is that of a JSON array of objects, over as many lines as it may be; `[s],room` is a header of CSV.
pub(crate) fn begins_json_array(line: &[u8]) -> bool {
    let rest = line.trim_ascii_start().strip_prefix(b"[");
    rest.is_some_and(|rest| matches!(rest.trim_ascii_start().first(), None | Some(b'{' | b'[')))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_file_tells_its_format() {
        for name in ["a.csv", "b/a.TSV", "a.b.txt"] {
            assert_eq!(
                Format::from_path(Path::new(name)),
                Some(Format::Csv),
                "{name}"
            );
        }
        for name in ["a.jsonl", "a.ndjson", "a.JSON"] {
            assert_eq!(
                Format::from_path(Path::new(name)),
                Some(Format::JsonLines),
                "{name}"
            );
        }
        assert_eq!(Format::from_path(Path::new("recording")), None);
        assert_eq!(Format::from_path(Path::new("a.csv.gz")), None);
        assert_eq!(Format::of_file(Path::new("a.csv.gz")), Some(Format::Csv));
    }
}
