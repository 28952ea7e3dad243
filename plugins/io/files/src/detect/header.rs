//! Where a table begins among the first lines of a text, and what stands between its cells: loggers and spreadsheets write lines
//! of their own above it. Not which of its columns are where, nor what its rows hold.

use std::collections::HashSet;

use athermal_core::document::TableFormat;

use super::units::are_units;
use crate::cell::is_number;
use crate::columns::{Columns, names_in};
use crate::lines::{Lines, is_content};
use crate::{FileError, Layout};

/// What may stand between cells, the most usual first.
const SEPARATORS: [u8; 4] = [b',', b';', b'\t', b'|'];

/// How many lines are looked at for a header.
const LOOKED_AT: usize = 50;

/// What is known of a table before its names are read.
pub(crate) struct Head {
    /// What stands between cells.
    pub separator: u8,
    /// How many lines stand above the names.
    pub skip: u32,
    /// The first cells of the lines above, save values, as a logger writes them again when it begins anew.
    pub above: Vec<String>,
}

/// Goes to the header, so that it is the next line: where it is declared, or where it is found.
///
/// By a layout the header is the first line that names the time and all channels that must be there, and may be a comment. If none
/// does, and without a layout, it is the line that begins the longest table.
pub(crate) fn seek(
    lines: &mut Lines,
    table: &TableFormat,
    layout: Option<&Layout>,
) -> Result<Head, FileError> {
    let mut separator = table.separator.map(|declared| declared.0);
    let mut above = Vec::new();
    let mut seen: Vec<Line> = Vec::new();
    let mut found = None;
    let declared = table.skip.is_some() || table.names.is_some();
    let skip = u64::from(table.skip.unwrap_or(0));
    let mut rows = table.names.unwrap_or(1);
    while found.is_none() && (declared || seen.len() < LOOKED_AT) && lines.advance()? {
        let named = separator_named(lines.text()).filter(|_| seen.is_empty());
        if let Some(named) = named {
            separator = separator.or(Some(named));
            above.push(SEPARATOR_KEY.to_owned());
        } else if !lines.text().trim_ascii().is_empty() {
            let (number, text) = lines.take();
            let line = Line { number, text };
            found = match declared {
                true if number <= skip => None,
                true => {
                    rows = rows.saturating_sub(1);
                    (rows == 0).then(|| separator.unwrap_or_else(|| line.separator(layout)))
                }
                false => layout.and_then(|layout| line.header_of(layout, separator)),
            }
            .map(|separator| (seen.len(), separator));
            seen.push(line);
        }
    }
    if !declared && found.is_none() {
        if let Some(line) = seen.iter().find(|line| !line.is_comment())
            && separator.is_none()
            && are_of_spaces(&seen)
        {
            let place = lines.place_of(line.number);
            return Err(FileError::CellsOfSpaces { place });
        }
        found = behind_labview(&seen).or_else(|| longest_table(&seen, separator));
    }
    let Some((first, separator)) = found else {
        return Err(match seen.last() {
            Some(last) if declared => FileError::NotAsDeclared {
                place: lines.place_of(last.number),
                key: if table.skip.is_some() {
                    "skip"
                } else {
                    "names"
                },
                found: "the last line stands here".to_owned(),
            },
            _ => FileError::Empty {
                file: lines.file.clone(),
            },
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
    let first_cells = skipped.filter_map(|line| names_in(&line.text, separator).into_iter().next());
    above.extend(first_cells.filter(|cell| !cell.is_empty() && !is_value(cell)));
    let header = &mut seen[0];
    let skip = u32::try_from(header.number - 1).unwrap_or(u32::MAX);
    lines.comments_count = header.is_comment();
    header.text = header.names().to_vec();
    lines.hold(
        seen.into_iter()
            .map(|line| (line.number, line.text))
            .collect(),
    );
    Ok(Head {
        separator,
        skip,
        above,
    })
}

/// A measurement file of LabVIEW: its names stand behind the last of these lines, among cells that the file names.
const END_OF_LABVIEW_HEADER: &[u8] = b"***End_of_Header***";

fn behind_labview(seen: &[Line]) -> Option<(usize, u8)> {
    let first = seen.first()?;
    first
        .text
        .starts_with(b"LabVIEW Measurement")
        .then_some(())?;
    let is_end = |line: &Line| line.text.starts_with(END_OF_LABVIEW_HEADER);
    let end = seen.iter().rposition(is_end)?;
    let names = (end + 1..seen.len()).find(|&at| !seen[at].is_comment())?;
    let by_comma = |line: &Line| line.text.trim_ascii() == b"Separator,Comma";
    let separator = if seen.iter().any(by_comma) {
        b','
    } else {
        b'\t'
    };
    Some((names, separator))
}

/// Whether the cells of most rows are parted by spaces: words of values in lines without a separator.
fn are_of_spaces(seen: &[Line]) -> bool {
    let content = seen.iter().filter(|line| !line.is_comment()).skip(1);
    let (mut rows, mut such) = (0, 0);
    for line in content {
        rows += 1;
        let text = String::from_utf8_lossy(&line.text);
        let words: Vec<&str> = text.split_whitespace().collect();
        let is_one = !text.trim().contains(SEPARATORS.map(char::from));
        let enough = words.len() > 2 || words.len() == 2 && !text.contains(':');
        such += usize::from(is_one && enough && words.iter().all(|word| is_value(word)));
    }
    rows > 0 && such * 2 > rows
}

/// With this a first line names the separator, for spreadsheets.
const SEPARATOR_KEY: &str = "sep=";

/// What a first line `sep=;` says, as a spreadsheet takes it.
fn separator_named(line: &[u8]) -> Option<u8> {
    let line = line.trim_ascii_start();
    let line = line.strip_prefix(b"\"").unwrap_or(line);
    match line {
        [key @ .., _, b'\r', b'\n'] | [key @ .., _, b'\n' | b'"'] | [key @ .., _]
            if key.eq_ignore_ascii_case(SEPARATOR_KEY.as_bytes()) =>
        {
            // A line that ends there names none.
            let named = line.get(key.len()).copied();
            named.filter(|separator| !matches!(separator, b'\r' | b'\n'))
        }
        _ => None,
    }
}

/// The separator under which a line shows the most of the wanted columns, then the most columns.
fn choose_separator(line: &[u8], layout: Option<&Layout>) -> u8 {
    let score = |separator: u8| {
        let names = names_in(line, separator);
        let known: HashSet<&str> = names.iter().map(String::as_str).collect();
        let wanted = layout.into_iter().flat_map(Layout::names);
        let wanted = wanted.filter(|name| known.contains(name)).count();
        (wanted, names.len())
    };
    // `max_by_key` takes the last of equals; the most usual separator is to win.
    let each = SEPARATORS.into_iter().rev();
    each.max_by_key(|&separator| score(separator))
        .unwrap_or(b',')
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

    fn separator(&self, layout: Option<&Layout>) -> u8 {
        choose_separator(self.names(), layout)
    }

    /// What stands between cells where this is the header that a layout asks for.
    fn header_of(&self, layout: &Layout, declared: Option<u8>) -> Option<u8> {
        let separator = declared.unwrap_or_else(|| self.separator(Some(layout)));
        let columns = Columns::of(layout, &names_in(self.names(), separator));
        let any = layout.channels.is_empty() || columns.channels.iter().any(Option::is_some);
        (any && columns.lacking(layout).is_empty()).then_some(separator)
    }
}

/// The line that names the columns of the longest table: the fullest of its width that holds no values, or else the comment just
/// above it. The first line of content where there is neither.
fn longest_table(seen: &[Line], declared: Option<u8>) -> Option<(usize, u8)> {
    let content: Vec<usize> = (0..seen.len())
        .filter(|&at| !seen[at].is_comment())
        .collect();
    let first = *content.first()?;
    let separators = declared.map_or(SEPARATORS.to_vec(), |declared| vec![declared]);
    let mut longest = (0, 0);
    let mut found = None;
    for separator in separators {
        let cut = |line: &Line| names_in(line.names(), separator);
        let rows: Vec<Vec<String>> = seen.iter().map(cut).collect();
        for (nth, &at) in content.iter().enumerate() {
            let width = rows[at].len();
            let of_width = content[nth..].iter().copied();
            let of_width = of_width.filter(|&row| is_of_width(&rows[row], width));
            let length = of_width.clone().count();
            if width < 2 || (length, width) <= longest {
                continue;
            }
            // Names of channels may stand above those of columns, and then are not all different, or name no time.
            let filled = |row: &usize| {
                let cells: HashSet<&String> =
                    rows[*row].iter().filter(|cell| !cell.is_empty()).collect();
                let full = rows[*row].iter().filter(|cell| !cell.is_empty()).count();
                (full, names_time(&rows[*row]), cells.len() == full)
            };
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
                found = Some((header, separator));
            }
        }
    }
    let of_first = || declared.unwrap_or_else(|| choose_separator(&seen[first].text, None));
    found.or_else(|| Some((first, of_first())))
}

/// Whether a row has so many cells, or one more that is empty or a note: some loggers end rows, but not the names, with a separator.
fn is_of_width(row: &[String], width: usize) -> bool {
    row.len() == width || row.len() == width + 1 && !is_value(&row[width])
}

/// Whether a cell is what loggers call the time.
fn names_time(row: &[String]) -> bool {
    const WORDS: &str = "time times timestamp timestamps date datetime zeit datum zeitstempel";
    let mut words = row
        .iter()
        .flat_map(|cell| cell.split(|c: char| !c.is_alphabetic()));
    words.any(|word| WORDS.split(' ').any(|of| of.eq_ignore_ascii_case(word)))
}

/// Whether a row may hold the names of columns, and no values.
fn can_name(row: &[String]) -> bool {
    !row.iter().any(|cell| is_value(cell))
}

/// Whether a cell holds a number, a date or a time.
pub(super) fn is_value(cell: &str) -> bool {
    let begins = cell.starts_with(|first: char| first.is_ascii_digit());
    begins && !cell.contains(char::is_alphabetic) || is_number(cell)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TimeForm;

    fn chosen(header: &str, wanted: &[&str]) -> char {
        let layout = Layout::new("", TimeForm::SECONDS, wanted.iter().copied());
        char::from(choose_separator(header.as_bytes(), Some(&layout)))
    }

    #[test]
    fn the_separator_is_the_one_that_shows_the_wanted_columns() {
        assert_eq!(chosen("t,a,b", &["a"]), ',');
        assert_eq!(chosen("t;a;b", &["a"]), ';');
        assert_eq!(chosen("t\ta\tb", &["a"]), '\t');
        assert_eq!(chosen("t|a|b", &["a"]), '|');
        assert_eq!(chosen("t;a, b, c, d;e", &["a, b, c, d"]), ';');
        assert_eq!(chosen("t", &[]), ',');
        assert_eq!(chosen("x;y;z", &["a"]), ';');
    }

    #[test]
    fn a_separator_within_quotes_does_not_count() {
        assert_eq!(chosen("\"p;q;r;s\",x", &[]), ',');
    }
}
