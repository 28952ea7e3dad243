//! Decides whether a model that was edited by hand is refused in words or runs.

use serde_json::{Value, json};

use super::super::compared::course;
use super::super::fixture::NODE;
use super::super::tried::tried;
use super::Subject;
use super::fitting::text_of;
use crate::model::Model;

/// What is written in place of a number that counts or points at something.
const MANY: u64 = 1 << 40;

pub(super) fn edited(subject: &Subject<'_>) -> Result<(), String> {
    if !subject.is_fitted() {
        return Ok(());
    }
    let text = text_of(subject, &subject.fitted)?;
    let model: Value = serde_json::from_str(&text).map_err(|error| error.to_string())?;
    let mut places = Vec::new();
    let at = format!("/fitted/{NODE}");
    find(&model["fitted"][NODE], &at, &mut places);
    for place in &places {
        let value = model.pointer(place).unwrap_or(&Value::Null);
        for (other, what) in edits(value).into_iter().filter(|edit| edit.0 != *value) {
            let mut edited = model.clone();
            if let Some(value) = edited.pointer_mut(place) {
                *value = other;
            }
            tried(|| runs(subject, &edited))
                .map_err(|found| format!("with {what} {place}, {found}"))?;
        }
    }
    // Lists whose lengths are held against each other are all empty only where none is forgotten.
    let mut hollow = model.clone();
    for place in &places {
        // Of lists within lists, the outer one is emptied first.
        if let Some(list) = hollow.pointer_mut(place).and_then(Value::as_array_mut) {
            list.clear();
        }
    }
    tried(|| runs(subject, &hollow)).map_err(|found| format!("with every list empty, {found}"))
}

/// What may have been done to a list, or to a number that counts.
fn edits(value: &Value) -> Vec<(Value, &'static str)> {
    let Value::Array(list) = value else {
        return vec![(json!(MANY), "a large number in place of")];
    };
    let more = list.last().cloned().unwrap_or_else(|| json!(1.0));
    let shorter = list.len().saturating_sub(1);
    vec![
        (json!(list[..shorter]), "the last dropped of"),
        (json!(list[list.len() - shorter..]), "the first dropped of"),
        (json!([]), "nothing left of"),
        (json!([&list[..], &[more]].concat()), "one more in"),
    ]
}

/// The places of lists and of numbers that count, as JSON pointers.
fn find(value: &Value, at: &str, places: &mut Vec<String>) {
    match value {
        Value::Array(list) => {
            places.push(at.to_owned());
            for (nth, value) in list.iter().enumerate() {
                find(value, &format!("{at}/{nth}"), places);
            }
        }
        Value::Object(table) => {
            for (key, value) in table {
                let key = key.replace('~', "~0").replace('/', "~1");
                find(value, &format!("{at}/{key}"), places);
            }
        }
        Value::Number(number) if number.is_u64() => places.push(at.to_owned()),
        _ => {}
    }
}

/// Reads a model and runs it, unless it is refused.
fn runs(subject: &Subject<'_>, model: &Value) -> Result<(), String> {
    let read = Model::from_text("model.json", model.to_string());
    let engine = read.and_then(|model| model.engine());
    let Ok(mut engine) = engine else {
        return Ok(());
    };
    let events = subject.events();
    course(
        &subject.fixture,
        &mut engine,
        &events[..subject.ticks() / 3],
    );
    Ok(())
}
