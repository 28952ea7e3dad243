//! How many there are of something, in words.

use std::fmt::Display;

/// A count with separators between thousands.
#[must_use]
pub fn count(value: impl Display) -> String {
    let mut text = value.to_string();
    let whole = text.find('.').unwrap_or(text.len());
    let sign = usize::from(text.starts_with('-'));
    for at in (sign + 1..whole)
        .rev()
        .filter(|at| (whole - at).is_multiple_of(3))
    {
        text.insert(at, ',');
    }
    text
}

/// How many there are of something, which is named as one of them: `1 row`, `8,028 rows`, `0.5 days`.
#[must_use]
pub fn counted<N: Display + PartialEq + From<u8>>(value: N, what: &str) -> String {
    let plural = if value == N::from(1) { "" } else { "s" };
    format!("{} {what}{plural}", count(value))
}

/// Several by their names, the first few of many: `a, b, c`, or `a, b and 3,000 more`.
#[must_use]
pub fn listed(all: impl IntoIterator<Item = impl Display>, most: usize) -> String {
    let mut all = all.into_iter();
    let shown: Vec<_> = all.by_ref().take(most).map(|one| one.to_string()).collect();
    match all.count() {
        0 => shown.join(", "),
        more => format!("{} and {} more", shown.join(", "), count(more)),
    }
}

/// Names of a graph in a sentence, the first twelve of many: `` `a`, `b` ``; `nothing` where there is none.
pub fn names(known: impl IntoIterator<Item: AsRef<str>>) -> String {
    let quoted = known.into_iter().map(|name| format!("`{}`", name.as_ref()));
    let names = listed(quoted, 12);
    if names.is_empty() {
        "nothing".to_owned()
    } else {
        names
    }
}

#[cfg(test)]
mod tests {
    use super::{count, counted, listed};

    #[test]
    fn counts_have_separators() {
        let texts = [1_u64, 123, 1234, 123_456, 1_234_567].map(count);
        assert_eq!(texts, ["1", "123", "1,234", "123,456", "1,234,567"]);
        assert_eq!([-123, -1234].map(count), ["-123", "-1,234"]);
        assert_eq!([0.5, 1234.5678].map(count), ["0.5", "1,234.5678"]);
    }

    #[test]
    fn of_one_there_is_no_plural() {
        let texts = [0_u64, 1, 2, 1234].map(|value| counted(value, "row"));
        assert_eq!(texts, ["0 rows", "1 row", "2 rows", "1,234 rows"]);
        let texts = [0.5, 1.0].map(|value| counted(value, "day"));
        assert_eq!(texts, ["0.5 days", "1 day"]);
    }

    #[test]
    fn of_many_names_the_first_few_are_told() {
        assert_eq!(listed(["a", "b", "c"], 3), "a, b, c");
        assert_eq!(listed(["a", "b", "c"], 2), "a, b and 1 more");
        assert_eq!(listed(0..2000, 1), "0 and 1,999 more");
        assert_eq!(listed([""; 0], 3), "");
    }
}
