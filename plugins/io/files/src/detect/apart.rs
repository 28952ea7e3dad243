//! Which columns of several files no graph can read: a column stands in one log, and in each file of it. Not what they measure.

use std::collections::{BTreeMap, BTreeSet};

/// The columns of files that are left out, each with the reason; a file is its name and its columns, those of the time aside.
///
/// Files are of one log if they have more than half of the columns of one of them in common.
#[must_use]
pub fn apart(files: &[(String, Vec<String>)], times: &[String]) -> BTreeMap<String, String> {
    let named = |of: &&String| !of.is_empty() && !times.contains(of);
    let sets = files
        .iter()
        .map(|(_, columns)| columns.iter().filter(named).collect());
    let sets: Vec<BTreeSet<&String>> = sets.collect();
    let is_one = |one: &BTreeSet<_>, other: &BTreeSet<_>| {
        2 * one.intersection(other).count() > one.len().min(other.len())
    };
    // For each file the first of its log.
    let first = |file: &BTreeSet<_>| sets.iter().position(|of| is_one(of, file));
    let logs: Vec<Option<usize>> = sets.iter().map(first).collect();
    let why = |column: &String| {
        let all = 0..files.len();
        let (with, without): (Vec<usize>, Vec<usize>) =
            all.partition(|of| sets[*of].contains(column));
        let log = logs[with[0]];
        let name = |of: &usize| &files[*of].0;
        if let Some(other) = with.iter().find(|of| logs[**of] != log) {
            let (one, other) = (name(&with[0]), name(other));
            return Some(format!(
                "it stands in {one} and in {other}, which are two logs; rename it in one"
            ));
        }
        let lacks = name(without.iter().find(|of| logs[**of] == log)?);
        let other = name(&with[0]);
        Some(format!(
            "it is not in {lacks}, which is of one log with {other}"
        ))
    };
    let columns: BTreeSet<&String> = sets.iter().flatten().copied().collect();
    let left_out = columns.into_iter().map(|of| Some((of.clone(), why(of)?)));
    left_out.flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_read_that_stands_in_each_file_of_one_log() {
        let file = |name: &str, columns: &str| {
            let columns = columns.split(' ').map(str::to_owned);
            (name.to_owned(), columns.collect::<Vec<_>>())
        };
        let left_out = |files: &[(String, Vec<String>)]| {
            let apart = apart(files, &["t".to_owned()]);
            let apart = apart
                .into_iter()
                .map(|(name, why)| format!("{name}: {why}"));
            apart.collect::<Vec<_>>()
        };
        let one = file("one", "t battery plate room");
        assert!(left_out(std::slice::from_ref(&one)).is_empty());
        assert!(left_out(&[one.clone(), file("two", "t Z")]).is_empty());
        assert!(left_out(&[one.clone(), file("two", "t room plate battery")]).is_empty());
        assert_eq!(
            left_out(&[one.clone(), file("two", "t battery Z")]),
            ["battery: it stands in one and in two, which are two logs; rename it in one"]
        );
        assert_eq!(
            left_out(&[one, file("two", "t Z"), file("three", "t plate room")]),
            ["battery: it is not in three, which is of one log with one"]
        );
    }
}
