//! A table of the tree into a Rust type, with every mistake reported at its place; which types there are is decided by their owners.
//!
//! Structs are strict: a key that the struct does not have is reported with the nearest that it has, `deny_unknown_fields` or not.
//! Serde buffers internally tagged and untagged enums, so that strictness and places end at them: give such an enum
//! `#[serde(deny_unknown_fields)]`. A mistake inside is shown at the value that it names where only one place fits, else at the enum's table.

mod error;
mod left_out;
mod repair;
mod tree;

use std::cell::RefCell;

use serde::de::DeserializeOwned;

use super::tree::Value;
use crate::diagnostic::Diagnostics;
use error::{DecodeError, Mistake, Step};
pub use left_out::{Decoded, LeftOut};
use repair::Repair;
use tree::{Place, TreeDeserializer};

/// Reads `value` as a `T`, or reports *all* mistakes in it and gives `None`. `what` names the value in the texts, e.g. `node "thermal"`.
///
/// After a mistake the key at fault is taken out and the rest is read again, until what is left would only follow from mistakes told already.
pub fn decode<T: DeserializeOwned>(
    value: &Value,
    what: &str,
    diagnostics: &mut Diagnostics,
) -> Option<T> {
    decode_part(value, what, diagnostics)?.whole()
}

/// As [`decode`], with what could be read beside mistakes.
pub fn decode_part<T: DeserializeOwned>(
    value: &Value,
    what: &str,
    diagnostics: &mut Diagnostics,
) -> Option<Decoded<T>> {
    decode_rest(value, what, &[], &|_| None, diagnostics)
}

/// What to write under a key of the table that is decoded, where the table's owner knows it.
pub type Advice<'a> = &'a dyn Fn(Wanted<'_>) -> Option<String>;

/// What advice is wanted on.
#[derive(Debug, Clone, Copy)]
pub enum Wanted<'a> {
    /// A key that is missing.
    Key(&'a str),
    /// A key under which something else stands in the place of a table.
    TableOf(&'a str),
    /// The keys to a number that lacks a unit.
    Quantity(&'a [&'a str]),
}

/// As [`decode`], with keys of the table that are read elsewhere and may be meant by an unknown one, with what to write where one of
/// its own is missing or no table, and with what could be read beside mistakes.
pub fn decode_rest<T: DeserializeOwned>(
    value: &Value,
    what: &str,
    elsewhere: &[&str],
    advice: Advice<'_>,
    diagnostics: &mut Diagnostics,
) -> Option<Decoded<T>> {
    let last = RefCell::new(None);
    let read = |tree: &Value| {
        let (result, unknown) = attempt::<T>(tree);
        let (read, mistake) = match result {
            Ok(read) => (Some(read), None),
            Err(error) => (None, Some(error.into_mistake(value.place))),
        };
        last.replace(read);
        (mistake, unknown)
    };
    let (others, left_out) = mend(value, what, elsewhere, advice, &read, diagnostics)?;
    let whole = last.take()?;
    let others = others.iter().filter_map(|tree| attempt::<T>(tree).0.ok());
    Some(Decoded::of(whole, others.collect(), left_out))
}

/// Reads a tree as some type: the first mistake, where there is one, and the unknown keys that were passed over.
type Read<'a> = &'a dyn Fn(&Value) -> (Option<Mistake>, Vec<Mistake>);

/// Reports all mistakes until what is left can be read, which is the last that was: other trees that may be meant as well, and
/// what was left out. It does not know the type, so that there is one of it for all.
fn mend(
    value: &Value,
    what: &str,
    elsewhere: &[&str],
    advice: Advice<'_>,
    read: Read<'_>,
    diagnostics: &mut Diagnostics,
) -> Option<(Vec<Value>, LeftOut)> {
    let mut repair: Option<Repair> = None;
    let mut strange: Vec<Mistake> = Vec::new();
    let first = |tree: &Value| read(tree).0;
    // Each turn takes at least one value out of the tree; the limit only bounds the time that a hopeless file takes.
    for _ in 0..200 {
        let (mistake, unknown) = read(repair.as_ref().map_or(value, Repair::tree));
        if !unknown.is_empty() {
            let repair = repair.get_or_insert_with(|| Repair::of(value));
            for mistake in unknown {
                repair.take_out(&mistake.path);
                let mistake = mistake.beside(elsewhere);
                mistake.clone().report(what, diagnostics);
                strange.push(mistake);
            }
        }
        let Some(mut mistake) = mistake else {
            let meant = strange.iter().filter_map(Mistake::meant);
            let touched = repair.as_ref().map_or(&[][..], Repair::touched);
            let left_out = LeftOut::of(touched.iter().cloned().chain(meant));
            let others = repair.iter().flat_map(Repair::others);
            return Some((others.collect(), left_out));
        };
        let repair = repair.get_or_insert_with(|| Repair::of(value));
        repair.place_missing_key(&mut mistake, first);
        let is_misspelt = strange.iter().any(|given| given.is_meant_for(&mistake));
        if !repair.explains(&mistake) && !is_misspelt {
            let told = mistake.clone().advised(advice).beside(elsewhere);
            told.report(what, diagnostics);
        }
        let goes_on = match mistake.missing_key() {
            Some(key) => {
                let stands_in = |tree: &Value| {
                    let Some(next) = first(tree) else {
                        return true;
                    };
                    let at_key = next.path.len() > mistake.path.len()
                        && next.path.starts_with(&mistake.path)
                        && next.path[mistake.path.len()].is_key(key);
                    let still_missing =
                        next.path == mistake.path && next.missing_key() == Some(key);
                    !at_key && !still_missing
                };
                repair.put_in(&mistake.path, key, stands_in)
                    || repair.choose(&mistake.path, key, word(value, &mistake.path, key), first)
                    || repair.take_out(&mistake.path)
            }
            None => repair.take_out(&mistake.path),
        };
        if !goes_on {
            return None;
        }
    }
    None
}

/// The text that the user wrote under a key, where the way to it is by keys alone.
fn word<'a>(value: &'a Value, path: &[Step], key: &str) -> Option<&'a str> {
    let table = path.iter().try_fold(value, |value, step| match step {
        Step::Key(key) => value.as_table()?.get(key),
        Step::Index(_) => None,
    })?;
    table.as_table()?.get(key)?.as_text()
}

/// One reading: the result, and the unknown keys that were passed over.
fn attempt<T: DeserializeOwned>(value: &Value) -> (Result<T, DecodeError>, Vec<Mistake>) {
    let unknown = RefCell::new(Vec::new());
    let result = T::deserialize(TreeDeserializer {
        value,
        place: Place {
            above: None,
            step: None,
        },
        unknown: &unknown,
    });
    (result, unknown.into_inner())
}

#[cfg(test)]
mod tests;
