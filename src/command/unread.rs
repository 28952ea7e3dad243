//! A warning about sections of a machine file that no command reads yet.

use std::path::Path;

use athermal::core::document::GraphFile;

use crate::terminal::Terminal;

/// The sections that `run` does not read: key, spelling, and what to do instead.
const UNREAD: [(&str, &str, &str); 3] = [
    ("source", "`[source]`", "give the input with `--input`"),
    ("sinks", "`[sinks]`", "give the output with `--output`"),
    (
        "runtime",
        "`[runtime]`",
        "do without heartbeats, since every tick is a row",
    ),
];

/// Warns of the sections of a machine file that are not read.
pub fn warn(terminal: &Terminal, path: &Path, graph: &GraphFile) {
    let written = |(key, ..): &&(&str, &str, &str)| graph.deployment.contains_key(*key);
    let unread: Vec<_> = UNREAD.iter().filter(written).collect();
    if unread.is_empty() {
        return;
    }
    let sections: Vec<_> = unread.iter().map(|(_, section, _)| *section).collect();
    let instead: Vec<_> = unread.iter().map(|(.., instead)| *instead).collect();
    terminal.warning(format_args!(
        "{}: `athermal run` does not yet read {}: {}",
        path.display(),
        sections.join(", "),
        instead.join("; ")
    ));
}
