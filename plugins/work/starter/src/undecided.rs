//! Decides between forms of dates that all read the first rows of a log, by all of its rows. Not which forms these are.

use std::path::{Path, PathBuf};

use athermal_core::document::TableBase;
use athermal_core::time::TimeFormat;
use athermal_files::{FileError, Layout, Options, Reader, Row, Tables, TimeColumn, TimeForm};

use super::clock::Clock;
use super::dates;

/// A log that goes on from one day to the next does not leap so far; one whose days are taken for months leaps each night.
const LEAP_NS: i64 = 20 * DAY_NS;
/// A day in ns.
const DAY_NS: i64 = 86_400_000_000_000;

/// The times of a log in a form.
fn times(
    path: &Path,
    tables: &Tables,
    clock: &Clock,
    form: &TimeForm,
) -> Result<Reader, FileError> {
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
        tables: tables.clone(),
        ..Options::default()
    };
    Reader::open(path, layout, options)
}

/// From when to when a log goes in a form.
pub(super) fn period(
    path: &Path,
    tables: &Tables,
    clock: &Clock,
    form: &TimeForm,
) -> Option<(i64, i64)> {
    let (mut reader, mut row, mut period) =
        (times(path, tables, clock, form).ok()?, Row::default(), None);
    while reader.next_into(&mut row).ok()? {
        let (from, _) = *period.get_or_insert((row.time_ns, row.time_ns));
        period = Some((from, row.time_ns));
    }
    period
}

/// The log whose times would overlap those of all others with day and month exchanged, and in which form that is.
pub fn exchanged(logs: &[(&Path, &Clock)], tables: &Tables) -> Option<(PathBuf, TimeFormat)> {
    let twins = |clock: &Clock| match &clock.form {
        TimeForm::Rfc3339 => [" ", "T"]
            .map(|of| format!("%Y-%d-%m{of}%H:%M:%S%.f"))
            .to_vec(),
        TimeForm::Format(format) => {
            let parts: Vec<String> = format
                .as_str()
                .split("%d")
                .map(|of| of.replace("%m", "%d"))
                .collect();
            vec![parts.join("%m")]
        }
        _ => Vec::new(),
    };
    let overlap = |a: (i64, i64), b: (i64, i64)| a.0 <= b.1 && b.0 <= a.1;
    // That the year comes first and the month last is rarer than any other order.
    let mut likely: Vec<&(&Path, &Clock)> = logs.iter().collect();
    likely.sort_by_key(|(_, clock)| match &clock.form {
        TimeForm::Format(format) => 1 + u8::from(format.as_str().starts_with("%d.")),
        _ => 0,
    });
    likely.into_iter().find_map(|(path, clock)| {
        let others = logs.iter().filter(|(other, _)| other != path);
        let others = others.map(|(path, clock)| period(path, tables, clock, &clock.form));
        let others: Vec<(i64, i64)> = others.collect::<Option<_>>()?;
        let twins = twins(clock)
            .into_iter()
            .filter_map(|of| of.parse::<TimeFormat>().ok());
        let mut fitting = twins.filter(|twin| {
            let own = period(path, tables, clock, &TimeForm::Format(twin.clone()));
            own.is_some_and(|own| others.iter().all(|other| overlap(own, *other)))
        });
        fitting.next().map(|twin| (path.to_path_buf(), twin))
    })
}

/// What speaks against a form: rows that it does not read, or by which times leap or go back; then steps over midnight that are not as
/// long as most. Beside it the sum of all times, which two forms share that read them alike.
fn doubts(
    path: &Path,
    tables: &Tables,
    clock: &Clock,
    form: &TimeForm,
) -> Result<(Doubts, i128), FileError> {
    let mut reader = times(path, tables, clock, form)?;
    let (mut row, mut last, mut leaps, mut nights) = (Row::default(), None, 0, Vec::new());
    let mut sum = 0;
    while reader.next_into(&mut row)? {
        sum += i128::from(row.time_ns);
        if let Some(last) = last.replace(row.time_ns) {
            let step = row.time_ns.saturating_sub(last);
            leaps += u64::from(step > LEAP_NS);
            if row.time_ns.div_euclid(DAY_NS) != last.div_euclid(DAY_NS) {
                nights.push(step);
            }
        }
    }
    nights.sort_unstable();
    let usual = nights.get(nights.len() / 2).copied().unwrap_or(0);
    let odd = nights
        .iter()
        .filter(|step| step.abs_diff(usual) > usual.unsigned_abs() / 10);
    let report = reader.report();
    let wrong = leaps + report.refused_rows.count + report.refused_time.count;
    Ok(((wrong, odd.count()), sum))
}

/// How many rows speak against a form, and how many nights.
type Doubts = (u64, usize);

/// The clock of a log in the form against which least speaks, where rows decide.
///
/// # Errors
/// The file cannot be read.
pub fn decided(path: &Path, tables: &Tables, mut clock: Clock) -> Result<Clock, FileError> {
    if clock.others.is_empty() {
        return Ok(clock);
    }
    let own = clock.form.clone();
    let others = std::mem::take(&mut clock.others);
    let others = others.into_iter().map(TimeForm::Format);
    let (of_own, read) = doubts(path, tables, &clock, &own)?;
    let mut judged = vec![(of_own, own.clone())];
    for form in others {
        let (doubts, others) = doubts(path, tables, &clock, &form)?;
        if (doubts, others) != (of_own, read) {
            judged.push((doubts, form));
        }
    }
    judged.sort_by_key(|(doubts, _)| *doubts);
    let least = judged[0].0;
    let (best, rest): (Vec<_>, Vec<_>) = judged.into_iter().partition(|(of, _)| *of == least);
    let format = |(_, form): (Doubts, TimeForm)| match form {
        TimeForm::Format(format) => Some(format),
        _ => None,
    };
    let mut best = best.into_iter();
    let chosen = best
        .next()
        .filter(|(_, form)| *form != own)
        .and_then(format);
    if let Some(format) = chosen {
        let zone = clock.zone.take();
        clock = Clock {
            zone,
            ..Clock::dated(clock.columns, dates::by(format))
        };
    }
    // That nobody else reads otherwise needs no word where it is as RFC 3339 says.
    let is_plain = clock.form == TimeForm::Rfc3339;
    let others = best.filter_map(format);
    clock.others = others
        .filter(|of| !(is_plain || dates::is_rare(of)))
        .collect();
    if let (Some(against), true, false) = (
        rest.into_iter().find_map(format),
        clock.others.is_empty(),
        is_plain,
    ) {
        clock.why.push_str(&format!(
            "; as `{against}` they would leap by months, or be none"
        ));
    }
    Ok(clock)
}
