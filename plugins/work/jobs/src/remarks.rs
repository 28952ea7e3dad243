//! The warnings after reading recorded data: what was not taken, and what may be wrong in it.

use std::collections::BTreeMap;
use std::path::PathBuf;

use athermal_analysis::figures::{count, counted};
use athermal_core::compile::Plan;
use athermal_core::message::Message;
use athermal_core::watch::Watch;
use athermal_files::{FileError, Report};
use athermal_run::live::monitor::words as findings;
pub use athermal_starter::WITHOUT_ZONE;
use serde_json::json;

use crate::refused;

/// Files that are given more than once, whose rows count as often.
fn repeated(files: impl Iterator<Item = impl AsRef<str>>) -> Vec<String> {
    let mut known: BTreeMap<PathBuf, u64> = BTreeMap::new();
    let mut messages = Vec::new();
    for file in files {
        if let Ok(path) = std::fs::canonicalize(file.as_ref()) {
            let times = known.entry(path).or_default();
            *times += 1;
            if *times == 2 {
                messages.push(format!(
                    "{}: this file is given more than once, and so often its rows count",
                    file.as_ref()
                ));
            }
        }
    }
    messages
}

/// The note that times have no zone, once for all files.
#[must_use]
pub fn without_zone(reports: &[(String, Report)]) -> Option<String> {
    let mut places = reports
        .iter()
        .filter_map(|(_, report)| report.without_zone.as_ref());
    let place = places.next()?;
    Some(format!("{place}: dates and times {WITHOUT_ZONE}"))
}

/// Warns of rows and cells that were not taken, of rejected samples, of units that differ from those of the graph, of files that
/// count more than once, and of dates without a zone.
pub fn warn(
    host: &dyn Watch,
    plan: &Plan,
    reports: &[(String, Report)],
    refused: u64,
    rejected: &[(String, u64)],
) {
    warn_of(host, doubts(plan, reports, refused, rejected), reports);
}

/// The same with doubts that are known already.
pub fn warn_of(host: &dyn Watch, doubts: Vec<Message>, reports: &[(String, Report)]) {
    for message in doubts {
        host.warning(message);
    }
    if let Some(note) = without_zone(reports) {
        host.note(note);
    }
}

/// The warnings about data, but for dates without a zone.
#[must_use]
pub fn doubts(
    plan: &Plan,
    reports: &[(String, Report)],
    refused: u64,
    rejected: &[(String, u64)],
) -> Vec<Message> {
    let mut messages = of_files(reports);
    messages.extend(other_units(plan, reports).into_iter().map(Message::from));
    if refused > 0 {
        let were = if refused == 1 { "was" } else { "were" };
        let words = format!(
            "{} {were} refused for a time that is not after the one before",
            counted(refused, "row")
        );
        let facts = json!({ "reason": "time_before", "count": refused });
        messages.push(Message::new(refused::ROWS, facts, words));
    }
    let rows: u64 = reports.iter().map(|(_, report)| report.rows).sum();
    let rejected = rejected.iter();
    messages.extend(rejected.map(|(channel, n)| findings::rejected(channel, *n, rows)));
    messages
}

/// Columns under whose names another unit stands than that of their signal.
fn other_units(plan: &Plan, reports: &[(String, Report)]) -> Vec<String> {
    let mut messages = Vec::new();
    for (file, report) in reports {
        for (column, unit) in &report.units {
            let sources = plan.sources.iter().zip(&plan.channels);
            let mut others = sources
                .filter(|(source, _)| source.column == *column)
                .map(|(source, planned)| (&source.name, &planned.channel.unit))
                .filter(|(_, own)| !unit.measures_same(own) || unit.is_another_than(own));
            if let Some((channel, own)) = others.next() {
                messages.push(format!(
                    "{file}: `{unit}` stands below the name of the column `{column}`, and {channel} takes its numbers for {own}: \
                     correct `unit` of the signal"
                ));
            }
        }
    }
    messages
}

/// The warnings about files after reading: rows and cells that were not taken, and files that count more than once.
#[must_use]
pub fn of_files(reports: &[(String, Report)]) -> Vec<Message> {
    let repeated = repeated(reports.iter().map(|(file, _)| file));
    let mut messages: Vec<Message> = repeated.into_iter().map(Message::from).collect();
    for (file, report) in reports {
        for (other, rows) in &report.overlaps {
            let all = counted(report.rows, "row");
            let some = match *rows == report.rows {
                true => "all".to_owned(),
                false => count(*rows),
            };
            let lie = if *rows == 1 { "lies" } else { "lie" };
            let words = format!(
                "{file}: {some} of its {all} {lie} in the period of {other}; files are not merged, so windows begin afresh in it and what both have counts twice"
            );
            messages.push(Message::from(words));
        }
        let unreadable = format!("unreadable cell{}", of_columns(report));
        let counted = [
            (&report.bad_cells, &*unreadable, "taken as missing"),
            (&report.refused_rows, "unreadable row", "left out"),
            (
                &report.refused_time,
                "row whose time is out of order",
                "left out",
            ),
            (
                &report.repeated_time,
                "row whose time is that of the row before",
                "left out",
            ),
        ];
        for headers in [&report.headers_moved, &report.headers] {
            if let Some(first) = &headers.first {
                let words = match headers.count {
                    more @ 2.. => format!("{first}; {} in all", count(more)),
                    _ => first.to_string(),
                };
                messages.push(refused::message(first, Some(headers.count), words));
            }
        }
        for (found, what, then) in counted {
            if let Some(first) = &found.first {
                let (n, taken) = (count(found.count), first.without_advice());
                let words = format!("{file}: {n} × {what}, {then}; the first: {taken}");
                messages.push(refused::message(first, Some(found.count), words));
            }
        }
        let kept = [
            (&report.short_rows, "row without its last cells"),
            (&report.notes, "row with a note behind it"),
        ];
        for (found, what) in kept {
            // Where nearly all rows are such, that is how the log is.
            let is_usual = found.count > 20 && report.rows.saturating_sub(found.count) <= 3;
            if let Some(first) = found.first.as_ref().filter(|_| !is_usual) {
                let n = count(found.count);
                let words = format!("{file}: {n} × {what}; the first: {first}");
                messages.push(refused::message(first, Some(found.count), words));
            }
        }
        if let Some(place) = &report.truncated {
            let words = format!(
                "{place}: the last line has no end and was left out, since it was cut off or is still being written"
            );
            let facts = json!({ "reason": "cut_off", "count": 1, "file": &*place.file, "line": place.line });
            messages.push(Message::new(refused::ROWS, facts, words));
        }
    }
    messages
}

/// How many columns with cells that cannot be read are named.
const NAMED: usize = 8;

/// In which columns cells cannot be read, where these are several.
fn of_columns(report: &Report) -> String {
    let mut columns: BTreeMap<&str, u64> = BTreeMap::new();
    for found in &report.bad_cells_of {
        if let Some(column) = found.first.as_ref().and_then(FileError::column) {
            *columns.entry(column).or_default() += found.count;
        }
    }
    if columns.len() < 2 {
        return String::new();
    }
    let named = columns.iter().take(NAMED);
    let mut named: Vec<_> = named
        .map(|(column, n)| format!("{} in `{column}`", count(*n)))
        .collect();
    if columns.len() > NAMED {
        named.push(format!("others in {} more", columns.len() - NAMED));
    }
    format!(" ({})", named.join(", "))
}
