//! Whether a table is in long format, a row for each value, and what its columns then are. It is read where it is
//! declared.

use std::collections::BTreeSet;
use std::fmt;

use crate::cell::is_number;
use crate::instant::has_clock;

/// The columns of a log in long format.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LongFormat {
    /// That of the time.
    pub time: String,
    /// That which names what a row has.
    pub names: String,
    /// That of the values.
    pub values: String,
}

/// How such columns are usually called.
const NAMES: &str = "entity_id entity _field series datapoint key sensor_id tag tagname name variable varname signal channel sensor parameter point item metric variable_name tag_name kanal messstelle";
const VALUES: &str =
    "state _value value val values data reading varvalue wert messwert measurement";

/// A wider table is none.
const WIDEST: usize = 12;

impl LongFormat {
    /// That of these columns and rows, which have wanted names in cells, or else columns that are called as in long format.
    pub(crate) fn of(
        columns: &[String],
        rows: &[Vec<String>],
        is_wanted: &dyn Fn(&str) -> bool,
    ) -> Option<Self> {
        let cells = |column: usize| {
            let cells = rows.iter().filter_map(move |row| row.get(column));
            cells.map(String::as_str).filter(|cell| !cell.is_empty())
        };
        let called = |column: usize, known: &str| {
            let name = columns[column].to_lowercase();
            known.split(' ').any(|of| of == name)
        };
        let all = 0..columns.len();
        let is_text =
            |&column: &usize| !cells(column).any(|cell| is_number(cell) || has_clock(cell));
        let is_value = |&column: &usize| called(column, VALUES) && cells(column).any(is_number);
        let numbers = |&column: &usize| cells(column).any(is_number);
        let names = all.clone().filter(is_text).find(|&column| {
            let different: BTreeSet<&str> = cells(column).collect();
            let is_called = called(column, NAMES) && all.clone().any(|column| is_value(&column));
            is_called || different.len() > 1 && cells(column).any(is_wanted)
        })?;
        let values = all
            .clone()
            .find(is_value)
            .or_else(|| all.clone().rev().find(numbers))?;
        let time = all
            .clone()
            .find(|&column| column != names && column != values)?;
        (columns.len() <= WIDEST).then(|| Self {
            time: columns[time].clone(),
            names: columns[names].clone(),
            values: columns[values].clone(),
        })
    }
}

impl fmt::Display for LongFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            time,
            names,
            values,
        } = self;
        write!(
            f,
            "the log is in long format: `{names}` says of each row what its `{values}` is; declare that in `[table]` by `layout = \"long\"`, \
             `name = \"{names}\"` and `value = \"{values}\"`, or pivot it to a column for each signal, in pandas by \
             `.pivot(index=\"{time}\", columns=\"{names}\", values=\"{values}\")`"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(table: &str, wanted: &str) -> Option<LongFormat> {
        let mut lines = table
            .lines()
            .map(|line| line.split(';').map(str::to_owned).collect::<Vec<_>>());
        let columns = lines.next().unwrap();
        LongFormat::of(&columns, &lines.collect::<Vec<_>>(), &|name| name == wanted)
    }

    #[test]
    fn a_row_for_each_value_is_seen_by_its_names_and_refused_with_a_way_out() {
        let long = of("time;tag;value\n0;plate;21,5\n0;Z;3\n1;plate;21,6\n", "").unwrap();
        assert_eq!(
            long.to_string(),
            "the log is in long format: `tag` says of each row what its `value` is; declare that in `[table]` by `layout = \"long\"`, \
             `name = \"tag\"` and `value = \"value\"`, or pivot it to a column for each signal, in pandas by \
             `.pivot(index=\"time\", columns=\"tag\", values=\"value\")`"
        );
        let otherwise = "wann;was;wieviel\n2026-03-01 12:00;plate;21\n2026-03-01 12:00;Z;3\n";
        assert_eq!(of(otherwise, "room"), None);
        let long = of(otherwise, "plate").unwrap();
        assert_eq!(
            (&*long.time, &*long.names, &*long.values),
            ("wann", "was", "wieviel")
        );
    }

    #[test]
    fn a_column_of_text_beside_others_makes_no_long_format() {
        assert_eq!(of("time;state;Z_nm\n0;on;1\n1;off;2\n", "Z_nm"), None);
        assert_eq!(of("time;name;level\n0;A;1\n1;A;2\n", ""), None);
    }
}
