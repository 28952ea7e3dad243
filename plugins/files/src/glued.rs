//! Whether the names of the columns stand in a line behind the beginning of a row, as where a logger was restarted in the middle of
//! one. Not what becomes of the columns.

use crate::columns::names_in;
use crate::lines::MARK;

/// How many bytes by how many names are compared. A wider log waits for a line of names of its own.
const COMPARED: usize = 10_000_000;

/// The names that stand behind the beginning of a row: all that are known, in whatever order, up to the end of the line.
pub(crate) fn names_behind(line: &[u8], delimiter: u8, known: &[String]) -> Option<Vec<String>> {
    let quoted = |byte: &u8| byte.is_ascii_whitespace() || *byte == b'"';
    let end = line.iter().rposition(|byte| !quoted(byte))? + 1;
    let named = || known.iter().filter(|name| !name.is_empty());
    // Most lines that cannot be used end in no name, and are seen to without anything being set up.
    if known.len() < 2 || !named().any(|name| line[..end].ends_with(name.as_bytes())) {
        return None;
    }
    if known.len().saturating_mul(line.len()) > COMPARED {
        return None;
    }
    let has_unnamed = known.iter().any(String::is_empty);
    let mut sorted = known.to_vec();
    sorted.sort_unstable();
    for name in named() {
        let name = name.as_bytes();
        let places = line.windows(name.len()).enumerate().skip(1);
        for (at, _) in places.filter(|(_, of)| *of == name) {
            let at = at - usize::from(line[at - 1] == b'"');
            if !ends_in_value(&line[..at], delimiter) {
                continue;
            }
            let names = names_in(&line[at..], delimiter);
            if has_unnamed {
                // Where a column without a name stands, only the order that is known tells.
                if names.iter().filter(|name| !name.is_empty()).eq(named()) {
                    return Some(known.to_vec());
                }
                continue;
            }
            let mut found = names.clone();
            found.sort_unstable();
            if found == sorted {
                return Some(names);
            }
        }
    }
    None
}

/// Takes the beginning of a row from before the name of the time, which is the first of these.
pub(crate) fn bare_time(names: &mut [String], time: &[String], delimiter: u8) {
    let Some(first) = names.first_mut() else {
        return;
    };
    let glued = time.iter().find(|time| {
        let before = first.strip_suffix(time.as_str());
        before
            .is_some_and(|before| !before.is_empty() && ends_in_value(before.as_bytes(), delimiter))
    });
    if let Some(time) = glued {
        first.clone_from(time);
    }
}

/// Whether what stands before names is of a row: its last cell, or what there is of it, is no part of a name.
fn ends_in_value(before: &[u8], delimiter: u8) -> bool {
    let before = before.strip_suffix(MARK).unwrap_or(before);
    let begun = before.strip_suffix(&[delimiter]).unwrap_or(before);
    let cell = begun.rsplit(|&byte| byte == delimiter).next();
    let cell = cell.unwrap_or_default().trim_ascii();
    let cell = cell.strip_prefix(b"\"").unwrap_or(cell);
    let is_of_number = |byte: &u8| byte.is_ascii_digit() || b"+-.,: ".contains(byte);
    let is_within = |byte: &u8| is_of_number(byte) || matches!(byte, b'T' | b'e' | b'E');
    match cell {
        [] => !before.is_empty(),
        [first, .., last] => {
            is_of_number(first) && cell.iter().all(is_within) && is_of_number(last)
        }
        [only] => is_of_number(only),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_behind_what_a_row_begins_with_and_nowhere_else() {
        let known = ["time", "a", "b"].map(str::to_owned);
        let found = |line: &str| {
            let names = names_behind(line.as_bytes(), b',', &known)?;
            Some(names.join(" "))
        };
        for line in [
            "20,1time,b,a\n",
            "20time,b,a\r\n",
            "20,time,b,a",
            "20,1,time,b,a\n",
            "20,,time,b,a\n",
            "20,1\u{feff}time,b,a\n",
            "20,1\"time\",\"b\",\"a\"\n",
            "20,\"1time,b,a\n",
            "2026-10-25T02:00:time,b,a",
            "20,-1.5etime,b,a\n",
        ] {
            let expected = (!line.contains("etime")).then(|| "time b a".to_owned());
            assert_eq!(found(line), expected, "{line}");
        }
        assert_eq!(found("20,1a,time,b\n").unwrap(), "a time b");
        let index = ["", "time", "a"].map(str::to_owned);
        let found_beside = |line: &str| names_behind(line.as_bytes(), b',', &index);
        assert_eq!(found_beside("1,5,1,time,a\n").unwrap(), index);
        assert_eq!(found_beside("1,5,1,a,time\n"), None);
        for line in [
            "",
            "time,b,a\n",
            "20,1,2\n",
            "20,1,a\n",
            "20,1,b,a\n",
            "20,1time,b,a,c\n",
            "daytime,b,a\n",
            "20,1note,time,b,a\n",
            "20,1Z,time,b,a\n",
        ] {
            assert_eq!(found(line), None, "{line}");
        }
    }
}
