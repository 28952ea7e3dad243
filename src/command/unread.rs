//! Decides what is told of the sections of a machine file that no command reads yet.

use std::path::Path;

use athermal::core::document::GraphFile;

use crate::terminal::Terminal;

/// What a machine file may say and `run` does not read: its key, how it is written, and what to do instead.
const UNREAD: [(&str, &str, &str); 3] = [
    ("source", "`[source]`", "give the input with `--input`"),
    ("sinks", "`[sinks]`", "give the output with `--output`"),
    (
        "runtime",
        "`[runtime]`",
        "do without heartbeats, since every tick is a row",
    ),
];

/// Tells which sections of a machine file are not read, since whoever wrote them expects them to work.
pub fn tell(terminal: &Terminal, path: &Path, graph: &GraphFile) {
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
