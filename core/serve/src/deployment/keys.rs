//! Keys of a table that this crate reads itself, by their types, with the ranges that their schema states.

use schemars::JsonSchema;
use serde::de::DeserializeOwned;

use super::problem::{DoubtfulParameter, UnfitParameter};
use crate::connector::ParameterRemark;
use crate::diagnostic::{Diagnostics, Place};
use crate::document::problem::Refused;
use crate::document::{Data, Table, Value, decode};
use crate::node::out_of_range;

/// Reads a table as a type; nothing where there are mistakes, all of which are reported.
pub(crate) fn read<T: DeserializeOwned + JsonSchema>(
    table: &Value,
    what: &str,
    diagnostics: &mut Diagnostics,
) -> Option<T> {
    let read = decode(table, what, diagnostics)?;
    let schema = schemars::schema_for!(T).into();
    is_in_range(&schema, table, diagnostics).then_some(read)
}

/// Whether all values are within the ranges of a schema. Those that are not are reported.
pub(super) fn is_in_range(
    schema: &serde_json::Value,
    table: &Value,
    diagnostics: &mut Diagnostics,
) -> bool {
    let wrong = out_of_range(schema, table);
    let is_fine = wrong.is_empty();
    for (place, reason) in wrong {
        diagnostics.report(place, Refused { key: None, reason });
    }
    is_fine
}

/// A table in two: these keys, and all others.
pub(super) fn split(table: &Value, keys: &[&str]) -> (Value, Value) {
    let entries = table.as_table().into_iter().flat_map(Table::iter);
    let entries = entries.map(|(key, entry)| (key.to_owned(), entry.clone()));
    let (own, others) = entries.partition(|(key, _)| keys.contains(&key.as_str()));
    [own, others]
        .map(|part: Vec<_>| Value::new(table.place, Data::Table(part.into_iter().collect())))
        .into()
}

/// What stands at the end of a path of keys and numbers in a table, its place, and the table or list that it stands in; the place of
/// the last part that is there, where not all are.
pub(super) fn find<'a>(table: &'a Value, at: &[String]) -> (Option<&'a Value>, Place, &'a Value) {
    let (mut around, mut value) = (table, Some(table));
    for step in at {
        let Some(of) = value else { break };
        around = of;
        value = match of.as_list() {
            Some(list) => step.parse().ok().and_then(|nth: usize| list.get(nth)),
            None => of.as_table().and_then(|table| table.get(step)),
        };
    }
    (value, value.map_or(around.place, |of| of.place), around)
}

/// Reports what a source or sink says of its parameters.
pub(super) fn report(remarks: Vec<ParameterRemark>, table: &Value, diagnostics: &mut Diagnostics) {
    for remark in remarks {
        let (_, place, _) = find(table, &remark.at);
        report_at(place, Some(remark), diagnostics);
    }
}

/// Reports one at a place.
pub(super) fn report_at(
    place: Place,
    remark: Option<ParameterRemark>,
    diagnostics: &mut Diagnostics,
) {
    if let Some(remark) = remark {
        let (words, advice) = (remark.words, remark.help);
        match remark.is_mistake {
            true => diagnostics.report(place, UnfitParameter { words, advice }),
            false => diagnostics.report(place, DoubtfulParameter { words, advice }),
        }
    }
}
