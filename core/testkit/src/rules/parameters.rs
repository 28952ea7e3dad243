//! Whether parameters read back as they were written, and whether a node runs with all that its schema allows.

use std::borrow::Cow;

use serde_json::{Value as Json, json};

use super::super::compared::{course, none_of};
use super::super::fixture::Fixture;
use super::super::tried::{PANICS, tried};
use super::Subject;
use crate::diagnostic::{Place, SourceId};
use crate::document::Value as DocumentValue;
use crate::fit::{FitOptions, fit};
use crate::node::{ParameterPart, Range, as_toml, each_parameter, inline_toml};
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
    let full = in_full(subject, &subject.fixture);
    let mut found = Vec::new();
    each_parameter((subject.kind.schema)(), &parameters, &mut |part| {
        for (value, allowed) in probes(&part) {
            let Some(table) = with(&full, part.path, &value) else {
                continue;
            };
            let (path, name, value) = (part.path.join("."), part.name(), inline_toml(&value));
            let read = tried(|| Fixture::new(subject.kind, &table, &subject.given));
            found.push(match (read, allowed) {
                (Ok(_), Allowed::No) => format!("`{path} = {value}` is accepted"),
                (Ok(fixture), _) => match tried(|| lives(subject, &fixture)) {
                    Ok(()) => continue,
                    Err(why) => format!("with `{path} = {value}` {why}"),
                },
                (Err(why), _) if why.starts_with(PANICS) => {
                    format!("with `{path} = {value}` {why}")
                }
                (Err(why), Allowed::Yes) if is_of(name, &why) => {
                    format!("`{path} = {value}` is allowed by the schema, and refused: {why}")
                }
                // Something else does not go together with it.
                (Err(_), _) => continue,
            });
        }
    });
    none_of(found)
}

/// Whether a mistake is one of a parameter: it names it, and no other before it (`largest` must be above `smallest`).
fn is_of(name: &str, why: &str) -> bool {
    let message = why.lines().next().unwrap_or_default();
    let first = message.split('`').nth(1);
    why.contains(name) && first.is_none_or(|first| first.contains(name))
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
fn probes(part: &ParameterPart<'_>) -> Vec<(Json, Allowed)> {
    if part.is_text("Duration") {
        return vec![(json!("0s"), Allowed::Maybe)];
    }
    if part.is_text("Quantity") {
        let unit = part
            .value
            .and_then(|value| value.as_text()?.split_once(' '));
        let zero = format!("0 {}", unit.map_or("nm", |(_, unit)| unit));
        return vec![(json!("1 cd"), Allowed::No), (json!(zero), Allowed::Maybe)];
    }
    let integer = part.is("integer");
    if integer || part.is("number") {
        let number = |end: f64| {
            if integer {
                json!(end as i64)
            } else {
                json!(end)
            }
        };
        let ends = ends(integer, &part.range).into_iter();
        return ends.map(|end| (number(end), Allowed::Yes)).collect();
    }
    // What a choice needs beside it is for a case to state.
    let present = part.value.map(DocumentValue::to_json);
    let choices = part.choices().into_iter();
    let choices = choices.filter(|choice| Some(choice) != present.as_ref());
    choices.map(|choice| (choice, Allowed::Maybe)).collect()
}

/// The ends of a range, and what is far away where there is none.
fn ends(integer: bool, range: &Range) -> Vec<f64> {
    let mut ends = match (range.min, range.above) {
        (_, Some(_)) => vec![],
        (Some(min), _) => vec![min],
        (None, None) => vec![-1e6, -1.0, 0.0],
    };
    match (range.max, range.below) {
        (_, Some(_)) => {}
        (Some(max), _) => ends.push(max),
        // A count may stand for room that nobody has.
        (None, None) => ends.extend((!integer).then_some(1e6)),
    }
    ends
}

/// The parameters with defaults filled in, as the specification has them, and what the framework reads beside them.
fn in_full(subject: &Subject<'_>, fixture: &Fixture) -> toml::Table {
    let mut table = subject.parameters.clone();
    let elsewhere = subject.kind.framework_keys();
    table.retain(|key, _| elsewhere.contains(&key));
    let own = fixture.plan.nodes[0].spec.parameters();
    if let Some(toml::Value::Table(own)) = as_toml(&own) {
        table.extend(own);
    }
    table
}

/// The table with another value in a place; nothing where there is no such place.
fn with(table: &toml::Table, path: &[Cow<'_, str>], value: &Json) -> Option<toml::Table> {
    let mut json = serde_json::to_value(table).ok()?;
    let (last, way) = path.split_last()?;
    let way: String = way.iter().map(|part| format!("/{part}")).collect();
    match json.pointer_mut(&way)? {
        Json::Object(table) => drop(table.insert(last.to_string(), value.clone())),
        Json::Array(list) => *list.get_mut(last.parse::<usize>().ok()?)? = value.clone(),
        _ => return None,
    }
    as_toml(&json)?.as_table().cloned()
}
