//! Decides how the table of a log is described in a graph, where its layout is not the usual one.

use std::fmt::Write as _;

use athermal_core::document::{Arrangement, DecimalMark, TableFormat};

use super::text::{beside, toml_string};

/// `[table]` or what changes it for a file, where the layout of the log is not the usual one.
pub(super) fn lay_out(heading: &str, table: &TableFormat, text: &mut String) {
    if *table == TableFormat::default() {
        return;
    }
    let _ = writeln!(text, "\n{heading}");
    let mut key = |key: &str, value: Option<String>, comment: &str| {
        if let Some(value) = value {
            let _ = writeln!(text, "{}", beside(&format!("{key} = {value}"), comment));
        }
    };
    let separator = table.separator;
    let separator = separator.map(|of| toml_string(&char::from(of.0).to_string()));
    key("separator", separator, "what stands between cells");
    let decimal = table.decimal.map(|mark| match mark {
        DecimalMark::Comma => toml_string(","),
        DecimalMark::Point => toml_string("."),
    });
    key("decimal", decimal, "the decimal mark of values");
    let arrangement = (table.layout == Arrangement::Long).then(|| toml_string("long"));
    key("layout", arrangement, "a row for each value");
    let name = table.name.as_deref().map(toml_string);
    key("name", name, "the column that says what a row is of");
    let value = table.value.as_deref().map(toml_string);
    key("value", value, "the column of its value");
    let segment = table.segment.as_deref().map(toml_string);
    key("segment", segment, "where it changes, times start again");
    let machine = table.machine.as_deref().map(toml_string);
    key(
        "machine",
        machine,
        "which machine a row is of; those of each are read by themselves",
    );
    let only = table.only.as_deref().map(toml_string);
    key("only", only, "the machine whose rows are read");
    let renamed = table.rename.iter();
    let renamed = renamed.map(|(from, to)| format!("{} = {}", toml_string(from), toml_string(to)));
    let renamed: Vec<String> = renamed.collect();
    let rename = (!renamed.is_empty()).then(|| format!("{{ {} }}", renamed.join(", ")));
    key("rename", rename, "what its columns are called here");
    let encoding = table.encoding.map(|of| toml_string(of.name()));
    key("encoding", encoding, "how bytes become text");
    let rows = |rows: Option<u32>| rows.map(|rows| rows.to_string());
    key(
        "skip",
        rows(table.skip),
        "lines above the names of the columns",
    );
    key(
        "names",
        rows(table.names),
        "the row below them that names the columns",
    );
    key(
        "units",
        rows(table.units),
        "the row below them that has the units",
    );
    let lenient = table.lenient.then(|| true.to_string());
    key(
        "lenient",
        lenient,
        "some cells or rows cannot be read, and are taken as missing",
    );
}
