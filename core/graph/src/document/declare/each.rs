//! `each`: which members a node or an instance of a module has, and whether there is room for them.

use super::reading::one_or_more;
use super::sets::Sets;
use crate::diagnostic::Diagnostics;
use crate::document::problem;
use crate::document::tree::{Data, Entry, Table, Value};

/// The most instances that a graph may have.
pub(super) const MOST_INSTANCES: usize = 200_000;
/// The most values in all instances; about 100 bytes each.
pub(super) const MOST_VALUES: usize = 4_000_000;

/// What all instances made so far take.
#[derive(Default)]
pub(super) struct Total {
    instances: usize,
    values: usize,
}

/// Placeholders and the members that they stand for.
pub(super) type Each<'a> = Vec<(String, &'a [String])>;

/// What a node's own `each` names.
pub(super) struct OwnEach<'a> {
    /// The sets with their members, as far as they are known.
    pub(super) sets: Each<'a>,
    /// Whether all members are known.
    pub(super) sound: bool,
    /// Whether the names are those of sets, if not of sound ones.
    pub(super) known: bool,
}

/// Reads `each`.
pub(super) fn own_each<'a>(
    keys: &Table,
    sets: &'a Sets,
    diagnostics: &mut Diagnostics,
) -> OwnEach<'a> {
    let mut own = OwnEach {
        sets: Vec::new(),
        sound: true,
        known: true,
    };
    let Some(value) = keys.get("each") else {
        return own;
    };
    let before = diagnostics.reported();
    let names = one_or_more(value, "each", "`each`", diagnostics).unwrap_or_default();
    for (name, place) in names {
        let members = sets.find(&name, place, diagnostics);
        own.sound &= members.is_some();
        if own.sets.iter().any(|(taken, _)| *taken == name) {
            let problem = problem::DuplicateName {
                role: "set",
                name,
                first_role: "set",
                first: None,
            };
            diagnostics.report(place, problem);
        } else {
            own.sets.push((name, members.unwrap_or_default()));
        }
    }
    own.known = diagnostics.reported() == before;
    own.sound &= own.known;
    own
}

/// One member of the product of all sets of `each`.
pub(super) struct Member<'a> {
    pub(super) name: String,
    pub(super) pairs: Vec<(&'a str, &'a str)>,
}

/// The members of a node, the first set slowest, if the graph has room for an instance of each.
pub(super) fn room_for<'a>(
    name: &str,
    entry: &Entry,
    each: &'a Each<'_>,
    parameters: &Value,
    inputs: usize,
    total: &mut Total,
    diagnostics: &mut Diagnostics,
) -> Option<Vec<Member<'a>>> {
    let count = each
        .iter()
        .try_fold(1usize, |product, (_, members)| {
            product.checked_mul(members.len())
        })
        .unwrap_or(usize::MAX);
    let instances = total.instances.saturating_add(count);
    if instances > MOST_INSTANCES {
        let problem = problem::TooManyInstances {
            node: name.to_owned(),
            instances,
            limit: MOST_INSTANCES,
        };
        diagnostics.report(entry.key, problem);
        return None;
    }
    let values = total
        .values
        .saturating_add(count.saturating_mul(weight(parameters) + weight(&entry.value) + inputs));
    if values > MOST_VALUES {
        diagnostics.report(
            entry.key,
            problem::TooLargeExpanded {
                node: name.to_owned(),
                limit: MOST_VALUES,
            },
        );
        return None;
    }
    (total.instances, total.values) = (instances, values);
    let mut members = vec![Member {
        name: String::new(),
        pairs: Vec::new(),
    }];
    for (set, names) in each {
        members = members
            .iter()
            .flat_map(|member| {
                names.iter().map(|name| Member {
                    name: if member.name.is_empty() {
                        name.clone()
                    } else {
                        format!("{}-{name}", member.name)
                    },
                    pairs: member
                        .pairs
                        .iter()
                        .copied()
                        .chain([(set.as_str(), name.as_str())])
                        .collect(),
                })
            })
            .collect();
    }
    let mut seen = std::collections::HashSet::new();
    if let Some(twice) = members
        .iter()
        .find(|member| !seen.insert(member.name.as_str()))
    {
        // "1" and "1-2" times "2-3" and "3" both make "1-2-3".
        let (role, name) = ("member", twice.name.clone());
        diagnostics.report(
            entry.key,
            problem::DuplicateName {
                role,
                name,
                first_role: role,
                first: None,
            },
        );
        return None;
    }
    Some(members)
}

/// Number of values in a tree, long texts counted as several.
pub(super) fn weight(value: &Value) -> usize {
    match &value.data {
        Data::Text(text) | Data::Time(text) => 1 + text.len() / 64,
        Data::List(values) => 1 + values.iter().map(weight).sum::<usize>(),
        Data::Table(table) => {
            1 + table
                .iter()
                .map(|(key, entry)| key.len() / 64 + weight(&entry.value))
                .sum::<usize>()
        }
        Data::Integer(_) | Data::Float(_) | Data::Bool(_) => 1,
    }
}
