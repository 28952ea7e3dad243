//! The message of each error: what it is, where, and what to do.

use std::fmt::{self, Write};

use super::{Again, CellFault, FileError, MissingColumn, quoted};
use crate::cell;
use crate::instant::{has_clock, is_time_of_day};

/// Whether a text holds a date such as `2013-07-04`, at its beginning or as an example.
fn is_date(text: &str) -> bool {
    let form = |four: &[u8]| four.iter().all(u8::is_ascii_digit);
    let mut dates = text.as_bytes().windows(10);
    dates.any(|of| {
        form(&of[..4]) && of[4] == b'-' && form(&of[5..7]) && of[7] == b'-' && form(&of[8..])
    })
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(&mut OneLine(f), true)
    }
}

/// The message of an error that a lenient reader passes over.
struct Lenient<'a>(&'a FileError);

impl fmt::Display for Lenient<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.write(&mut OneLine(f), false)
    }
}

/// Another way out, unless it has been taken already.
fn or_leniently(f: &mut dyn Write, is_open: bool, then: &str) -> fmt::Result {
    if is_open {
        write!(f, ", or read leniently (`--lenient`) to {then}")
    } else {
        Ok(())
    }
}

/// Writes characters that would break a line or move a terminal's cursor, whatever log they are from, as `\u{1b}`.
struct OneLine<'a, 'f>(&'a mut fmt::Formatter<'f>);

impl Write for OneLine<'_, '_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for piece in text.split_inclusive(moves) {
            match piece.char_indices().next_back() {
                Some((at, last)) if moves(last) => {
                    write!(self.0, "{}{}", &piece[..at], last.escape_default())?;
                }
                _ => self.0.write_str(piece)?,
            }
        }
        Ok(())
    }
}

/// Whether a character moves those after it: one of control, or one that turns the direction of writing.
fn moves(character: char) -> bool {
    character.is_control() || matches!(character, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

impl FileError {
    /// The same message without the advice to read leniently.
    #[must_use]
    pub fn without_advice(&self) -> impl fmt::Display + '_ {
        Lenient(self)
    }

    /// Writes the message; `strict` is whether the file may still be read leniently.
    fn write(&self, f: &mut dyn Write, strict: bool) -> fmt::Result {
        if let Some(place) = self.place()
            && !matches!(self, Self::StillRefused { .. })
        {
            write!(f, "{place}: ")?;
        }
        match self {
            Self::Open { file, source } => write!(
                f,
                "{file}: cannot be opened: {source}; check the path and the rights"
            ),
            Self::Read { source, .. } => write!(f, "cannot be read further: {source}"),
            Self::Write { file, source } => write!(f, "{file}: cannot be written: {source}"),
            Self::StandardInputInList => f.write_str(
                "standard input cannot be joined with other files, whose order is found by opening them twice; save it to a file first"
            ),
            Self::Merge(error) => write!(f, "{error}"),
            Self::Empty { file } => write!(
                f,
                "{file}: is empty; a recording starts with a line of column names (CSV) or an object (JSON lines)"
            ),
            Self::NotText { .. } => f.write_str(
                "is not text; save the recording as CSV or JSON lines in UTF-8: a spreadsheet calls that \"CSV UTF-8\"",
            ),
            Self::TooLong { limit, .. } => {
                write!(
                    f,
                    "a row longer than {limit} bytes starts here; look for missing line ends"
                )?;
                or_leniently(f, strict, "leave it out")
            }
            Self::UnclosedQuote { .. } => {
                f.write_str(
                    "a quoted cell starts here that does not end; close the quote or remove it"
                )?;
                or_leniently(f, strict, "leave the row out")
            }
            Self::DuplicateColumn {
                column,
                positions: [first, second],
                ..
            } => write!(
                f,
                "the name `{column}` stands at columns {first} and {second}; write `{column}[1]` or `{column}[2]` for one of \
                 them, by its place among these"
            ),
            Self::MissingColumns {
                missing,
                found,
                note,
                ..
            } => lacking(f, missing, found, note),
            Self::BadCell {
                column,
                found,
                fault,
                ..
            } => {
                write!(f, "column `{column}`: ")?;
                fault.write(f, found, strict)
            }
            Self::TimeAgain { time, why, .. } => {
                write!(f, "the time `{time}` is that of the row before")?;
                match why {
                    Again::Live => f.write_str(
                        "; the row was left out: where rows are taken as they come, what belongs to one time must stand in one"
                    ),
                    Again::Nothing => {
                        f.write_str(", which has all that it has; the row was left out")
                    }
                    Again::Other(column) => write!(
                        f,
                        ", and the two have different values of `{column}`; the row was left out"
                    ),
                }
            }
            Self::TimeNotAfter { time, previous, .. } => write!(
                f,
                "the time `{time}` is not after `{previous}`; the row was left out"
            ),
            Self::TimeLeaps {
                time,
                previous,
                next,
                ..
            } => {
                write!(f, "the time `{time}` is far after ")?;
                if let Some(previous) = previous {
                    write!(f, "`{previous}`, and ")?;
                }
                match (next, previous) {
                    (Some(next), Some(_)) => write!(f, "the next one, `{next}`, is not")?,
                    (Some(next), None) => write!(f, "the next one, `{next}`")?,
                    (None, _) => {
                        f.write_str("no row follows that decides between a gap and a wrong time")?
                    }
                }
                f.write_str("; the row was left out")
            }
            Self::StillRefused { newest, rows } => {
                newest.write(f, false)?;
                write!(
                    f,
                    "; {rows} rows were left out since the last one that was taken"
                )?;
                match **newest {
                    Self::TimeNotAfter { .. } => f.write_str(": was the clock set back?"),
                    _ => Ok(()),
                }
            }
            Self::HeaderAgain { moved, lacking, .. } => {
                write!(f, "the names of the columns stand here again, ")?;
                match moved {
                    true => write!(f, "in other places; from here on values are taken by them")?,
                    false => write!(f, "as before; the row was left out")?,
                }
                match lacking.as_slice() {
                    [] => Ok(()),
                    lacking => {
                        let names = quoted(lacking.iter().map(String::as_str));
                        write!(f, ", and without {names}, of which there are none")
                    }
                }
            }
            Self::NotAsDeclared { key, found, .. } => write!(
                f,
                "{found}, other than `{key}` in `[table]` declares; correct `{key}`, or leave it out so that it is found"
            ),
            Self::Machine { column, fault, .. } => write!(f, "`{column}` {fault}"),
            Self::LongOutOfOrder { time, previous, .. } => write!(
                f,
                "the time `{time}` is before `{previous}`; a long layout is read in order of time: sort the rows by their time"
            ),
            Self::LongFormat { long, .. } => write!(f, "{long}"),
            Self::CellCount {
                expected, found, ..
            } => {
                write!(
                    f,
                    "{found} cells where the header has {expected}; correct the row"
                )?;
                or_leniently(f, strict, "leave it out")
            }
            Self::CellsLacking {
                expected, found, ..
            } => write!(
                f,
                "{found} cells where the header has {expected}; those behind them are taken as missing"
            ),
            Self::CellBeyond { found, .. } => write!(
                f,
                "`{found}` stands behind the last column that has a name; it is passed over"
            ),
            Self::Unfit { file, reason } => write!(f, "{file}: {reason}"),
            Self::Stretch { reason } => f.write_str(reason),
            Self::CellsOfSpaces { .. } => f.write_str(
                "the cells are parted by spaces, which is not read; write commas between them, as `tr -s ' ' ',' < LOG` does"
            ),
            Self::BadObject { reason, .. } => {
                write!(
                    f,
                    "expected one JSON object on the line: {reason}; write one object per line"
                )?;
                or_leniently(f, strict, "leave the line out")
            }
            Self::JsonArray { .. } => f.write_str(
                "a JSON array begins here, where one object a line is expected; leave out its brackets and the commas between the objects, as `jq -c '.[]'` does"
            ),
            Self::NotBegun { file, reason } => write!(
                f,
                "{file}: it cannot be gone on with, and is left as it is, since no earlier run like this wrote it: {reason}; name another file, or move this one away"
            ),
            Self::ValueCount {
                file,
                expected,
                found,
            } => write!(f, "{file}: {found} values for {expected} columns"),
        }
    }
}

impl CellFault {
    /// Writes what is wrong with the cell that holds `found`; `strict` is whether it may still be read leniently.
    fn write(&self, f: &mut dyn Write, found: &str, strict: bool) -> fmt::Result {
        let then = match self {
            Self::NoNumber => {
                write!(
                    f,
                    "expected a number, found `{found}`; leave the cell empty where there is no value"
                )?;
                "take it as absent"
            }
            Self::OtherMark { mark, since } => {
                let as_where = match since {
                    Some(line) => format!("as in line {line}"),
                    None => "as `[table]` declares".to_owned(),
                };
                write!(
                    f,
                    "expected a number with the decimal mark `{mark}`, {as_where}, found `{found}`; write all numbers of a file with \
                     one mark"
                )?;
                "leave out those with another"
            }
            Self::NoInstant(fault) => {
                fault.write(f, found, false)?;
                "take it as absent"
            }
            Self::TimeBeyond => {
                write!(
                    f,
                    "the time `{found}` is more than 292 years from the origin of time, and no such instant fits; correct the time or \
                     its `unit` in `[time]`"
                )?;
                "leave the row out"
            }
            Self::NoTime { expected } => {
                write!(f, "expected {expected}, found ")?;
                match found {
                    "" => f.write_str("nothing")?,
                    found => write!(f, "`{found}`")?,
                }
                f.write_str("; ")?;
                if is_time_of_day(found) {
                    return f.write_str(
                        "a time of day alone is no instant: where its date stands in another column, name both in `[time]`, e.g. \
                         `column = \"{Date} {Time}\"`, else write it before the time",
                    );
                }
                if is_date(found) && !is_date(expected) {
                    return f.write_str("`unit = \"rfc3339\"` in `[time]` reads such times");
                }
                if has_clock(found) && !is_date(found) && !expected.contains('%') {
                    return f.write_str(
                        "`[time]` reads dates and times by their `format`, e.g. `format = \"%d.%m.%Y %H:%M:%S\"` for 31.12.2026 23:59:59",
                    );
                }
                f.write_str("correct the time or how it is to be read")?;
                "leave the row out"
            }
            Self::TimeSkipped { zone, offset_s } => {
                let (sign, minutes) = (if *offset_s < 0 { '-' } else { '+' }, offset_s.abs() / 60);
                write!(
                    f,
                    "`{found}` is no time in {zone}: the clocks are set forward over it; a logger whose clock is not set forward has \
                     `zone = \"{sign}{:02}:{:02}\"` in `[time]`",
                    minutes / 60,
                    minutes % 60
                )?;
                "leave the row out"
            }
        };
        or_leniently(f, strict, then)
    }
}

/// Which columns are missing, what is there, and what each may be called there.
fn lacking(
    f: &mut dyn Write,
    missing: &[MissingColumn],
    found: &[String],
    note: &str,
) -> fmt::Result {
    let there = match found {
        [] => "no columns".to_owned(),
        found => quoted(found.iter().map(String::as_str)),
    };
    let (is, correct) = match missing {
        [_] => (
            "is no column",
            "correct the name, or make it optional if it is a channel",
        ),
        _ => (
            "are no columns",
            "correct the names, or make optional those that are channels",
        ),
    };
    write!(
        f,
        "there {is} {}; found {there}{note}; ",
        quoted(missing.iter().map(|column| column.name.as_str()))
    )?;
    let mut named = found.iter().filter(|name| !name.is_empty());
    if !found.is_empty() && named.all(|name| cell::is_number(name) || has_clock(name)) {
        return f.write_str(
            "these are values: give the log with the line that names its columns, with which `tail -n +1 -f` begins",
        );
    }
    let near = missing
        .iter()
        .filter_map(|column| Some((column, column.nearest.as_deref()?)));
    let meant: Vec<_> = near
        .map(|(column, nearest)| match missing {
            [_] => format!("`{nearest}`"),
            _ => format!("`{nearest}` for `{}`", column.name),
        })
        .collect();
    if !meant.is_empty() {
        write!(f, "did you mean {}?", meant.join(", "))?;
    }
    match meant.len() {
        all if all == missing.len() => Ok(()),
        0 => write!(f, "{correct}"),
        _ => write!(f, " otherwise {correct}"),
    }
}
