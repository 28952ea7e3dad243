//! Decides which texts of a log may be its times: the cells of a column, or dates and times of day from two. Not which of them are.

use athermal_core::time::{TimeColumns, TimeColumnsError};
use athermal_files::{Description, is_time_of_day, with_decimal_point};

use super::dates::{self, nearly_all};

/// Texts that may be times.
pub struct Texts {
    /// Where they are from.
    pub columns: TimeColumns,
    written: Vec<String>,
    /// The row of each.
    rows: Vec<usize>,
    decimal_comma: bool,
}

impl Texts {
    /// Those of a column; where it holds dates alone or times of day alone, together with the nearest that holds the other.
    pub fn of(described: &Description, index: usize) -> Self {
        match with_the_other(described, index) {
            Some(columns) => Self::from(described, columns),
            None => Self::from(
                described,
                TimeColumns::one(described.columns[index].clone()),
            ),
        }
    }

    /// Those of a column by its name, or of several in braces.
    ///
    /// # Errors
    /// A text that says what is wrong with the name.
    pub fn named(described: &Description, name: &str) -> Result<Self, String> {
        let columns: TimeColumns = name
            .parse()
            .map_err(|error: TimeColumnsError| format!("--time {name:?}: {error}"))?;
        let lacks = |name: &&String| !described.columns.contains(name);
        if let Some(lacking) = columns.names().iter().find(lacks) {
            return Err(format!(
                "there is no column `{lacking}`; there are {}",
                described.columns.join(", ")
            ));
        }
        let mut places = described.columns.iter();
        Ok(match places.position(|column| column == name) {
            Some(index) => Self::of(described, index),
            None => Self::from(described, columns),
        })
    }

    /// Those of columns that are put together.
    pub fn from(described: &Description, columns: TimeColumns) -> Self {
        let place = |name| described.columns.iter().position(|column| column == name);
        let places: Vec<Option<usize>> = columns.names().iter().map(place).collect();
        let texts = described.rows.iter().map(|row| {
            let mut text = Vec::new();
            columns.join(&mut text, |column| {
                let cell = places[column].and_then(|place| row.get(place));
                cell.map_or(&[], |cell| cell.trim().as_bytes())
            });
            String::from_utf8_lossy(&text).into_owned()
        });
        let texts = texts.enumerate().filter(|(_, text)| !text.is_empty());
        let (rows, written) = texts.unzip();
        Self {
            written,
            rows,
            columns,
            decimal_comma: described.table.separator.is_some(),
        }
    }

    /// The first, as the log has it.
    pub fn first(&self) -> Option<&str> {
        self.written.first().map(String::as_str)
    }

    /// The same with the number of the row of each.
    pub fn by_row(&self) -> impl Iterator<Item = (usize, String)> {
        self.rows.iter().copied().zip(self.read())
    }

    /// All, as a reader takes them: a decimal comma may be a point.
    pub fn read(&self) -> Vec<String> {
        let read = |text: &String| match self.decimal_comma {
            true => with_decimal_point(text).into_owned(),
            false => text.clone(),
        };
        self.written.iter().map(read).collect()
    }
}

/// A column of dates and one of times of day, of which this is one and the other is the nearest.
fn with_the_other(described: &Description, index: usize) -> Option<TimeColumns> {
    let holds = |column: usize, what: fn(&str) -> bool| {
        let cells = described.rows.iter().filter_map(|row| row.get(column));
        let cells = cells
            .map(|cell| cell.trim())
            .filter(|cell| !cell.is_empty());
        cells.clone().next().is_some() && nearly_all(cells, what)
    };
    let nearest = |what: fn(&str) -> bool| {
        let others = (0..described.columns.len()).filter(|&other| other != index);
        others
            .filter(|&other| holds(other, what))
            .min_by_key(|other| other.abs_diff(index))
    };
    let (date, of_day) = if holds(index, is_time_of_day) {
        (nearest(dates::is_date)?, index)
    } else if holds(index, dates::is_date) {
        (index, nearest(is_time_of_day)?)
    } else {
        return None;
    };
    let names = [date, of_day].map(|column| &described.columns[column]);
    // A name with braces of its own cannot stand in any.
    format!("{{{}}} {{{}}}", names[0], names[1]).parse().ok()
}
