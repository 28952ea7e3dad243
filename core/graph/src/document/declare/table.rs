//! `[table]`: how the text of a log is laid out. What it leaves open is found in each file by the reader.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::Deserialize;

use super::reading::{missing, table, text, wrong_type};
use crate::diagnostic::Diagnostics;
use crate::document::decode;
use crate::document::pattern::Pattern;
use crate::document::problem;
use crate::document::tree::{Data, Value};

/// How tabular sources lay out their text, with what differs in some of their files.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TableBase {
    /// The layout of a file that no pattern matches.
    pub base: TableFormat,
    /// Patterns of file names, each with the whole layout of the files that it matches.
    pub files: Vec<(Pattern, TableFormat)>,
}

/// How the text of one log is laid out. What is not declared is found in the file.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TableFormat {
    /// What stands between cells: one character, such as ",", ";", "|" or a tab "\t".
    #[schemars(with = "Option<String>", extend("minLength" = 1, "maxLength" = 1))]
    pub separator: Option<Separator>,
    /// The decimal mark of values: "." or ",".
    pub decimal: Option<DecimalMark>,
    /// How bytes become text: "utf-8", "utf-16le", "utf-16be" or "windows-1252".
    pub encoding: Option<Encoding>,
    /// How many lines stand above the names of the columns.
    pub skip: Option<u32>,
    /// Which row below the skipped lines names the columns; the first is 1.
    #[schemars(range(min = 1))]
    pub names: Option<u32>,
    /// Which row below the skipped lines has the units; 0 where there is none.
    pub units: Option<u32>,
    /// "wide" has a column for each channel, "long" a row for each value.
    pub layout: Arrangement,
    /// In a long layout the column that says which channel the row is of.
    pub name: Option<String>,
    /// In a long layout the column of the values.
    pub value: Option<String>,
    /// A column such as "day": a change of its value begins a segment.
    pub segment: Option<String>,
    /// A column that says which machine a row is of: those of each are read by themselves, as a segment.
    pub machine: Option<String>,
    /// The machine whose rows alone are read, as it stands in the column `machine`.
    pub only: Option<String>,
    /// What the graph calls columns of the file, by their names in it: { Value = "spindle_degC" }.
    pub rename: BTreeMap<String, String>,
    /// Take cells and rows that cannot be read as missing, and count them.
    pub lenient: bool,
}

impl TableFormat {
    /// What the column that the graph calls so is called in the file.
    #[must_use]
    pub fn in_file<'a>(&'a self, column: &'a str) -> Cow<'a, str> {
        let mut renamed = self.rename.iter();
        match renamed.find(|(_, name)| *name == column) {
            Some((in_file, _)) => in_file.into(),
            // What the file calls so has another name for the graph: it lacks this one.
            None => match self.rename.get(column) {
                Some(name) => format!("{column} (called {name})").into(),
                None => column.into(),
            },
        }
    }
}

/// What stands between cells: an ASCII character that no number or quoted cell has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Separator(pub u8);

impl TryFrom<String> for Separator {
    type Error = &'static str;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        match text.as_bytes() {
            [byte]
                if byte.is_ascii()
                    && !byte.is_ascii_alphanumeric()
                    && !b"\"\r\n\0.+-".contains(byte) =>
            {
                Ok(Self(*byte))
            }
            _ => Err(
                "a separator is one character, such as `,`, `;`, `|` or `\\t`, and no letter, digit, quote or sign",
            ),
        }
    }
}

/// What stands before the fraction of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
pub enum DecimalMark {
    /// `21.5`
    #[serde(rename = ".")]
    Point,
    /// `21,5`
    #[serde(rename = ",")]
    Comma,
}

/// How bytes become text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Encoding {
    /// UTF-8.
    #[serde(rename = "utf-8")]
    Utf8,
    /// UTF-16, the low byte first.
    #[serde(rename = "utf-16le")]
    Utf16Le,
    /// UTF-16, the high byte first.
    #[serde(rename = "utf-16be")]
    Utf16Be,
    /// The code page of Windows in Western countries.
    #[serde(rename = "windows-1252")]
    Windows1252,
}

impl Encoding {
    /// As a graph file names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Utf8 => "utf-8",
            Self::Utf16Le => "utf-16le",
            Self::Utf16Be => "utf-16be",
            Self::Windows1252 => "windows-1252",
        }
    }
}

/// What a row has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Arrangement {
    /// The values of all channels.
    #[default]
    Wide,
    /// One value, and the name of its channel.
    Long,
}

impl TableBase {
    /// The layout of a file of this name, its folder left out.
    #[must_use]
    pub fn of(&self, file: &str) -> &TableFormat {
        let matching = self.files.iter().find(|(pattern, _)| pattern.matches(file));
        matching.map_or(&self.base, |(_, format)| format)
    }
}

/// The key of what differs in some files, and of the names of these.
const FILES: &str = "files";
const MATCH: &str = "match";

pub(super) fn declare(section: Option<&Value>, diagnostics: &mut Diagnostics) -> TableBase {
    let mut declared = TableBase::default();
    let Some(section) = section.filter(|section| table(section, "table", diagnostics).is_some())
    else {
        return declared;
    };
    let mut own = section.as_table().cloned().unwrap_or_default();
    let files = own.remove(FILES);
    let base = Value::new(section.place, Data::Table(own.clone()));
    let Some(base) = format(&base, "[table]", diagnostics) else {
        return declared;
    };
    declared.base = base;
    let files = files.map(|entry| entry.value);
    let list = files.as_ref().and_then(Value::as_list);
    if let (Some(files), None) = (&files, list) {
        let expected = "a list of tables, each under `[[table.files]]`";
        wrong_type(files, FILES, expected, diagnostics);
    }
    for file in list.into_iter().flatten() {
        let Some(keys) = table(file, FILES, diagnostics) else {
            continue;
        };
        let mut laid_over = own.clone();
        for (key, entry) in keys.iter().filter(|(key, _)| *key != MATCH) {
            laid_over.insert(key, entry.clone());
        }
        let laid_over = Value::new(file.place, Data::Table(laid_over));
        let format = format(&laid_over, "[[table.files]]", diagnostics);
        match keys.get(MATCH) {
            Some(pattern) => {
                let pattern = text(pattern, MATCH, diagnostics).map(Pattern::new);
                declared.files.extend(pattern.zip(format));
            }
            None => {
                let advice =
                    Some("write `match = \"temp*.csv\"`, the names of the files that it is for");
                missing(file, MATCH, "[[table.files]]", advice, diagnostics);
            }
        }
    }
    declared
}

/// The layout that these keys declare, if they contradict neither the language nor each other.
fn format(keys: &Value, what: &str, diagnostics: &mut Diagnostics) -> Option<TableFormat> {
    let format: TableFormat = decode(keys, what, diagnostics)?;
    let mut refused = Vec::new();
    let names = format.names.unwrap_or(1);
    if names == 0 {
        refused.push(("names", "the first row below the skipped lines is 1"));
    }
    if format
        .units
        .is_some_and(|units| units != 0 && units <= names)
    {
        let why = "the units stand in a row below the names; 0 is for none";
        refused.push(("units", why));
    }
    for (key, column) in [("name", &format.name), ("value", &format.value)] {
        match (format.layout, column) {
            (Arrangement::Wide, Some(_)) => {
                let why = "only a table with `layout = \"long\"` has such a column";
                refused.push((key, why));
            }
            (Arrangement::Long, None) => {
                let example = format!("write `{key} = \"{key}\"`, the column of it");
                missing(keys, key, what, Some(&example), diagnostics);
            }
            _ => {}
        }
    }
    if format.only.is_some() && format.machine.is_none() {
        let why = "only a table with `machine = \"…\"`, the column that says which one a row is of, has several";
        refused.push(("only", why));
    }
    let names: BTreeSet<&String> = format.rename.values().collect();
    if names.len() < format.rename.len() {
        refused.push(("rename", "two columns of a file cannot have one name"));
    }
    for (key, reason) in refused {
        let (place, key) = (keys.place_of(key), Some(key.to_owned()));
        let reason = reason.to_owned();
        diagnostics.report(place, problem::Refused { key, reason });
    }
    Some(format)
}
