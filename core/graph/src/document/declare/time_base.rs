//! `[time]`: which columns hold the time and how it is read; reading them is left to the sources.

use std::fmt;
use std::str::FromStr;

use super::reading::{known_keys, length, table, text, wrong_type};
use crate::diagnostic::{Diagnostics, Place};
use crate::document::graph_file::{TimeBase, TimeForm};
use crate::document::problem;
use crate::document::tree::{Table, Value};
use crate::time::{Duration, TimeColumns, TimeFormat, Zone};

const SECOND: Duration = Duration::from_ns(1_000_000_000);
/// What `unit` may be, beside the units of time.
const SAMPLE: &str = "sample";
const RFC_3339: &str = "rfc3339";
const ELAPSED: &str = "h:min:s";
const DAY_NS: i64 = 86_400_000_000_000;
/// Numbers that count from another origin than 1970: the length of one, and how far before 1970 the origin lies, both in ns. Julian days
/// and modified ones, those of MATLAB since the year 0, steps of 100 ns of Windows since 1601, and of .NET since the year 1.
const SINCE: [(&str, i64, i128); 5] = [
    ("jd", DAY_NS, 210_866_760_000_000_000_000),
    ("mjd", DAY_NS, 3_506_716_800_000_000_000),
    ("datenum", DAY_NS, 62_167_305_600_000_000_000),
    ("filetime", 100, 11_644_473_600_000_000_000),
    ("ticks", 100, 62_135_596_800_000_000_000),
];
/// What `unit` of `[time]` may be.
pub const UNITS: [&str; 17] = [
    "ns", "us", "\u{b5}s", "\u{3bc}s", "ms", "s", "min", "h", "d", SAMPLE, RFC_3339, ELAPSED,
    SINCE[0].0, SINCE[1].0, SINCE[2].0, SINCE[3].0, SINCE[4].0,
];

pub(super) fn declare(time: Option<&Value>, diagnostics: &mut Diagnostics) -> TimeBase {
    let seconds = TimeForm::Numbers { unit: SECOND };
    let Some(time) = time.and_then(|time| table(time, "time", diagnostics)) else {
        return TimeBase::Column {
            column: TimeColumns::one("time_s"),
            form: seconds,
            zone: None,
        };
    };
    known_keys(
        time,
        &["column", "unit", "step", "format", "zone"],
        "[time]",
        diagnostics,
    );
    let unit = time.get("unit").and_then(|value| unit(value, diagnostics));
    let step = time
        .get("step")
        .and_then(|value| length(value, "step", None, diagnostics));
    let form = match format(time, unit, diagnostics) {
        Some(format) => TimeForm::Format(format),
        None => form(time, unit, step, diagnostics),
    };
    let column = match time
        .get("column")
        .and_then(|value| parsed(value, "column", diagnostics))
    {
        Some(columns) => columns,
        None => match (&form, unit) {
            (TimeForm::Samples { .. }, _) => TimeColumns::one(SAMPLE),
            (TimeForm::Rfc3339 | TimeForm::Format(_), _) => TimeColumns::one("time"),
            (TimeForm::Elapsed | TimeForm::Since { .. }, _) => TimeColumns::one("time"),
            (TimeForm::Numbers { .. }, Some((name, _))) => TimeColumns::one(format!("time_{name}")),
            (TimeForm::Numbers { .. }, None) => TimeColumns::one("time_s"),
        },
    };
    let zone = zone(time, &form, diagnostics);
    TimeBase::Column { column, form, zone }
}

/// The zone of dates and times, where one is stated; other times have none, nor those that have an offset each.
fn zone(time: &Table, form: &TimeForm, diagnostics: &mut Diagnostics) -> Option<Zone> {
    let entry = time.entry("zone")?;
    let with = match form {
        TimeForm::Numbers { .. } | TimeForm::Since { .. } => Some("times that are numbers"),
        TimeForm::Elapsed => Some("times that have elapsed"),
        TimeForm::Samples { .. } => Some("times that are sample numbers"),
        TimeForm::Format(format) if format.has_offset() => Some("a format that has the offset"),
        TimeForm::Format(_) | TimeForm::Rfc3339 => None,
    };
    if let Some(with) = with {
        let (key, with) = ("zone", with.to_owned());
        diagnostics.report(entry.key, problem::TimeContradiction { key, with });
    }
    parsed(&entry.value, "zone", diagnostics)
}

/// The format of dates and times, where there is one; beside it neither a unit nor a step has a meaning.
fn format(
    time: &Table,
    unit: Option<(&str, Place)>,
    diagnostics: &mut Diagnostics,
) -> Option<TimeFormat> {
    let entry = time.entry("format")?;
    let beside = unit.map(|(name, _)| format!("unit = \"{name}\""));
    let step = || time.entry("step").map(|_| "a `step`".to_owned());
    if let Some(with) = beside.or_else(step) {
        let key = "format";
        diagnostics.report(entry.key, problem::TimeContradiction { key, with });
    }
    parsed(&entry.value, "format", diagnostics)
}

fn parsed<T>(value: &Value, key: &str, diagnostics: &mut Diagnostics) -> Option<T>
where
    T: FromStr<Err: fmt::Display>,
{
    let parsed = text(value, key, diagnostics)?.parse();
    if let Err(error) = &parsed {
        let (key, reason) = (Some(key.to_owned()), T::Err::to_string(error));
        diagnostics.report(value.place, problem::Refused { key, reason });
    }
    parsed.ok()
}

fn form(
    time: &Table,
    unit: Option<(&str, Place)>,
    step: Option<Duration>,
    diagnostics: &mut Diagnostics,
) -> TimeForm {
    match (unit, time.entry("step")) {
        (None | Some((SAMPLE, _)), Some(_)) | (Some((SAMPLE, _)), None) => {
            TimeForm::Samples { step }
        }
        (Some((name, _)), Some(entry)) => {
            diagnostics.report(
                entry.key,
                problem::TimeContradiction {
                    key: "step",
                    with: format!("unit = \"{name}\""),
                },
            );
            TimeForm::Samples { step }
        }
        (Some((RFC_3339, _)), None) => TimeForm::Rfc3339,
        (Some((ELAPSED, _)), None) => TimeForm::Elapsed,
        (Some((name, _)), None) => match SINCE.iter().find(|(since, ..)| *since == name) {
            Some(&(_, ns, origin_ns)) => TimeForm::Since {
                unit: Duration::from_ns(ns),
                origin_ns,
            },
            None => TimeForm::Numbers {
                unit: format!("1{name}").parse().unwrap_or(SECOND),
            },
        },
        (None, None) => TimeForm::Numbers { unit: SECOND },
    }
}

fn unit<'a>(value: &'a Value, diagnostics: &mut Diagnostics) -> Option<(&'a str, Place)> {
    let Some(name) = value.as_text() else {
        wrong_type(value, "unit", "a unit of time in quotes", diagnostics);
        return None;
    };
    if UNITS.contains(&name) {
        return Some((name, value.place));
    }
    let choices = UNITS
        .iter()
        .filter(|unit| unit.is_ascii())
        .map(|unit| (*unit).to_owned())
        .collect();
    let problem = problem::UnknownChoice {
        key: Some("unit".to_owned()),
        found: name.to_owned(),
        choices,
    };
    diagnostics.report(value.place, problem);
    None
}
