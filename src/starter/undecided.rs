//! Decides between two forms of dates that both read the first rows of a log, by all of its rows. Not which forms these are.

use std::path::Path;

use athermal::core::document::TableBase;
use athermal::files::{FileError, Layout, Options, Reader, Row, TimeColumn, TimeForm};

use super::clock::Clock;
use super::dates;

/// A log that goes on from one day to the next does not leap so far; one whose days are taken for months leaps each night.
const LEAP_NS: i64 = 20 * 86_400_000_000_000;

/// How many rows speak against a form.
fn doubts(path: &Path, clock: &Clock, form: &TimeForm) -> Result<u64, FileError> {
    let layout = Layout {
        time: TimeColumn {
            columns: clock.columns.clone(),
            form: form.clone(),
            zone: None,
        },
        channels: Vec::new(),
        table: TableBase::default(),
    };
    let options = Options {
        lenient: true,
        ..Options::default()
    };
    let mut reader = Reader::open(path, layout, options)?;
    let (mut row, mut last, mut leaps) = (Row::default(), None, 0);
    while reader.next_into(&mut row)? {
        let far = |last: i64| row.time_ns.saturating_sub(last) > LEAP_NS;
        leaps += u64::from(last.is_some_and(far));
        last = Some(row.time_ns);
    }
    let report = reader.report();
    Ok(leaps + report.refused_rows.count + report.refused_time.count)
}

/// The clock of a log in the form against which fewer rows speak, where rows decide.
///
/// # Errors
/// The file cannot be read.
pub fn decided(path: &Path, mut clock: Clock) -> Result<Clock, FileError> {
    let Some(other) = clock.other.clone() else {
        return Ok(clock);
    };
    let other_form = TimeForm::Format(other.clone());
    let own = doubts(path, &clock, &clock.form)?;
    let others = doubts(path, &clock, &other_form)?;
    if own == others {
        return Ok(clock);
    }
    let mut against = other;
    if others < own {
        let chosen = dates::by(against);
        against = match std::mem::replace(&mut clock.form, chosen.form) {
            TimeForm::Format(format) => format,
            _ => return Ok(clock),
        };
        clock.why = chosen.why;
        clock.declared = Some(chosen.declared);
    }
    clock.other = None;
    clock.why.push_str(&format!(
        "; as `{against}` they would leap by months, or be none"
    ));
    Ok(clock)
}
