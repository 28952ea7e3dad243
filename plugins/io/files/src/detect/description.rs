//! What a file looks like before anyone has said what is wanted from it: its layout, columns and first rows. Not what they mean.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use athermal_core::document::{Arrangement, DecimalMark, Encoding, Separator, TableFormat};
use indexmap::IndexMap;
use serde_json::{Map, Value};

use crate::cell::{decimal_mark, is_number};
use crate::cells::Cells;
use crate::columns::numbered;
use crate::csv_rows::CsvRows;
use crate::ledger::Ledger;
use crate::lines::Lines;
use crate::typed::{self, TypedCells};

use super::header::is_value;
use super::{Format, LongFormat, begins_json_array, units};
use crate::{FileError, Tables, TypedFile};

/// The columns of a file and the texts of its first rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Description {
    /// The format that the file was taken for.
    pub format: Format,
    /// The layout of CSV, as far as it is not the usual one; its decimal mark is found with [`Description::decimal`].
    pub table: TableFormat,
    /// The names of the columns in their order; of JSON lines, the keys of the rows looked at.
    pub columns: Vec<String>,
    /// The units in a row below the names, a text per column, empty where it says none; nothing at all where there is no such row.
    pub units: Vec<String>,
    /// The first rows: one text per column, empty where there is no value.
    pub rows: Vec<Vec<String>>,
}

impl Description {
    /// Looks at the first `rows` rows of a file, or of standard input for `-`. Broken rows are passed over.
    ///
    /// # Errors
    /// The file cannot be opened or read, is empty or not text, or has a column twice.
    pub fn of(path: impl AsRef<Path>, rows: usize) -> Result<Self, FileError> {
        Self::laid_out(path, rows, &TableFormat::default(), &Tables::default())
    }

    /// The same of a table whose layout is declared in part, or that is in memory.
    ///
    /// # Errors
    /// As for [`Description::of`], and where the file is not as declared.
    pub fn laid_out(
        path: impl AsRef<Path>,
        rows: usize,
        table: &TableFormat,
        tables: &Tables,
    ) -> Result<Self, FileError> {
        let path = path.as_ref();
        if let Some(file) = typed::opened(path, tables) {
            return of_typed(path, file?, rows);
        }
        let lines = Lines::open(path, table.encoding)?;
        let mut described = of_lines(lines, Format::of_file(path), rows, table)?;
        if let Some(encoding) = marked(path) {
            described.table.encoding = Some(encoding);
        }
        Ok(described)
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
        let lines = Lines::new(name.into(), None, input);
        of_lines(lines, format, rows, &TableFormat::default())
    }

    /// Whether numbers stand where the names of the columns should.
    #[must_use]
    pub fn lacks_names(&self) -> bool {
        let named = self.columns.iter().filter(|name| !name.is_empty());
        named.clone().count() > 1 && named.clone().all(|name| is_value(name))
    }

    /// The decimal mark of all columns but those of the time, where it is a comma. Where a comma separates cells too, others stand in
    /// quotes, and may stand between thousands: only such as cannot are decimal marks.
    #[must_use]
    pub fn decimal(&self, time: &[String]) -> Option<DecimalMark> {
        let is_value = |at: usize| self.columns.get(at).is_some_and(|of| !time.contains(of));
        let cells = self.rows.iter().flat_map(|row| row.iter().enumerate());
        let numbers = cells.filter(|(at, cell)| is_value(*at) && is_number(cell));
        let mut marks = numbers
            .clone()
            .filter_map(|(_, cell)| decimal_mark(cell.as_bytes()));
        let first = marks.next()?;
        let all = first == b',' && marks.all(|mark| mark == first);
        let is_decimal = || {
            numbers
                .map(|(_, cell)| cell)
                .any(|cell| is_no_thousand(cell))
        };
        (all && (self.table.separator.is_some() || is_decimal())).then_some(DecimalMark::Comma)
    }

    /// What the columns are where the file is in long format.
    #[must_use]
    pub fn long_format(&self) -> Option<LongFormat> {
        LongFormat::of(&self.columns, &self.rows, &|_| false)
    }

    /// Where the file names other columns than at its beginning, and which: it has several tables.
    ///
    /// # Errors
    /// As for [`Description::of`].
    pub fn next_names(
        &self,
        path: &Path,
        time: &[String],
    ) -> Result<Option<(u64, Vec<String>)>, FileError> {
        let mut csv = CsvRows::headed(Lines::open(path, None)?, &self.table, None)?;
        let mut ledger = Ledger::new(true, None);
        while csv.advance(&mut ledger)? {
            if time.iter().all(|name| csv.texts().contains(name)) {
                let names: Vec<String> = csv
                    .texts()
                    .into_iter()
                    .filter(|of| !of.is_empty())
                    .collect();
                let others = names.iter().any(|name| !self.columns.contains(name));
                if others {
                    return Ok(Some((csv.place().line, names)));
                }
            }
        }
        Ok(None)
    }

    /// The same file with a column for each name of its long layout, and its times alone in the rows.
    ///
    /// # Errors
    /// As for [`Description::of`].
    pub fn of_long(
        &self,
        path: &Path,
        long: &LongFormat,
        time: &[String],
    ) -> Result<Self, FileError> {
        let mut csv = CsvRows::headed(Lines::open(path, None)?, &self.table, None)?;
        let place = |name: &str| csv.names().iter().position(|of| of == name);
        let names = place(&long.names).unwrap_or_default();
        let unit = ["unit_of_measurement", "unit", "units", "einheit"]
            .into_iter()
            .find_map(place);
        let mut ledger = Ledger::new(true, None);
        let mut entities: IndexMap<String, String> = IndexMap::new();
        while csv.advance(&mut ledger)? && entities.len() <= MOST_NAMES {
            let name = csv.text(names);
            if !name.is_empty() && !entities.contains_key(&name) && name != long.names {
                let unit = unit.map_or_else(String::new, |at| csv.text(at));
                entities.insert(name, unit);
            }
        }
        let places = time
            .iter()
            .map(|name| self.columns.iter().position(|of| of == name));
        let places: Vec<usize> = places.flatten().collect();
        let rows = self.rows.iter().map(|row| {
            let times = places
                .iter()
                .map(|at| row.get(*at).cloned().unwrap_or_default());
            times
                .chain(entities.keys().map(|_| String::new()))
                .collect()
        });
        Ok(Self {
            format: self.format,
            table: TableFormat {
                layout: Arrangement::Long,
                name: Some(long.names.clone()),
                value: Some(long.values.clone()),
                ..self.table.clone()
            },
            columns: time.iter().chain(entities.keys()).cloned().collect(),
            units: time
                .iter()
                .map(|_| String::new())
                .chain(entities.values().cloned())
                .collect(),
            rows: rows.collect(),
        })
    }

    /// The unit in the row below the names, without brackets; empty where there is none.
    #[must_use]
    pub fn unit(&self, column: &str) -> &str {
        let at = self.columns.iter().position(|name| name == column);
        let text = at.and_then(|at| self.units.get(at));
        text.map_or("", |text| units::bare(text))
    }
}

/// So many names of a long layout are looked for.
const MOST_NAMES: usize = 1000;

/// Whether the comma of a number cannot stand between thousands.
fn is_no_thousand(number: &str) -> bool {
    number.split_once(',').is_some_and(|(whole, rest)| {
        let whole = whole.trim_start_matches(['+', '-', ' ']);
        let digits = rest.len() == 3 && rest.bytes().all(|byte| byte.is_ascii_digit());
        !digits || whole.starts_with('0') || whole.len() > 3 || whole.is_empty()
    })
}

/// The encoding that the first bytes of a file say, other than UTF-8.
fn marked(path: &Path) -> Option<Encoding> {
    let mut mark = [0; 2];
    File::open(path).ok()?.read_exact(&mut mark).ok()?;
    match mark {
        [0xff, 0xfe] => Some(Encoding::Utf16Le),
        [0xfe, 0xff] => Some(Encoding::Utf16Be),
        _ => None,
    }
}

fn of_lines(
    mut lines: Lines,
    format: Option<Format>,
    rows: usize,
    table: &TableFormat,
) -> Result<Description, FileError> {
    match lines.format_or(format)? {
        Format::JsonLines => of_json(lines, rows),
        _ => of_csv(lines, rows, table),
    }
}

fn of_typed(path: &Path, file: Box<dyn TypedFile>, rows: usize) -> Result<Description, FileError> {
    let mut cells = TypedCells::of_texts(path, file)?;
    let columns = cells.names().to_vec();
    let mut ledger = Ledger::new(true, None);
    let mut texts = Vec::new();
    while texts.len() < rows && cells.advance(&mut ledger)? {
        let row = (0..columns.len()).map(|at| cells.channel(at));
        let row = row.map(|cell| String::from_utf8_lossy(cell).into_owned());
        texts.push(row.collect());
    }
    Ok(Description {
        format: Format::Typed,
        table: TableFormat::default(),
        columns,
        units: Vec::new(),
        rows: texts,
    })
}

fn of_csv(lines: Lines, rows: usize, table: &TableFormat) -> Result<Description, FileError> {
    let mut csv = CsvRows::headed(lines, table, None)?;
    let mut ledger = Ledger::new(true, None);
    let mut texts = Vec::new();
    while texts.len() < rows && csv.advance(&mut ledger)? {
        let row = csv.texts();
        let named = numbered(row.clone());
        if named == csv.names() || is_rule(&row) {
            continue;
        }
        // From there on columns may stand elsewhere.
        if named.iter().all(|cell| csv.names().contains(cell)) {
            break;
        }
        texts.push(row);
    }
    Ok(Description {
        format: Format::Csv,
        table: TableFormat {
            separator: Some(csv.separator())
                .filter(|of| *of != b',')
                .map(Separator),
            encoding: table
                .encoding
                .or(csv.is_windows_1252().then_some(Encoding::Windows1252)),
            skip: match table.names {
                Some(_) => table.skip,
                None => Some(csv.skip()).filter(|skip| *skip > 0),
            },
            units: table.units.or_else(|| {
                let row = csv.units_row() + table.names.unwrap_or(1) - 1;
                (!csv.units().is_empty()).then_some(row)
            }),
            ..table.clone()
        },
        columns: csv.names().to_vec(),
        units: csv.units().to_vec(),
        rows: texts,
    })
}

/// Whether a row is the line below the names of a table in Markdown.
fn is_rule(row: &[String]) -> bool {
    let is_of_rule = |cell: &String| cell.bytes().all(|byte| b"-:".contains(&byte));
    row.iter().any(|cell| cell.contains("--")) && row.iter().all(is_of_rule)
}

fn of_json(mut lines: Lines, rows: usize) -> Result<Description, FileError> {
    let mut columns: Vec<String> = Vec::new();
    let mut texts: Vec<Vec<String>> = Vec::new();
    while texts.len() < rows.max(1) && lines.advance_to_content()? {
        if texts.is_empty() && begins_json_array(lines.text()) {
            let place = lines.place();
            return Err(FileError::JsonArray { place });
        }
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
        table: TableFormat::default(),
        columns,
        units: Vec::new(),
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
        assert_eq!(described.table.separator, Some(Separator(b';')));
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

    fn described(text: &str) -> Description {
        Description::of_read("f", std::io::Cursor::new(text.to_owned()), None, 5).unwrap()
    }

    #[test]
    fn the_table_is_found_below_what_a_logger_writes_above_it() {
        for (above, below) in [
            ("sep=;\n", ""),
            ("Export of 01.03.2026\nDevice;Logger, model 3000\n\n", ""),
            ("Device;Logger;;\nSerial;12345;;\n;;;\n", ""),
            ("# made by hand\n", ""),
            ("Device;Logger\n# ", ""),
            ("Device;Logger\n# ", ";°C;°C;nm\n"),
            ("", ";°C;°C;nm\n"),
            ("sep=;\n\n", "[s];[°C];[°C];[nm]\n"),
        ] {
            for end in ["", ";"] {
                let rows = [0, 10, 20]
                    .map(|t| format!("{t};21,5;20,25;-{t},5{end}\n"))
                    .concat();
                let text = format!("{above}Time;Plate;Room;Z\n{below}{rows}");
                let found = described(&text);
                assert_eq!(found.columns, ["Time", "Plate", "Room", "Z"], "{text}");
                assert_eq!(found.table.separator, Some(Separator(b';')));
                assert_eq!(found.rows[0], ["0", "21,5", "20,25", "-0,5"]);
                assert_eq!(found.rows.len(), 3);
                let unit = if below.is_empty() { "" } else { "nm" };
                assert_eq!(found.unit("Z"), unit);
            }
        }
    }

    #[test]
    fn a_table_without_names_begins_at_its_first_line() {
        assert_eq!(described("0,1\n1,2\n").columns, ["0", "1"]);
        assert_eq!(described("t,1,2\n0,1,2\n").columns, ["t", "1", "2"]);
        assert_eq!(described("t\n0\n").columns, ["t"]);
        // Rows that do not fit their names are for whoever wrote them to mend.
        assert_eq!(described("t,a\n0,1,2\n1,2,3\n").columns, ["t", "a"]);
    }

    #[test]
    fn names_that_stand_within_the_rows_are_no_row() {
        assert_eq!(described("t,a\n0,1\nt,a\n1,2\n").rows.len(), 2);
        assert_eq!(described("t,a\n0,1\na,t\n1,2\n").rows.len(), 1);
    }
}
