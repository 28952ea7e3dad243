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
/// What `unit` of `[time]` may be.
pub const UNITS: [&str; 11] = [
    "ns", "us", "\u{b5}s", "\u{3bc}s", "ms", "s", "min", "h", "d", SAMPLE, RFC_3339,
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
        TimeForm::Numbers { .. } => Some("times that are numbers"),
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
        (Some((name, _)), None) => TimeForm::Numbers {
            unit: format!("1{name}").parse().unwrap_or(SECOND),
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
