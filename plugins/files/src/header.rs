//! Where a table begins among the first lines of a text, and what stands between its cells: loggers and spreadsheets write lines
//! of their own above it. Not which of its columns are where, nor what its rows hold.

use crate::cell::is_number;
use crate::columns::{Columns, DELIMITERS, choose_delimiter, names_in};
use crate::lines::{Lines, has_bare_returns, is_content};
use crate::units::are_units;
use crate::{FileError, Layout};

/// How many lines are looked at for a header.
const LOOKED_AT: usize = 50;

/// What is known of a table before its names are read.
pub(crate) struct Head {
    /// What stands between cells.
    pub delimiter: u8,
    /// The first cells of the lines above, save values, as a logger writes them again when it begins anew.
    pub above: Vec<String>,
}

/// Goes to the header, so that it is the next line. The delimiter may be stated.
///
/// By a layout the header is the first line that names the time and all channels that must be there, and may be a comment; if none
/// does, the line that names the most. Where none names any, and without a layout, it is the line that begins the longest table.
pub(crate) fn seek(
    lines: &mut Lines,
    stated: Option<u8>,
    layout: Option<&Layout>,
) -> Result<Head, FileError> {
    let mut delimiter = stated;
    let mut above = Vec::new();
    let mut seen: Vec<Line> = Vec::new();
    let mut found = None;
    while found.is_none() && seen.len() < LOOKED_AT && lines.advance().map_err(unheaded)? {
        if lines.place().line == 1 && has_bare_returns(lines.text()) {
            return Err(FileError::CarriageReturns {
                place: lines.place(),
            });
        }
        let named = delimiter_named(lines.text()).filter(|_| seen.is_empty());
        if let Some(named) = named {
            delimiter = delimiter.or(Some(named));
            above.push(DELIMITER_KEY.to_owned());
        } else if !lines.text().trim_ascii().is_empty() {
            let (number, text) = lines.take();
            let line = Line { number, text };
            found = layout
                .and_then(|layout| line.header_of(layout, delimiter))
                .map(|delimiter| (seen.len(), delimiter));
            seen.push(line);
        }
    }
    let found = found
        .or_else(|| most_named(&seen, delimiter, layout?))
        .or_else(|| longest_table(&seen, delimiter));
    let Some((first, delimiter)) = found else {
        return Err(FileError::Empty {
            file: lines.file.clone(),
        });
    };
    let no_text = |byte: &u8| byte.is_ascii_control() && !byte.is_ascii_whitespace();
    let mut to_header = seen[..=first].iter();
    if let Some(line) = to_header.find(|line| line.text.iter().any(no_text)) {
        return Err(FileError::NotText {
            place: lines.place_of(line.number),
        });
    }
    let skipped = seen.drain(..first).filter(|line| !line.is_comment());
    let first_cells = skipped.filter_map(|line| names_in(&line.text, delimiter).into_iter().next());
    above.extend(first_cells.filter(|cell| !cell.is_empty() && !is_value(cell)));
    let header = &mut seen[0];
    lines.comments_count = header.is_comment();
    header.text = header.names().to_vec();
    lines.hold(
        seen.into_iter()
            .map(|line| (line.number, line.text))
            .collect(),
    );
    Ok(Head { delimiter, above })
}

/// A row that is too long, where no header was found before it: none can be left out then.
fn unheaded(error: FileError) -> FileError {
    match error {
        FileError::TooLong { place, limit } => FileError::HeaderTooLong { place, limit },
        other => other,
    }
}

/// With this a first line names the delimiter, for spreadsheets.
const DELIMITER_KEY: &str = "sep=";

/// What a first line `sep=;` says, as a spreadsheet takes it.
fn delimiter_named(line: &[u8]) -> Option<u8> {
    let line = line.trim_ascii_start();
    let line = line.strip_prefix(b"\"").unwrap_or(line);
    match line {
        [key @ .., _, b'\r', b'\n'] | [key @ .., _, b'\n' | b'"'] | [key @ .., _]
            if key.eq_ignore_ascii_case(DELIMITER_KEY.as_bytes()) =>
        {
            // A line that ends there names none.
            let named = line.get(key.len()).copied();
            named.filter(|delimiter| !matches!(delimiter, b'\r' | b'\n'))
        }
        _ => None,
    }
}

/// A line among the first.
struct Line {
    number: u64,
    text: Vec<u8>,
}

impl Line {
    fn is_comment(&self) -> bool {
        !is_content(&self.text)
    }

    /// The text without the mark of a comment.
    fn names(&self) -> &[u8] {
        let text = self.text.trim_ascii_start();
        let marks = text.iter().take_while(|byte| **byte == b'#').count();
        match marks {
            0 => &self.text,
            marks => &text[marks..],
        }
    }

    /// What stands between cells where this is the header that a layout asks for.
    fn header_of(&self, layout: &Layout, stated: Option<u8>) -> Option<u8> {
        let delimiter = stated.unwrap_or_else(|| choose_delimiter(self.names(), layout.names()));
        let columns = Columns::of(layout, &names_in(self.names(), delimiter));
        let any = layout.channels.is_empty() || columns.channels.iter().any(Option::is_some);
        (any && columns.lacking(layout).is_empty()).then_some(delimiter)
    }
}

/// The first of the lines that name the most wanted columns and hold no values; none where none names any.
fn most_named(seen: &[Line], stated: Option<u8>, layout: &Layout) -> Option<(usize, u8)> {
    let content = seen
        .iter()
        .enumerate()
        .filter(|(_, line)| !line.is_comment());
    let each = content.map(|(at, line)| {
        let delimiter = stated.unwrap_or_else(|| choose_delimiter(&line.text, layout.names()));
        let names = names_in(&line.text, delimiter);
        let named = match can_name(&names) {
            true => Columns::of(layout, &names).count(),
            false => 0,
        };
        (named, at, delimiter)
    });
    // `max_by_key` takes the last of equals.
    let most = each.rev().max_by_key(|(named, ..)| *named);
    most.filter(|(named, ..)| *named > 0)
        .map(|(_, at, delimiter)| (at, delimiter))
}

/// The line that names the columns of the longest table: the fullest of its width that holds no values, or else the comment just
/// above it. The first line of content where there is neither.
fn longest_table(seen: &[Line], stated: Option<u8>) -> Option<(usize, u8)> {
    let content: Vec<usize> = (0..seen.len())
        .filter(|&at| !seen[at].is_comment())
        .collect();
    let first = *content.first()?;
    let delimiters = stated.map_or(DELIMITERS.to_vec(), |stated| vec![stated]);
    let mut longest = (0, 0);
    let mut found = None;
    for delimiter in delimiters {
        let cut = |line: &Line| names_in(line.names(), delimiter);
        let rows: Vec<Vec<String>> = seen.iter().map(cut).collect();
        for (nth, &at) in content.iter().enumerate() {
            let width = rows[at].len();
            let of_width = content[nth..].iter().copied();
            let of_width = of_width.filter(|&row| is_of_width(&rows[row], width));
            let length = of_width.clone().count();
            if width < 2 || (length, width) <= longest {
                continue;
            }
            let filled = |row: &usize| rows[*row].iter().filter(|cell| !cell.is_empty()).count();
            // A spreadsheet fills what stands above a table up with empty cells. The first of equals is to win.
            let of_names = of_width.filter(|&row| can_name(&rows[row]));
            let fullest = of_names.rev().max_by_key(filled);
            let above = (0..at).rev().find(|&above| seen[above].is_comment());
            let above = above.filter(|&above| is_of_width(&rows[at], rows[above].len()));
            // A row of units has no values either; the names stand above it.
            let fullest =
                fullest.filter(|&row| above.is_none() || row != at || !are_units(&rows[row]));
            if let Some(header) = fullest.or(above) {
                longest = (length, width);
                found = Some((header, delimiter));
            }
        }
    }
    let no_names = std::iter::empty();
    let of_first = || stated.unwrap_or_else(|| choose_delimiter(&seen[first].text, no_names));
    found.or_else(|| Some((first, of_first())))
}

/// Whether a row has so many cells, or one more that is empty: some loggers end rows, but not the names, with a delimiter.
pub(crate) fn is_of_width(row: &[String], width: usize) -> bool {
    row.len() == width || row.len() == width + 1 && row[width].is_empty()
}

/// Whether a row may hold the names of columns, and no values.
fn can_name(row: &[String]) -> bool {
    !row.iter().any(|cell| is_value(cell))
}

/// Whether a cell holds a number, a date or a time.
pub(crate) fn is_value(cell: &str) -> bool {
    let begins = cell.starts_with(|first: char| first.is_ascii_digit());
    begins && !cell.contains(char::is_alphabetic) || is_number(cell)
}
