//! `[signals]`: what is measured; whether the data have it is decided when data are read.

use std::sync::Arc;

use super::names::distinct;
use super::placeholder;
use super::reading::{
    known_keys, length, meant, missing, quantity, table, text, texts, wrong_type,
};
use super::sets::Sets;
use crate::diagnostic::{Diagnostics, Names, Place, counted};
use crate::document::graph_file::SignalDecl;
use crate::document::problem;
use crate::document::tree::{Data, Entry, Value};
use crate::time::Duration;
use crate::unit::Unit;

const KEYS: [&str; 8] = [
    "unit",
    "channels",
    "column",
    "range",
    "max_age",
    "optional",
    KNOWN_AHEAD,
    APPLIES_AT,
];
const KNOWN_AHEAD: &str = "known_ahead";
const APPLIES_AT: &str = "applies_at";
/// The placeholder in column patterns.
const CHANNEL: &str = "channel";
/// Stands in for an age that cannot be read, so that nobody asks for one.
const SOME_AGE: Duration = Duration::from_ns(60_000_000_000);

pub(super) fn declare(
    signals: Option<&Value>,
    sets: &Sets,
    sample: Option<Duration>,
    broken: &mut Vec<String>,
    diagnostics: &mut Diagnostics,
) -> Vec<SignalDecl> {
    let Some(signals) = signals.and_then(|signals| table(signals, "signals", diagnostics)) else {
        return Vec::new();
    };
    let mut declared = Vec::new();
    for (name, entry) in signals.iter() {
        match signal(name, entry, sets, sample, diagnostics) {
            Some(signal) => declared.push(signal),
            None => broken.push(name.to_owned()),
        }
    }
    declared
}

/// A signal whose channels and unit are known: what else is wrong with it is reported, and is no mistake of those who refer to it.
fn signal(
    name: &str,
    entry: &Entry,
    sets: &Sets,
    sample: Option<Duration>,
    diagnostics: &mut Diagnostics,
) -> Option<SignalDecl> {
    let keys = table(&entry.value, name, diagnostics)?;
    let what = format!("signal \"{name}\"");
    known_keys(keys, &KEYS, &what, diagnostics);
    let before = diagnostics.error_count();
    let given = |key: &str| meant(keys, key, &KEYS);
    let unit = match given("unit") {
        Some(value) => unit(value, diagnostics),
        None => {
            missing(
                &entry.value,
                "unit",
                &what,
                Some("write a UCUM unit, e.g. unit = \"nm\", or \"1\" if it has none"),
                diagnostics,
            );
            None
        }
    };
    let channels = match given("channels") {
        Some(value) => channels(value, &what, sets, diagnostics),
        None => {
            missing(
                &entry.value,
                "channels",
                &what,
                Some("list them, or name a set"),
                diagnostics,
            );
            None
        }
    };
    let known = diagnostics.error_count() == before;
    let column = match given("column") {
        Some(value) => column(value, channels.as_deref(), &what, diagnostics),
        None => Some(format!("{{{CHANNEL}}}")),
    };
    let range = match (given("range"), &unit) {
        (Some(value), unit) => range(value, unit.as_ref().map(|(unit, _)| unit), diagnostics),
        (None, _) => None,
    };
    let max_age = given("max_age")
        .map(|value| length(value, "max_age", sample, diagnostics).unwrap_or(SOME_AGE));
    let optional = match (given("optional"), &channels) {
        (Some(value), Some(channels)) => optional(value, name, channels, diagnostics),
        _ => Vec::new(),
    };
    let known_ahead = given(KNOWN_AHEAD)
        .map(|value| length(value, KNOWN_AHEAD, sample, diagnostics).unwrap_or(SOME_AGE));
    let applies_at = match (given(APPLIES_AT), known_ahead) {
        (Some(value), Some(_)) => self::column(value, channels.as_deref(), &what, diagnostics),
        (Some(value), None) => {
            diagnostics.report(value.place, problem::NotPlanned {});
            None
        }
        (None, _) => {
            let count = channels.as_ref().map_or(0, Vec::len);
            let of_channel = if count > 1 { "{channel}_" } else { "" };
            Some(format!("{of_channel}{APPLIES_AT}"))
        }
    };
    let (unit, unit_place) = unit.filter(|_| known)?;
    Some(SignalDecl {
        name: name.to_owned(),
        place: entry.key,
        unit,
        unit_place,
        channels: channels?,
        column: column.unwrap_or_default(),
        range,
        max_age,
        optional,
        known_ahead,
        applies_at: applies_at.unwrap_or_default(),
    })
}

fn unit(value: &Value, diagnostics: &mut Diagnostics) -> Option<(Unit, Place)> {
    let Some(text) = value.as_text() else {
        wrong_type(value, "unit", "a unit like \"nm\"", diagnostics);
        return None;
    };
    match Unit::parse(text) {
        Ok(unit) => Some((unit, value.place)),
        Err(error) => {
            diagnostics.report(value.place, problem::NotAUnit { error });
            None
        }
    }
}

fn channels(
    value: &Value,
    what: &str,
    sets: &Sets,
    diagnostics: &mut Diagnostics,
) -> Option<Vec<(String, Place)>> {
    if let Some(set) = value.as_text() {
        let or = format!(
            "write `[{}]` for a channel of that name",
            toml::Value::from(set)
        );
        let members = sets.find_or(set, value.place, Some(or), diagnostics)?;
        return Some(
            members
                .iter()
                .map(|member| (member.clone(), value.place))
                .collect(),
        );
    }
    let channels = texts(
        value,
        "channels",
        "a list of names, or the name of a set",
        diagnostics,
    )?;
    if value.as_list().is_some_and(<[Value]>::is_empty) {
        diagnostics.report(
            value.place,
            problem::EmptyList {
                what: format!("the list of channels of {what}"),
            },
        );
    }
    distinct(&channels, "channel", diagnostics);
    Some(channels)
}

fn column(
    value: &Value,
    channels: Option<&[(String, Place)]>,
    what: &str,
    diagnostics: &mut Diagnostics,
) -> Option<String> {
    let pattern = text(value, "column", diagnostics)?;
    let mut named = placeholder::names(pattern).peekable();
    // One that stands for nothing may be meant for the channel.
    let names_channel = named.peek().is_some();
    for name in named {
        if name != CHANNEL {
            let known = vec![CHANNEL.to_owned()];
            let what = format!("a column of {what}");
            diagnostics.report(
                value.place,
                problem::UnknownPlaceholder {
                    name: name.to_owned(),
                    known,
                    what,
                    instead: None,
                },
            );
        }
    }
    let count = channels.map_or(0, <[_]>::len);
    if !names_channel && count > 1 {
        diagnostics.report(
            value.place,
            problem::OneColumn {
                pattern: pattern.to_owned(),
                channels: count,
            },
        );
    }
    Some(pattern.to_owned())
}

fn range(value: &Value, unit: Option<&Unit>, diagnostics: &mut Diagnostics) -> Option<(f64, f64)> {
    let Data::List(ends) = &value.data else {
        wrong_type(
            value,
            "range",
            "a list of two quantities, the low end first",
            diagnostics,
        );
        return None;
    };
    let [low, high] = ends.as_slice() else {
        let found = format!("a list of {}", counted(ends.len(), "value"));
        let expected = "a list of two quantities, the low end first".to_owned();
        diagnostics.report(
            value.place,
            problem::WrongType {
                key: Some("range".to_owned()),
                expected,
                found,
                hint: None,
            },
        );
        return None;
    };
    let of = (unit.map_or("Cel", Unit::text), unit.is_some());
    // Both are read before either is given up, so that mistakes in both are reported.
    let ends = (
        quantity(low, "range", of, diagnostics).map(|of| (of, low.place)),
        quantity(high, "range", of, diagnostics).map(|of| (of, high.place)),
    );
    let unit = unit?;
    let foreign = [&ends.0, &ends.1].into_iter().flatten();
    let foreign: Vec<_> = foreign
        .filter(|(of, _)| of.in_unit(unit).is_none())
        .collect();
    if let Some((first, place)) = foreign.first() {
        // Where neither converts, the unit of the signal is the one mistake.
        let problem = problem::RangeUnit {
            found: first.unit.to_string(),
            unit: unit.clone(),
        };
        diagnostics.report(*place, problem);
        return None;
    }
    let (low, high) = (ends.0?.0.in_unit(unit)?, ends.1?.0.in_unit(unit)?);
    if low < high {
        return Some((low, high));
    }
    diagnostics.report(
        value.place,
        problem::RangeOrder {
            low,
            high,
            unit: unit.to_string(),
        },
    );
    None
}

fn optional(
    value: &Value,
    signal: &str,
    channels: &[(String, Place)],
    diagnostics: &mut Diagnostics,
) -> Vec<String> {
    let names = texts(value, "optional", "a list of channels", diagnostics).unwrap_or_default();
    let known: Names = channels
        .iter()
        .map(|(channel, _)| channel.clone())
        .collect();
    let known = Arc::new(known);
    for (name, place) in &names {
        if !known.contains(name) {
            let problem = problem::UnknownChannel {
                name: name.clone(),
                signal: signal.to_owned(),
                known: Arc::clone(&known),
            };
            diagnostics.report(*place, problem);
        }
    }
    names.into_iter().map(|(name, _)| name).collect()
}
