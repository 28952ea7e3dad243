//! Rows of several machines that stand side by side in one table: whose are taken, one machine after the other. Not how a row is read.

use std::collections::VecDeque;
use std::fmt;

use crate::cell::{self, text};
use crate::ledger::Ledger;
use crate::{FileError, Place};

/// A table is read once for each of its machines; a column with more values is none of machines.
const MOST: usize = 100;

/// Why a row is of none of the machines that are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MachineFault {
    /// Its cell is empty.
    Unnamed,
    /// It is of another one than the first row, and what is read once has one.
    Another {
        /// The machine of the first row.
        first: String,
        /// That of this row.
        found: String,
    },
    /// There are more than so many.
    Many(usize),
}

impl fmt::Display for MachineFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unnamed => {
                f.write_str("is empty, so it is not known which machine the row is of")
            }
            Self::Another { first, found } => write!(
                f,
                "is `{found}` here and `{first}` in the first row, and of what is read once, such as a pipe or a file that grows, the rows of one \
                 machine are taken: say of which in `[table]`, `only = \"{first}\"`"
            ),
            Self::Many(most) => write!(
                f,
                "has more than {most} values, and the table is read once for each: `machine` in `[table]` is the column that says which machine \
                 a row is of"
            ),
        }
    }
}

/// Takes the rows of one machine after the other.
pub(crate) struct Machines {
    column: String,
    /// Which cell of a row says its machine.
    pub cell: usize,
    /// The one whose rows are taken: the first that a row is of, unless one is asked for.
    current: Option<Vec<u8>>,
    is_asked_for: bool,
    /// All others, in the order of their first rows; as far as they are still to be read.
    others: VecDeque<Vec<u8>>,
    /// Whether what is read can be read again.
    pub is_file: bool,
    /// What is met among rows that were read before is not counted again.
    again: Option<Ledger>,
    /// Whether the next row is the first of another machine.
    begins: bool,
}

impl Machines {
    pub fn new(column: &str, cell: usize, only: Option<&str>) -> Self {
        Self {
            column: column.to_owned(),
            cell,
            current: only.map(|of| of.as_bytes().to_vec()),
            is_asked_for: only.is_some(),
            others: VecDeque::new(),
            is_file: false,
            again: None,
            begins: false,
        }
    }

    /// Whether the rows of several are read.
    pub fn are_several(&self) -> bool {
        !self.is_asked_for
    }

    /// Counts what is met among rows.
    pub fn ledger<'a>(&'a mut self, first: &'a mut Ledger) -> &'a mut Ledger {
        self.again.as_mut().unwrap_or(first)
    }

    /// Whether a row with this cell is of the machine that is read.
    pub fn takes(
        &mut self,
        cell: &[u8],
        ledger: &mut Ledger,
        place: impl FnOnce() -> Place,
    ) -> Result<bool, FileError> {
        let cell = cell::trim(cell);
        let fault = match &self.current {
            Some(current) if current == cell => return Ok(true),
            Some(_) if self.is_asked_for || self.again.is_some() => return Ok(false),
            _ if cell.is_empty() => MachineFault::Unnamed,
            None => {
                self.current = Some(cell.to_vec());
                return Ok(true);
            }
            Some(_) if self.is_file => {
                if self.others.iter().any(|of| of == cell) {
                    return Ok(false);
                }
                self.others.push_back(cell.to_vec());
                if self.others.len() < MOST {
                    return Ok(false);
                }
                return Err(self.error(place(), MachineFault::Many(MOST)));
            }
            Some(first) => MachineFault::Another {
                first: text(first).into_owned(),
                found: text(cell).into_owned(),
            },
        };
        ledger.refuse_row(|| self.error(place(), fault))?;
        Ok(false)
    }

    fn error(&self, place: Place, fault: MachineFault) -> FileError {
        FileError::Machine {
            place,
            column: self.column.clone(),
            fault,
        }
    }

    /// Goes to the next machine, whose rows are read from the beginning of the file on; false where there is none.
    pub fn next(&mut self, ledger: &Ledger) -> bool {
        let Some(next) = self.others.pop_front() else {
            return false;
        };
        self.current = Some(next);
        self.begins = ledger.report.rows > 0;
        self.again.get_or_insert_with(|| Ledger::new(true, None));
        true
    }

    /// Whether the row that is taken is the first of another machine than before.
    pub fn begins(&mut self) -> bool {
        std::mem::take(&mut self.begins)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;
    use std::path::PathBuf;

    use athermal_core::document::{Pattern, TableFormat};

    use crate::merge::Joint;
    use crate::{Event, FileError, Layout, Options, Reader, Row, TimeForm};

    fn table(machine: Option<&str>, only: Option<&str>, rename: &[(&str, &str)]) -> TableFormat {
        let renamed = rename.iter();
        TableFormat {
            machine: machine.map(str::to_owned),
            only: only.map(str::to_owned),
            rename: renamed
                .map(|(from, to)| ((*from).to_owned(), (*to).to_owned()))
                .collect(),
            ..TableFormat::default()
        }
    }

    /// The rows of files of these names and texts, breaks as `|`, by the layouts of some; the last is that of all others.
    fn read(
        test: &str,
        files: &[(&str, &str)],
        tables: &[(&str, TableFormat)],
        of: &[&str],
    ) -> Result<String, String> {
        let folder =
            std::env::temp_dir().join(format!("athermal-machines-{}-{test}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let paths = files.iter().map(|(name, text)| {
            let path = folder.join(name);
            std::fs::write(&path, text).unwrap();
            path
        });
        let paths: Vec<PathBuf> = paths.collect();
        let mut layout = Layout::new("t", TimeForm::SECONDS, of.iter().copied());
        for (pattern, table) in tables {
            layout
                .table
                .files
                .push((Pattern::new(pattern), table.clone()));
        }
        let options = Options {
            merge: tables.len() > 1,
            ..Options::default()
        };
        let all = || -> Result<String, FileError> {
            let mut joint = Joint::open(&paths, layout, options)?;
            let (mut row, mut lines) = (Row::default(), String::new());
            loop {
                match joint.next_into(&mut row)? {
                    Event::Row => {
                        let values: Vec<String> = row.values.iter().map(f64::to_string).collect();
                        lines += &format!("{}:{} ", row.time_text, values.join(","));
                    }
                    Event::Segment => lines += "| ",
                    Event::End => return Ok(lines.trim_end().to_owned()),
                }
            }
        };
        let read =
            all().map_err(|error| error.to_string().replace(&folder.display().to_string(), ""));
        std::fs::remove_dir_all(&folder).unwrap();
        read
    }

    #[test]
    fn rows_of_each_machine_are_read_by_themselves_whatever_the_format() {
        let csv = "t,m,a\n0,B,1\n0,A,2\n10,B,3\n5,A,4\n10,A,5\n20,C,6\n30,B,7\n";
        let json: String = csv
            .lines()
            .skip(1)
            .map(|line| {
                let cells: Vec<&str> = line.split(',').collect();
                format!(
                    "{{\"t\": {}, \"m\": \"{}\", \"a\": {}}}\n",
                    cells[0], cells[1], cells[2]
                )
            })
            .collect();
        let long = "t,m,n,v\n0,B,a,1\n0,A,a,2\n10,B,a,3\n10,A,a,5\n";
        let of = |machine: Option<&str>, only: Option<&str>| table(machine, only, &[]);
        let all = "0:1 10:3 30:7 | 0:2 5:4 10:5 | 20:6";
        for (name, text) in [("m.csv", csv), ("m.jsonl", &json)] {
            let read = |table| read(name, &[(name, text)], &[("*", table)], &["a"]);
            assert_eq!(read(of(Some("m"), None)).as_deref(), Ok(all), "{name}");
            assert_eq!(
                read(of(Some("m"), Some("A"))).as_deref(),
                Ok("0:2 5:4 10:5"),
                "{name}"
            );
        }
        let long_table = TableFormat {
            layout: athermal_core::document::Arrangement::Long,
            name: Some("n".to_owned()),
            value: Some("v".to_owned()),
            ..of(Some("m"), None)
        };
        let found = read("long", &[("l.csv", long)], &[("*", long_table)], &["a"]);
        assert_eq!(found.as_deref(), Ok("0:1 10:3 | 0:2 10:5"));
        // Of two files each machine is a segment of each, also where times go on.
        let next = "t,m,a\n40,A,8\n40,B,9\n";
        let found = read(
            "two",
            &[("a.csv", csv), ("b.csv", next)],
            &[("*", of(Some("m"), None))],
            &["a"],
        );
        assert_eq!(found, Ok(format!("{all} | 40:8 | 40:9")));
        // Two logs of the same machines, and one that has none.
        let (heat, place) = (
            "t,m,a\n0,A,1\n0,B,2\n10,A,3\n10,B,4\n",
            "t,m,z\n5,A,5\n5,B,6\n",
        );
        let tables = [
            ("h.csv", of(Some("m"), None)),
            ("z.csv", of(Some("m"), None)),
        ];
        let found = read(
            "logs",
            &[("h.csv", heat), ("z.csv", place)],
            &tables,
            &["a", "z"],
        );
        assert_eq!(
            found.as_deref(),
            Ok("0:1,NaN 5:NaN,5 10:3,NaN | 0:2,NaN 5:NaN,6 10:4,NaN")
        );
        let found = read(
            "apart",
            &[("h.csv", heat), ("z.csv", "t,z\n5,1\n")],
            &tables,
            &["a", "z"],
        );
        assert!(
            found.as_ref().is_err_and(|why| why.contains("2 segments")),
            "{found:?}"
        );
    }

    #[test]
    fn a_row_of_no_machine_or_of_another_in_what_is_read_once_is_an_error_or_counted() {
        let of_file = |text| {
            read(
                "fault",
                &[("f.csv", text)],
                &[("*", table(Some("m"), None, &[]))],
                &["a"],
            )
        };
        let empty = of_file("t,m,a\n0,A,1\n0,,2\n").unwrap_err();
        assert_eq!(
            empty,
            "/f.csv:3: `m` is empty, so it is not known which machine the row is of"
        );
        let many: String = (0..200).map(|n| format!("{n},{n},1\n")).collect();
        let many = of_file(&format!("t,m,a\n{many}")).unwrap_err();
        assert!(many.contains("`m` has more than 100 values"), "{many}");
        for is_lenient in [false, true] {
            let mut layout = Layout::new("t", TimeForm::SECONDS, ["a"]);
            layout.table.base = table(Some("m"), None, &[]);
            let options = Options {
                lenient: is_lenient,
                ..Options::default()
            };
            let text = Cursor::new("t,m,a\n0,A,1\n0,B,2\n10,A,3\n");
            let mut reader = Reader::from_read("pipe", text, layout, options).unwrap();
            let (mut row, mut rows) = (Row::default(), 0);
            let end = loop {
                match reader.next_into(&mut row) {
                    Ok(true) => rows += 1,
                    end => break end,
                }
            };
            match end {
                Ok(_) => {
                    assert!(is_lenient && rows == 2 && reader.report().refused_rows.count == 1)
                }
                Err(why) => assert!(
                    !is_lenient && why.to_string().contains("`only = \"A\"`"),
                    "{why}"
                ),
            }
        }
    }

    #[test]
    fn columns_are_called_as_each_file_says_and_a_name_that_was_taken_away_is_missing() {
        let (one, other) = ("time,Value\n0,1\n10,2\n", "Value,t\n3,0\n4,10\n");
        let tables = [
            (
                "a*.csv",
                table(None, None, &[("Value", "a"), ("time", "t")]),
            ),
            ("b*.csv", table(None, None, &[("Value", "b")])),
        ];
        let files = [("a-1.csv", one), ("b-1.csv", other)];
        let read = |of: &[&str]| read("renamed", &files, &tables, of);
        assert_eq!(read(&["a", "b"]).as_deref(), Ok("0:1,3 10:2,4"));
        let gone = read(&["a", "b", "Value"]).unwrap_err();
        assert!(gone.contains("no file has a column `Value`"), "{gone}");
        // Two columns may change their names with each other.
        let swapped = [("*", table(None, None, &[("a", "b"), ("b", "a")]))];
        let found = super::tests::read(
            "swapped",
            &[("s.csv", "t,a,b\n0,1,2\n")],
            &swapped,
            &["a", "b"],
        );
        assert_eq!(found.as_deref(), Ok("0:2,1"));
    }
}
