//! Whether parameters read back as they were written, and whether a node runs with all that its schema allows.

use std::borrow::Cow;

use serde_json::Value as Json;
use toml::Value;

use super::super::compared::course;
use super::super::fixture::Fixture;
use super::super::tried::{PANICS, tried};
use super::Subject;
use crate::diagnostic::{Place, SourceId};
use crate::document::Value as DocumentValue;
use crate::fit::{FitOptions, fit};
use crate::node::{ParameterPart, Range, as_toml, each_parameter};
use crate::recording::{Event, Table};

pub(super) fn read_back(subject: &Subject<'_>) -> Result<(), String> {
    reads_back(subject, &subject.fixture)
}

/// What is written of parameters is read as the same. What is not written at all shows only in how the specification is shown.
fn reads_back(subject: &Subject<'_>, fixture: &Fixture) -> Result<(), String> {
    let written = in_full(subject, fixture);
    let again = Fixture::new(subject.kind, &written, &subject.given)
        .map_err(|why| format!("written out in full, the parameters are refused: {why}"))?;
    let [before, after] = [fixture, &again].map(|fixture| &fixture.plan.nodes[0].spec);
    if before.parameters() != after.parameters() {
        let (before, after) = (before.parameters(), after.parameters());
        return Err(format!("the parameters {before} are read back as {after}"));
    }
    let (before, after) = (format!("{before:?}"), format!("{after:?}"));
    if before == after {
        Ok(())
    } else {
        Err(format!("{before} is read back as {after}"))
    }
}

pub(super) fn ranges(subject: &Subject<'_>) -> Result<(), String> {
    let parameters = written(&subject.fixture.plan.nodes[0].spec.parameters());
    let parameters = DocumentValue::from_json(&parameters, Place::new(SourceId(0), 0, 0))
        .map_err(|error| error.to_string())?;
    let mut found = Vec::new();
    each_parameter((subject.kind.schema)(), &parameters, &mut |part| {
        for (value, allowed) in probes(&part) {
            let mut table = in_full(subject, &subject.fixture);
            if !set(&mut table, part.path, value.clone()) {
                continue;
            }
            let (path, name) = (part.path.join("."), part.name());
            let read = tried(|| Fixture::new(subject.kind, &table, &subject.given));
            match (read, allowed) {
                (Ok(_), Allowed::No) => {
                    found.push(format!("`{path} = {value}` is accepted"));
                }
                (Ok(fixture), _) => {
                    if let Err(why) = tried(|| lives(subject, &fixture)) {
                        found.push(format!("with `{path} = {value}` {why}"));
                    }
                }
                (Err(why), _) if why.starts_with(PANICS) => {
                    found.push(format!("with `{path} = {value}` {why}"));
                }
                (Err(why), Allowed::Yes) if why.contains(name) => found.push(format!(
                    "`{path} = {value}` is allowed by the schema, and refused: {why}"
                )),
                // Something else does not go together with it.
                (Err(_), _) => {}
            }
        }
    });
    if found.is_empty() {
        Ok(())
    } else {
        Err(found.join("\n"))
    }
}

/// JSON without its nulls, which a graph file cannot hold.
pub(super) fn written(json: &Json) -> Json {
    match json {
        Json::Object(table) => {
            let there = table.iter().filter(|(_, value)| !value.is_null());
            there
                .map(|(key, value)| (key.clone(), written(value)))
                .collect()
        }
        Json::Array(list) => list.iter().map(written).collect(),
        other => other.clone(),
    }
}

/// What is taken runs, and is written as it was read.
fn lives(subject: &Subject<'_>, fixture: &Fixture) -> Result<(), String> {
    reads_back(subject, fixture)?;
    let mut table = Table::default();
    for (event, values) in subject.events().iter().take(subject.ticks() / 5) {
        if let Event::Row(now) = event {
            table.push(*now, values);
        }
    }
    let (fitted, _) = fit(&fixture.plan, &table, &FitOptions::default(), &mut |_| ())
        .map_err(|error| error.to_string())?;
    let course = course(fixture, &mut fixture.engine(&fitted), table.events());
    let infinite = |number| course.values(number).any(f64::is_infinite);
    if (0..fixture.slots().len()).any(infinite) {
        return Err("something infinite comes out".to_owned());
    }
    Ok(())
}

/// Whether a value of a parameter must be accepted.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Allowed {
    Yes,
    No,
    /// It depends on others.
    Maybe,
}

/// Values to try.
fn probes(part: &ParameterPart<'_>) -> Vec<(Value, Allowed)> {
    let text = |text: &str, allowed| (Value::String(text.to_owned()), allowed);
    if part.is_text("Duration") {
        return vec![text("0s", Allowed::Maybe)];
    }
    if part.is_text("Quantity") {
        let unit = part
            .value
            .and_then(|value| value.as_text()?.split_once(' '));
        let zero = format!("0 {}", unit.map_or("nm", |(_, unit)| unit));
        return vec![text("1 cd", Allowed::No), text(&zero, Allowed::Maybe)];
    }
    let integer = part.is("integer");
    if integer || part.is("number") {
        return numbers(integer, &part.range);
    }
    // What a choice needs beside it is for a case to state.
    let present = part.value.map(DocumentValue::to_json);
    let choices = part.choices().into_iter();
    let choices = choices.filter(|choice| Some(choice) != present.as_ref());
    let choices = choices.filter_map(|choice| Some((as_toml(&choice)?, Allowed::Maybe)));
    choices.collect()
}

/// The ends of a range, and what is far away where there is none.
fn numbers(integer: bool, range: &Range) -> Vec<(Value, Allowed)> {
    let low = match (range.min, range.above) {
        (_, Some(_)) => vec![],
        (Some(min), _) => vec![min],
        (None, None) => vec![-1e6, -1.0, 0.0],
    };
    let high = match (range.max, range.below) {
        (_, Some(_)) => None,
        (Some(max), _) => Some(max),
        // A count may stand for room that nobody has.
        (None, None) => (!integer).then_some(1e6),
    };
    let ends = low.into_iter().chain(high);
    let value = |value: f64| match integer {
        true => Value::Integer(value as i64),
        false => Value::Float(value),
    };
    ends.map(|end| (value(end), Allowed::Yes)).collect()
}

/// The parameters with defaults filled in, as the specification has them, and what the framework reads beside them.
fn in_full(subject: &Subject<'_>, fixture: &Fixture) -> toml::Table {
    let mut table = subject.parameters.clone();
    let elsewhere = subject.kind.framework_keys();
    table.retain(|key, _| elsewhere.contains(&key));
    let own = fixture.plan.nodes[0].spec.parameters();
    if let Some(Value::Table(own)) = as_toml(&own) {
        table.extend(own);
    }
    table
}

/// Puts a value in its place; whether there is one.
fn set(table: &mut toml::Table, path: &[Cow<'_, str>], value: Value) -> bool {
    let Some((last, way)) = path.split_last() else {
        return false;
    };
    let Some((first, way)) = way.split_first() else {
        table.insert(last.to_string(), value);
        return true;
    };
    let mut place = table.get_mut(&**first);
    for part in way {
        place = place.and_then(|place| step(place, part));
    }
    match place {
        Some(Value::Table(table)) => {
            table.insert(last.to_string(), value);
            true
        }
        Some(list @ Value::Array(_)) => step(list, last).is_some_and(|place| {
            *place = value;
            true
        }),
        _ => false,
    }
}

fn step<'a>(value: &'a mut Value, part: &str) -> Option<&'a mut Value> {
    match value {
        Value::Table(table) => table.get_mut(part),
        Value::Array(list) => list.get_mut(part.parse::<usize>().ok()?),
        _ => None,
    }
}
