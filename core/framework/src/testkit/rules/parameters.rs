//! Decides whether parameters read back as they were written, and whether what the schema says of them is what is taken.

use serde_json::Value as Json;
use toml::Value;

use super::super::fixture::Fixture;
use super::Subject;
use super::schema::{Bound, Leaf, Sort, leaves};

pub(super) fn read_back(subject: &Subject<'_>) -> Result<(), String> {
    let before = subject.fixture.plan.nodes[0].spec.parameters();
    let table = in_full(subject);
    let fixture = Fixture::new(subject.kind, &table, &subject.given)
        .map_err(|error| format!("written out in full, the parameters are refused: {error}"))?;
    let after = fixture.plan.nodes[0].spec.parameters();
    if before == after {
        Ok(())
    } else {
        Err(format!("the parameters {before} are read back as {after}"))
    }
}

pub(super) fn ranges(subject: &Subject<'_>) -> Result<(), String> {
    let schema = Json::from((subject.kind.schema)());
    let parameters = subject.fixture.plan.nodes[0].spec.parameters();
    let mut found = Vec::new();
    for leaf in leaves(&schema, &parameters) {
        let name = leaf.path.join(".");
        let last = leaf
            .path
            .iter()
            .rfind(|part| part.parse::<usize>().is_err());
        let last = last.cloned().unwrap_or_default();
        for (value, allowed) in probes(&leaf) {
            let mut table = in_full(subject);
            if !set(&mut table, &leaf.path, value.clone()) {
                continue;
            }
            match (Fixture::new(subject.kind, &table, &subject.given), allowed) {
                (Ok(_), true) => {}
                (Ok(_), false) => found.push(format!("`{name} = {value}` is taken without a word")),
                (Err(told), true) if told.contains(&last) => found.push(format!(
                    "`{name} = {value}` is allowed by the schema, and refused: {told}"
                )),
                // Something else does not go together with it.
                (Err(_), true) => {}
                (Err(told), false) if told.contains(&last) => {}
                (Err(told), false) => found.push(format!(
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

/// Values to try, each with whether the schema allows it.
fn probes(leaf: &Leaf) -> Vec<(Value, bool)> {
    match leaf.sort {
        Sort::Duration => vec![(Value::String("-1s".to_owned()), false)],
        Sort::Quantity => {
            let unit = leaf.value.as_str().and_then(|text| text.split_once(' '));
            let unit = unit.map_or("nm", |(_, unit)| unit);
            ["nan", "inf"]
                .map(|number| format!("{number} {unit}"))
                .into_iter()
                .chain(["1 cd".to_owned(), "1".to_owned()])
                .map(|text| (Value::String(text), false))
                .collect()
        }
        Sort::Number { integer, low, high } => numbers(integer, low, high),
    }
}

fn numbers(integer: bool, low: Bound, high: Bound) -> Vec<(Value, bool)> {
    let number = |value: f64| {
        if integer {
            Value::Integer(value as i64)
        } else {
            Value::Float(value)
        }
    };
    let mut probes = Vec::new();
    match low {
        Bound::Inclusive(low) => probes.extend([(number(low), true), (number(low - 1.0), false)]),
        Bound::Exclusive(low) => probes.extend([(number(low), false), (number(low - 1.0), false)]),
        Bound::None => probes.extend([-1e6, -1.0, 0.0].map(|value| (number(value), true))),
    }
    match high {
        Bound::Inclusive(high) => {
            probes.extend([(number(high), true), (number(high + 1.0), false)])
        }
        Bound::Exclusive(high) => {
            probes.extend([(number(high), false), (number(high + 1.0), false)])
        }
        // A count may stand for room that nobody has.
        Bound::None if integer => {}
        Bound::None => probes.push((number(1e6), true)),
    }
    if !integer {
        let none = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        probes.extend(none.map(|value| (number(value), false)));
    }
    probes
}

/// The parameters with defaults filled in, and what the framework reads beside them.
fn in_full(subject: &Subject<'_>) -> toml::Table {
    let mut table = subject.parameters.clone();
    if let Some(Value::Table(own)) =
        crate::node::as_toml(&subject.fixture.plan.nodes[0].spec.parameters())
    {
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
