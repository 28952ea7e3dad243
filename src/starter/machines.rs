//! Decides whether logs are of several machines, or of several sensors under the same names; not how they are read.

use std::collections::{BTreeMap, BTreeSet};

use athermal::files::Description;

use super::Log;
use super::clock::Clock;
use super::texts::Texts;

/// Of a column with more values none is a machine.
const MOST_MACHINES: usize = 20;
/// Rows of a log of several machines stand beside each other in so many of the first.
const BESIDE: usize = 10;

/// Why a log is of several machines, whose rows stand side by side: a column of a few values, of each of which the times go on, while
/// those of all rows do not.
pub fn several(described: &Description, clock: &Clock) -> Option<String> {
    let texts = Texts::from(described, clock.columns.clone());
    let times = texts
        .by_row()
        .filter_map(|(row, text)| Some((row, clock.form.read(text.as_bytes())?)));
    let times: Vec<(usize, i64)> = times.collect();
    let stays = |times: &[i64]| times.windows(2).filter(|pair| pair[1] <= pair[0]).count();
    let all: Vec<i64> = times.iter().map(|(_, time)| *time).collect();
    if stays(&all) < BESIDE {
        return None;
    }
    let columns = described.columns.iter().enumerate();
    let mut columns = columns.filter(|(_, name)| !clock.columns.names().contains(name));
    columns.find_map(|(at, name)| {
        let mut of_each: BTreeMap<&str, Vec<i64>> = BTreeMap::new();
        for (row, time) in &times {
            of_each.entry(described.rows[*row].get(at)?.trim()).or_default().push(*time);
        }
        let is_such = (2..=MOST_MACHINES).contains(&of_each.len())
            && of_each.iter().all(|(value, times)| !value.is_empty() && times.len() > 1 && stays(times) == 0);
        let values: Vec<&str> = of_each.keys().copied().take(4).collect();
        is_such.then(|| {
            format!(
                "`{name}` has {} values ({}{}), and where it changes the time does not go on: rows of several machines stand side by side, \
                 and a graph is of one. Write the rows of each into a file of its own, start with one, and fit all with `athermal fleet`; \
                 sorted by `{name}`, they can be read as they are, as segments: `[table] segment = \"{name}\"`",
                of_each.len(),
                values.join(", "),
                if of_each.len() > values.len() { ", …" } else { "" },
            )
        })
    })
}

/// Why several logs are of one sensor each: they have the same columns, and the same times.
pub fn same_names(logs: &[Log]) -> Option<String> {
    let begins = |log: &Log| {
        let texts = Texts::from(&log.described, log.clock.columns.clone()).read();
        let times = texts
            .iter()
            .take(3)
            .map(|text| log.clock.form.read(text.as_bytes()));
        times
            .collect::<Option<Vec<i64>>>()
            .filter(|times| times.len() == 3)
    };
    let same = |one: &Log, other: &Log| {
        one.described.columns == other.described.columns
            && begins(one).is_some()
            && begins(one) == begins(other)
    };
    let first = logs
        .iter()
        .find(|log| logs.iter().filter(|other| same(log, other)).count() > 1)?;
    let alike: Vec<&Log> = logs.iter().filter(|other| same(first, other)).collect();
    let times: BTreeSet<&String> = first.clock.columns.names().iter().collect();
    let mut values = first.described.columns.iter().enumerate();
    let is_number = |at: usize| {
        first.described.rows.iter().any(|row| {
            row.get(at)
                .is_some_and(|cell| cell.trim().parse::<f64>().is_ok())
        })
    };
    let (_, value) = values.find(|(at, name)| !times.contains(name) && is_number(*at))?;
    let stem = |log: &&Log| {
        std::path::Path::new(&log.name)
            .file_stem()
            .map(|of| of.to_string_lossy().into_owned())
    };
    let names: Vec<String> = alike
        .iter()
        .filter_map(stem)
        .map(|stem| format!("`{stem}_degC`"))
        .collect();
    let files: Vec<&str> = alike.iter().map(|log| log.name.as_str()).collect();
    Some(format!(
        "{} have the same columns at the same times: they are several sensors, whose columns need names of their own. In the line of names \
         of each write another for `{value}`, such as {}, by what it measures and its unit",
        files.join(" and "),
        names.join(" and ")
    ))
}
