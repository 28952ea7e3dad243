//! What a file looks like before anyone has said what is wanted from it: columns and first rows. Not what they mean.

use std::io::Read;
use std::path::Path;

use serde_json::{Map, Value};

use crate::cell::Cells;
use crate::csv_rows::CsvRows;
use crate::ledger::Ledger;
use crate::lines::Lines;
use crate::{FileError, Format};

/// The columns of a file and the texts of its first rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Description {
    /// The format that the file was taken for.
    pub format: Format,
    /// What stands between the cells of CSV.
    pub delimiter: Option<u8>,
    /// The names of the columns in their order; of JSON lines, the keys of the rows looked at.
    pub columns: Vec<String>,
    /// The first rows: one text per column, empty where there is no value.
    pub rows: Vec<Vec<String>>,
}

impl Description {
    /// Looks at the first `rows` rows of a file, or of standard input for `-`. Broken rows are passed over.
    ///
    /// # Errors
    /// The file cannot be opened or read, is empty or not text, or has a column twice.
    pub fn of(path: impl AsRef<Path>, rows: usize) -> Result<Self, FileError> {
        let path = path.as_ref();
        of_lines(Lines::open(path)?, Format::from_path(path), rows)
    }

    /// Looks at the first `rows` rows of any stream of bytes; `name` stands for it in messages.
    ///
    /// # Errors
    /// As for [`Description::of`].
    pub fn of_read(
        name: &str,
        input: impl Read + Send + 'static,
        format: Option<Format>,
        rows: usize,
    ) -> Result<Self, FileError> {
        of_lines(Lines::new(name.into(), input), format, rows)
    }
}

fn of_lines(
    mut lines: Lines,
    format: Option<Format>,
    rows: usize,
) -> Result<Description, FileError> {
    match lines.format_or(format)? {
        Format::Csv => of_csv(lines, rows),
        Format::JsonLines => of_json(lines, rows),
    }
}

fn of_csv(lines: Lines, rows: usize) -> Result<Description, FileError> {
    let mut csv = CsvRows::headed(lines, None, std::iter::empty())?;
    let mut ledger = Ledger::new(true);
    let mut texts = Vec::new();
    while texts.len() < rows && csv.advance(&mut ledger)? {
        texts.push(csv.texts());
    }
    Ok(Description {
        format: Format::Csv,
        delimiter: Some(csv.delimiter()),
        columns: csv.names().to_vec(),
        rows: texts,
    })
}

fn of_json(mut lines: Lines, rows: usize) -> Result<Description, FileError> {
    let mut columns: Vec<String> = Vec::new();
    let mut texts: Vec<Vec<String>> = Vec::new();
    while texts.len() < rows.max(1) && lines.advance_to_content()? {
        let Ok(object) = serde_json::from_slice::<Map<String, Value>>(lines.text()) else {
            continue;
        };
        let new = object.keys().filter(|key| !columns.contains(key));
        let new: Vec<String> = new.cloned().collect();
        columns.extend(new);
        let text = |name: &String| match object.get(name) {
            None | Some(Value::Null) => String::new(),
            Some(Value::String(text)) => text.clone(),
            Some(other) => other.to_string(),
        };
        texts.push(columns.iter().map(text).collect());
    }
    if texts.is_empty() {
        return Err(FileError::Empty { file: lines.file });
    }
    texts.truncate(rows);
    for row in &mut texts {
        row.resize(columns.len(), String::new());
    }
    Ok(Description {
        format: Format::JsonLines,
        delimiter: None,
        columns,
        rows: texts,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_is_described_by_its_header_and_first_rows() {
        let text = &b"# x\nt;room;note\n0;21,5;\"a; b\"\nbroken\n1;;\n2;1;1\n"[..];
        let described = Description::of_read("f", text, None, 2).unwrap();
        assert_eq!(described.format, Format::Csv);
        assert_eq!(described.delimiter, Some(b';'));
        assert_eq!(described.columns, ["t", "room", "note"]);
        assert_eq!(described.rows, [["0", "21,5", "a; b"], ["1", "", ""]]);
    }

    #[test]
    fn json_lines_are_described_by_the_keys_of_their_first_rows() {
        let text = &b"{\"t\":0,\"a\":null}\n{\"t\":1.5,\"b\":\"x\"}\n{\"c\":1}\n"[..];
        let described = Description::of_read("f", text, None, 2).unwrap();
        assert_eq!(described.format, Format::JsonLines);
        assert_eq!(described.columns, ["t", "a", "b"]);
        assert_eq!(described.rows, [["0", "", ""], ["1.5", "", "x"]]);
    }

    #[test]
    fn a_header_alone_is_described() {
        let described = Description::of_read("f", &b"a,b\n"[..], None, 5).unwrap();
        assert_eq!(described.columns, ["a", "b"]);
        assert!(described.rows.is_empty());
    }
}
