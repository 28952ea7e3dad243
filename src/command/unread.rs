//! A warning about sections of a machine file that `athermal run` does not read.

use std::path::Path;

use athermal::core::document::GraphFile;

use crate::terminal::Terminal;

/// Warns of the sections of a machine file that are not read.
pub fn warn(terminal: &Terminal, path: &Path, graph: &GraphFile) {
    // Which model is to run it reads.
    let unread = graph.deployment.keys().filter(|key| *key != "model");
    let unread: Vec<_> = unread.map(|section| format!("`[{section}]`")).collect();
    if !unread.is_empty() {
        let thins = match athermal_jobs::thinned::says(graph) {
            true => ", but for what is thinned",
            false => "",
        };
        terminal.warning(format_args!(
            "{0}: `athermal run` goes by its options alone and does not read {1}{thins}; `athermal serve {0}` does",
            path.display(),
            unread.join(", "),
        ));
    }
}
