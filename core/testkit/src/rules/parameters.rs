//! Decides whether parameters read back as they were written, and whether what the schema says of them is what is taken.

use serde_json::Value as Json;
use toml::Value;

use super::super::compared::course;
use super::super::fixture::Fixture;
use super::super::tried::{PANICS, tried};
use super::Subject;
use super::schema::{Bound, Leaf, Sort, defaults, leaves};
use crate::fit::{FitOptions, fit};
use crate::recording::{Event, Table};

pub(super) fn read_back(subject: &Subject<'_>) -> Result<(), String> {
    reads_back(subject, &subject.fixture)
}

/// What is written of parameters is read as the same. What is not written at all shows only in how the specification is shown.
fn reads_back(subject: &Subject<'_>, fixture: &Fixture) -> Result<(), String> {
    let written = in_full(subject, fixture);
    let again = Fixture::new(subject.kind, &written, &subject.given)
        .map_err(|told| format!("written out in full, the parameters are refused: {told}"))?;
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

pub(super) fn ranges(subject: &Subject<'_>, all: &[Subject<'_>]) -> Result<(), String> {
    let schema = Json::from((subject.kind.schema)());
    let parameters = subject.fixture.plan.nodes[0].spec.parameters();
    let mut found = left_out(subject, &schema);
    // What the schema says of itself is told once.
    if all
        .first()
        .is_some_and(|first| std::ptr::eq(first, subject))
    {
        let defaults = defaults(&schema).into_iter();
        found.extend(defaults.filter(|leaf| !leaf.is_allowed()).map(|leaf| {
            let name = leaf.path.join(".");
            format!(
                "`{name}` is {} by default, which the schema does not allow",
                leaf.value
            )
        }));
    }
    for leaf in leaves(&schema, &parameters) {
        let name = leaf.path.join(".");
        let last = leaf
            .path
            .iter()
            .rfind(|part| part.parse::<usize>().is_err());
        let last = last.cloned().unwrap_or_default();
        for (value, allowed) in probes(&leaf) {
            let mut table = in_full(subject, &subject.fixture);
            if !set(&mut table, &leaf.path, value.clone()) {
                continue;
            }
            let read = tried(|| Fixture::new(subject.kind, &table, &subject.given));
            match (read, allowed) {
                (Ok(fixture), Allowed::Yes | Allowed::Maybe) => {
                    if let Err(told) = tried(|| lives(subject, &fixture)) {
                        found.push(format!("with `{name} = {value}` {told}"));
                    }
                }
                (Err(told), _) if told.starts_with(PANICS) => {
                    found.push(format!("with `{name} = {value}` {told}"));
                }
                (Ok(_), Allowed::No) => {
                    found.push(format!("`{name} = {value}` is taken without a word"))
                }
                (Err(told), Allowed::Yes) if told.contains(&last) => found.push(format!(
                    "`{name} = {value}` is allowed by the schema, and refused: {told}"
                )),
                // Something else does not go together with it.
                (Err(_), Allowed::Yes | Allowed::Maybe) => {}
                (Err(told), Allowed::No) if told.contains(&last) => {}
                (Err(told), Allowed::No) => found.push(format!(
                    "`{name} = {value}` is refused without naming `{last}`: {told}"
                )),
            }
        }
    }
    if found.is_empty() {
        Ok(())
    } else {
        Err(found.join("\n"))
    }
}

/// Parameters with a default that is refused where they are left out.
fn left_out(subject: &Subject<'_>, schema: &Json) -> Vec<String> {
    let mut found = Vec::new();
    for (name, property) in schema["properties"].as_object().into_iter().flatten() {
        let default = &property["default"];
        let mut table = in_full(subject, &subject.fixture);
        if default.is_null() || table.remove(name).is_none() {
            continue;
        }
        // Whether it can learn may hang on the parameter.
        table.remove("learn");
        let read = tried(|| Fixture::new(subject.kind, &table, &subject.given));
        if let Err(told) = read
            && told.contains(name.as_str())
        {
            found.push(format!(
                "left out, `{name}` is {default}, which is refused: {told}"
            ));
        }
    }
    found
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

/// Whether the schema allows a value.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Allowed {
    Yes,
    No,
    /// It does not say.
    Maybe,
}

/// Values to try.
fn probes(leaf: &Leaf) -> Vec<(Value, Allowed)> {
    let text = |text: String, allowed| (Value::String(text), allowed);
    match &leaf.sort {
        Sort::Duration => vec![
            text("-1s".to_owned(), Allowed::No),
            text("0s".to_owned(), Allowed::Maybe),
        ],
        Sort::Quantity => {
            let unit = leaf.value.as_str().and_then(|text| text.split_once(' '));
            let unit = unit.map_or("nm", |(_, unit)| unit);
            vec![
                text(format!("nan {unit}"), Allowed::No),
                text(format!("inf {unit}"), Allowed::No),
                text("1 cd".to_owned(), Allowed::No),
                text("1".to_owned(), Allowed::No),
                text(format!("0 {unit}"), Allowed::Maybe),
            ]
        }
        Sort::Number { integer, low, high } => numbers(*integer, *low, *high),
        // What one of them needs beside it is for a case to say.
        Sort::Choice(choices) => choices
            .iter()
            .filter(|choice| **choice != leaf.value)
            .filter_map(|choice| Some((crate::node::as_toml(choice)?, Allowed::Maybe)))
            .collect(),
    }
}

fn numbers(integer: bool, low: Bound, high: Bound) -> Vec<(Value, Allowed)> {
    let number = |value: f64| {
        if integer {
            Value::Integer(value as i64)
        } else {
            Value::Float(value)
        }
    };
    let mut probes = Vec::new();
    match low {
        Bound::Inclusive(low) => probes.extend([
            (number(low), Allowed::Yes),
            (number(low - 1.0), Allowed::No),
        ]),
        Bound::Exclusive(low) => {
            probes.extend([(number(low), Allowed::No), (number(low - 1.0), Allowed::No)])
        }
        Bound::None => probes.extend([-1e6, -1.0, 0.0].map(|value| (number(value), Allowed::Yes))),
    }
    match high {
        Bound::Inclusive(high) => probes.extend([
            (number(high), Allowed::Yes),
            (number(high + 1.0), Allowed::No),
        ]),
        Bound::Exclusive(high) => probes.extend([
            (number(high), Allowed::No),
            (number(high + 1.0), Allowed::No),
        ]),
        // A count may stand for room that nobody has.
        Bound::None if integer => {}
        Bound::None => probes.push((number(1e6), Allowed::Yes)),
    }
    if !integer {
        let none = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        probes.extend(none.map(|value| (number(value), Allowed::No)));
    }
    probes
}

/// The parameters with defaults filled in, as the specification has them, and what the framework reads beside them.
fn in_full(subject: &Subject<'_>, fixture: &Fixture) -> toml::Table {
    let mut table = subject.parameters.clone();
    let elsewhere = subject.kind.framework_keys();
    table.retain(|key, _| elsewhere.contains(&key));
    let own = fixture.plan.nodes[0].spec.parameters();
    if let Some(Value::Table(own)) = crate::node::as_toml(&own) {
        table.extend(own);
    }
    table
}

/// Puts a value in its place; whether there is one.
fn set(table: &mut toml::Table, path: &[String], value: Value) -> bool {
    let Some((last, way)) = path.split_last() else {
        return false;
    };
    let Some((first, way)) = way.split_first() else {
        table.insert(last.clone(), value);
        return true;
    };
    let mut place = table.get_mut(first);
    for part in way {
        place = place.and_then(|place| step(place, part));
    }
    match place {
        Some(Value::Table(table)) => {
            table.insert(last.clone(), value);
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
