//! Decides which columns make up one signal of a graph, and how its channels are named; not what they measure.

use std::collections::BTreeSet;

use super::column::{Column, Kind};
use super::name::unit_in_brackets;

/// Columns of one kind and unit that make up a signal.
#[derive(Debug, PartialEq, Eq)]
pub struct Group {
    /// The name of the signal.
    pub signal: String,
    /// Its unit.
    pub unit: String,
    /// How the columns are named after the channels.
    pub pattern: String,
    /// The names of the channels.
    pub channels: Vec<String>,
    /// Which columns they are, by number.
    pub columns: Vec<usize>,
}

/// The signals of a kind; no two of their channels have the same name.
#[must_use]
pub fn groups(columns: &[Column], kind: Kind, signal: &str) -> Vec<Group> {
    let mut units: Vec<(&str, Vec<usize>)> = Vec::new();
    for (index, column) in columns.iter().enumerate() {
        if column.kind != kind {
            continue;
        }
        match units.iter_mut().find(|(unit, _)| *unit == column.unit) {
            Some((_, members)) => members.push(index),
            None => units.push((&column.unit, vec![index])),
        }
    }
    let mut groups: Vec<Group> = Vec::new();
    let mut taken = BTreeSet::new();
    for (unit, members) in units {
        let names: Vec<&str> = members.iter().map(|&i| columns[i].name.as_str()).collect();
        let is_new = |channels: &[String]| channels.iter().all(|name| !taken.contains(name));
        let shared = pattern(&names).filter(|(_, channels)| is_new(channels));
        let parts = match shared {
            Some((pattern, channels)) => vec![(pattern, channels, members)],
            // A signal of its own for each column, since only then may the column have any name.
            None => {
                let single = |(&index, name): (&usize, &&str)| {
                    let channel = free(&channel_name(name), &taken);
                    taken.insert(channel.clone());
                    ((*name).to_owned(), vec![channel], vec![index])
                };
                members.iter().zip(&names).map(single).collect()
            }
        };
        for (pattern, channels, columns) in parts {
            taken.extend(channels.iter().cloned());
            let number = groups.len() + 1;
            groups.push(Group {
                signal: if number == 1 {
                    signal.to_owned()
                } else {
                    format!("{signal}-{number}")
                },
                unit: unit.to_owned(),
                pattern,
                channels,
                columns,
            });
        }
    }
    groups
}

/// What names have in common before and after, with `{channel}` in between, and what differs; none where that gives no names of channels.
fn pattern(names: &[&str]) -> Option<(String, Vec<String>)> {
    let first = names.first()?;
    let shared = |other: &&str| {
        let same = first.chars().zip(other.chars()).take_while(|(a, b)| a == b);
        same.map(|(a, _)| a.len_utf8()).sum::<usize>()
    };
    let shared_end = |other: &&str| {
        let pairs = first.chars().rev().zip(other.chars().rev());
        let same = pairs.take_while(|(a, b)| a == b);
        same.map(|(a, _)| a.len_utf8()).sum::<usize>()
    };
    let boundary = |c: char| !c.is_alphanumeric();
    // Of one name alone, a unit at its end and a `t_` at its start are no part of the channel's name.
    let (before, after) = if names.len() == 1 {
        let start = ["t_", "T_", "temp_", "pos_"];
        let start = start.iter().find(|start| first.starts_with(**start));
        let end = first
            .rfind('_')
            .filter(|&at| at > start.map_or(0, |s| s.len()));
        (
            start.map_or(0, |start| start.len()),
            end.map_or(0, |at| first.len() - at),
        )
    } else {
        let before = names.iter().map(shared).min()?;
        let before = first[..before].rfind(boundary).map_or(0, |at| {
            at + first[at..].chars().next().map_or(0, char::len_utf8)
        });
        let after = names.iter().map(shared_end).min()?;
        let after = first[first.len() - after..]
            .find(boundary)
            .map_or(0, |at| after - at);
        (before, after)
    };
    let middle = |name: &&str| {
        name.get(before..name.len().checked_sub(after)?)
            .map(str::to_owned)
    };
    let channels: Option<Vec<String>> = names.iter().map(middle).collect();
    let channels = channels.filter(|channels| channels.iter().all(|name| is_name(name)));
    if let Some(channels) = channels {
        let end = &first[first.len() - after..];
        return Some((format!("{}{{channel}}{end}", &first[..before]), channels));
    }
    names.iter().all(|name| is_name(name)).then(|| {
        (
            "{channel}".to_owned(),
            names.iter().map(|&name| name.to_owned()).collect(),
        )
    })
}

fn is_name(name: &str) -> bool {
    name.starts_with(char::is_alphanumeric)
        && name
            .chars()
            .all(|c| c.is_alphanumeric() || c == '_' || c == '-')
}

/// The name, or the first after it with a number that is not taken.
fn free(name: &str, taken: &BTreeSet<String>) -> String {
    let numbered = (2..).map(|number| format!("{name}-{number}"));
    let mut names = std::iter::once(name.to_owned()).chain(numbered);
    let free = names.find(|name| !taken.contains(name));
    free.unwrap_or_default()
}

/// A name for a channel whose column has one that no channel can have, without a unit in brackets at its end.
fn channel_name(column: &str) -> String {
    let column = column.trim();
    let bracketed = |open, close| column.strip_suffix(close)?.rsplit_once(open);
    let of_unit = [("[", "]"), ("(", ")")]
        .into_iter()
        .find_map(|(open, close)| {
            let (before, unit) = bracketed(open, close)?;
            unit_in_brackets(open, unit).map(|_| before)
        });
    let mut name = String::new();
    for c in of_unit.unwrap_or(column).chars() {
        if c.is_alphanumeric() {
            name.push(c);
        } else if !name.is_empty() && !name.ends_with('-') {
            name.push('-');
        }
    }
    let name = name.trim_end_matches('-');
    if name.is_empty() { "value" } else { name }.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(names: &[&str]) -> Option<(String, String)> {
        pattern(names).map(|(pattern, channels)| (pattern, channels.join(" ")))
    }

    #[test]
    fn channels_are_what_differs_between_columns() {
        for (names, pattern, channels) in [
            (
                &["plate1_degC", "room_degC"][..],
                "{channel}_degC",
                "plate1 room",
            ),
            (
                &["t_bed_degC", "t_chamber_degC"],
                "t_{channel}_degC",
                "bed chamber",
            ),
            (&["t1_degC", "t2_degC"], "{channel}_degC", "t1 t2"),
            (&["z_mm"], "{channel}_mm", "z"),
            (&["t_plate_degC"], "t_{channel}_degC", "plate"),
            (&["room", "chuck"], "{channel}", "room chuck"),
            (&["X", "X2"], "{channel}", "X X2"),
        ] {
            let expected = Some((pattern.to_owned(), channels.to_owned()));
            assert_eq!(named(names), expected, "{names:?}");
        }
    }

    #[test]
    fn columns_that_no_channel_can_be_named_after_stand_alone() {
        assert_eq!(named(&["Plate 1 [°C]", "Room air"]), None);
        for (column, channel) in [
            ("Plate 1 [°C]", "Plate-1"),
            ("Z (µm) ", "Z"),
            ("Plate [1]", "Plate-1"),
            ("[°C]", "value"),
            ("Speed [1/min]", "Speed"),
            ("x [steps]", "x"),
        ] {
            assert_eq!(channel_name(column), channel);
        }
    }
}
