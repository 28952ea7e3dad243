//! Which column gives the time of a log that has no column of the declared one, beside others that have. Not the time of a log alone.

use std::borrow::Cow;
use std::path::Path;

use athermal_core::document::TableFormat;
use athermal_core::time::TimeColumns;

use super::{Description, NumberForm};
use crate::recording::is_dated;
use crate::{Tables, TimeColumn, TimeForm, with_decimal_point};

/// So many rows are looked at.
const ROWS: usize = 50;

/// The one column of dates that rise, in the declared form, in that of RFC 3339, or in numbers of the unit that its name says. None of
/// a file that has the declared time, or several such columns.
#[must_use]
pub fn other_time(path: &Path, declared: &TimeColumn, tables: &Tables) -> Option<TimeColumn> {
    let described = Description::laid_out(path, ROWS, &TableFormat::default(), tables).ok()?;
    let cells = |at: usize| {
        let cells = described.rows.iter().filter_map(move |row| row.get(at));
        let cells = cells.map(|cell| with_decimal_point(cell.trim()));
        cells.filter(|cell| !cell.is_empty())
    };
    let mut columns = described.columns.iter().enumerate();
    let is_declared = |(at, name): (usize, &String)| {
        let is_read = |cell: Cow<str>| declared.form.read(cell.as_bytes()).is_some();
        let names = declared.columns.names();
        names.contains(name) && (names.len() > 1 || cells(at).any(is_read))
    };
    if columns.any(is_declared) {
        return None;
    }
    let columns = described.columns.iter().enumerate();
    let mut found = columns.filter_map(|(at, name)| {
        let lower = name.to_lowercase();
        let words: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric()).collect();
        let by_name = NumberForm::of_name(&words).map(NumberForm::time_form);
        let forms = [
            Some(declared.form.clone()),
            Some(TimeForm::Rfc3339),
            by_name,
        ];
        let form = forms
            .into_iter()
            .flatten()
            .find(|form| rise(form, cells(at)))?;
        Some(TimeColumn {
            columns: TimeColumns::one(name.clone()),
            form,
            zone: declared.zone.clone(),
        })
    });
    found.next().filter(|_| found.next().is_none())
}

/// Whether these are dates of which most are after the one before, and none is before it.
fn rise<'a>(form: &TimeForm, cells: impl Iterator<Item = Cow<'a, str>>) -> bool {
    let times = cells.map(|cell| form.read(cell.as_bytes()));
    let times: Vec<i64> = times.collect::<Option<_>>().unwrap_or_default();
    let rising = times.windows(2).filter(|pair| pair[0] < pair[1]).count();
    let dated = times.first().is_some_and(|first| is_dated(form, *first));
    dated && times.is_sorted() && rising > 0 && 2 * rising + 1 >= times.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_another_log_is_its_one_column_of_dates_that_rise() {
        let folder = std::env::temp_dir();
        let path = folder.join(format!("athermal-other-time-{}.csv", std::process::id()));
        let declared = TimeColumn {
            columns: TimeColumns::one("time"),
            form: TimeForm::Format("%d.%m.%Y %H:%M".parse().unwrap()),
            zone: None,
        };
        for (text, column) in [
            (
                "Stamp,z\n2026-03-02 00:00,1\n2026-03-02 00:01,2\n",
                Some("Stamp"),
            ),
            (
                "z,Zeit\n1,02.03.2026 00:00\n2,02.03.2026 00:01\n",
                Some("Zeit"),
            ),
            (
                "time_ms,z\n1772409600000,1\n1772409660000,2\n",
                Some("time_ms"),
            ),
            (
                "time,z\n2026-03-02 00:00,1\n2026-03-02 00:01,2\n",
                Some("time"),
            ),
            ("time_s,z\n0,1\n60,2\n", None),
            ("n,z\n1772409600,1\n1772409660,2\n", None),
            ("day,z\n2026-03-02,1\n2026-03-02,2\n", None),
            ("Stamp,z\n2026-03-02 00:01,1\n2026-03-02 00:00,2\n", None),
            (
                "a,b\n2026-03-02 00:00,2026-03-02 00:00\n2026-03-02 00:01,2026-03-02 00:01\n",
                None,
            ),
            (
                "time,Stamp\n2026-03-02 00:00,2026-03-02 00:00\n2026-03-02 00:01,2026-03-02 00:01\n",
                None,
            ),
            ("", None),
        ] {
            std::fs::write(&path, text).unwrap();
            let found =
                other_time(&path, &declared, &Tables::default()).map(|of| of.columns.to_string());
            assert_eq!(found.as_deref(), column, "{text}");
        }
        std::fs::remove_file(&path).unwrap();
    }
}
