//! Which columns hold the time of a row, and what stands around their cells: `Time`, or `{Date} {Time}`. Not how that text is read.

use std::fmt;
use std::str::FromStr;

/// The columns of the time, one or several whose cells are put together.
///
/// ```
/// use athermal_graph::time::TimeColumns;
///
/// let columns: TimeColumns = "{Date} {Time}".parse().unwrap();
/// assert_eq!(columns.names(), ["Date", "Time"]);
/// let mut text = Vec::new();
/// columns.join(&mut text, |column| [b"01.03.2026", &b"08:00:10"[..]][column]);
/// assert_eq!(text, b"01.03.2026 08:00:10");
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TimeColumns {
    names: Vec<String>,
    /// What stands before each cell, and behind the last.
    around: Vec<String>,
}

impl TimeColumns {
    /// One column of this name, which may have braces in it.
    pub fn one(name: impl Into<String>) -> Self {
        Self {
            names: vec![name.into()],
            around: vec![String::new(); 2],
        }
    }

    /// Whether the text is the cell of one column as it stands.
    pub fn is_one(&self) -> bool {
        self.names.len() == 1 && self.around.iter().all(String::is_empty)
    }

    /// The names of the columns, in the order of their cells in the text; none of them twice.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The name of a column that holds the whole text: the names with what stands around them, without braces.
    pub fn title(&self) -> String {
        self.written("", "")
    }

    /// Puts the text together from a cell for each name. Where one is empty there is no time, and so is the text.
    pub fn join<'c>(&self, text: &mut Vec<u8>, cell: impl Fn(usize) -> &'c [u8]) {
        text.clear();
        for (column, before) in self.around.iter().enumerate() {
            text.extend_from_slice(before.as_bytes());
            if column < self.names.len() {
                let cell = cell(column);
                if cell.is_empty() {
                    text.clear();
                    return;
                }
                text.extend_from_slice(cell);
            }
        }
    }

    /// The same with other names.
    #[must_use]
    pub fn renamed(mut self, name: impl Fn(&str) -> String) -> Self {
        self.names.iter_mut().for_each(|of| *of = name(of));
        self
    }

    fn written(&self, open: &str, close: &str) -> String {
        let mut text = String::new();
        for (name, before) in self.names.iter().zip(&self.around) {
            text.extend([before, open, name, close]);
        }
        text.extend(self.around.last().map(String::as_str));
        text
    }
}

impl FromStr for TimeColumns {
    type Err = TimeColumnsError;

    /// Without braces, the name of one column.
    fn from_str(text: &str) -> Result<Self, TimeColumnsError> {
        if !text.contains(['{', '}']) {
            return Ok(Self::one(text));
        }
        let plain = |text: &str| match text.contains('}') {
            true => Err(TimeColumnsError::Unopened),
            false => Ok(text.to_owned()),
        };
        let mut parts = text.split('{');
        let mut around = vec![plain(parts.next().unwrap_or_default())?];
        let mut names: Vec<String> = Vec::new();
        for part in parts {
            let (name, behind) = part
                .split_once('}')
                .ok_or_else(|| TimeColumnsError::Unclosed(format!("{{{part}")))?;
            let name = name.trim().to_owned();
            if name.is_empty() {
                return Err(TimeColumnsError::NoName);
            }
            if names.contains(&name) {
                return Err(TimeColumnsError::Twice(name));
            }
            names.push(name);
            around.push(plain(behind)?);
        }
        Ok(Self { names, around })
    }
}

impl fmt::Display for TimeColumns {
    /// As a graph file names them.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.is_one() {
            true => f.write_str(&self.names[0]),
            false => f.write_str(&self.written("{", "}")),
        }
    }
}

/// Why a text names no columns.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TimeColumnsError {
    /// A brace is opened and not closed; from it on, the text is this.
    Unclosed(String),
    /// A brace is closed that was not opened.
    Unopened,
    /// Nothing stands between two braces.
    NoName,
    /// This name stands there twice.
    Twice(String),
}

impl fmt::Display for TimeColumnsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unclosed(from) => write!(f, "a brace is not closed in `{from}`; ")?,
            Self::Unopened => write!(f, "a brace is closed that was not opened; ")?,
            Self::NoName => write!(f, "no column is named between `{{` and `}}`; ")?,
            Self::Twice(name) => write!(f, "the column `{name}` stands twice; ")?,
        }
        write!(
            f,
            "write the name of one column, or of several each in braces, e.g. \"{{Date}} {{Time}}\""
        )
    }
}

impl std::error::Error for TimeColumnsError {}

#[cfg(test)]
mod tests {
    use super::*;

    fn joined(template: &str, cells: &[&str]) -> String {
        let columns: TimeColumns = template.parse().unwrap();
        let mut text = b"of the row before".to_vec();
        columns.join(&mut text, |column| cells[column].as_bytes());
        String::from_utf8(text).unwrap()
    }

    #[test]
    fn cells_stand_where_their_columns_are_named_and_an_empty_one_leaves_no_text() {
        assert_eq!(joined("Time", &["8"]), "8");
        assert_eq!(joined("{Date}T{Time}Z", &["a", "b"]), "aTbZ");
        assert_eq!(joined("{ Date }{Time}", &["a", "b"]), "ab");
        assert_eq!(joined("at {h}:00", &["8"]), "at 8:00");
        assert_eq!(joined("{Date} {Time}", &["a", ""]), "");
        assert_eq!(joined("{Date} {Time}", &["", "b"]), "");
    }

    #[test]
    fn columns_are_written_as_they_are_read_and_have_a_title_without_braces() {
        for (text, title) in [
            ("Time [s]", "Time [s]"),
            ("{Date} {Time}", "Date Time"),
            ("{Date}T{Time}Z", "DateTTimeZ"),
            ("{Date} 12:00", "Date 12:00"),
        ] {
            let columns: TimeColumns = text.parse().unwrap();
            assert_eq!(columns.to_string(), text);
            assert_eq!(columns.title(), title);
            assert_eq!(columns.is_one(), text == title, "{text}");
        }
        assert_eq!("{Time}".parse(), Ok(TimeColumns::one("Time")));
        assert_eq!(TimeColumns::one("a{b").to_string(), "a{b");
    }

    #[test]
    fn what_is_wrong_with_braces_is_told_with_an_example() {
        let example =
            "write the name of one column, or of several each in braces, e.g. \"{Date} {Time}\"";
        for (text, what) in [
            ("{Date} {Time", "a brace is not closed in `{Time`"),
            ("{{Date} {Time}", "a brace is not closed in `{`"),
            ("{", "a brace is not closed in `{`"),
            ("Time}", "a brace is closed that was not opened"),
            ("{Date}} {Time}", "a brace is closed that was not opened"),
            ("{} {Time}", "no column is named between `{` and `}`"),
            ("{Date} { }", "no column is named between `{` and `}`"),
            ("{Time} {Time}", "the column `Time` stands twice"),
        ] {
            let error = text.parse::<TimeColumns>().unwrap_err().to_string();
            assert_eq!(error, format!("{what}; {example}"), "{text}");
        }
    }
}
