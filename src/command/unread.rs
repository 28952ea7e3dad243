//! A warning about sections of a machine file that `athermal run` does not read.

use std::path::Path;

use athermal::core::document::GraphFile;
use athermal_serve::deployment::SECTIONS;

use crate::terminal::Terminal;

/// Warns of the sections of a machine file that are not read.
pub fn warn(terminal: &Terminal, path: &Path, graph: &GraphFile) {
    let written = |key: &&&str| graph.deployment.contains_key(**key);
    let unread = SECTIONS.iter().filter(written);
    let unread: Vec<_> = unread.map(|section| format!("`[{section}]`")).collect();
    if !unread.is_empty() {
        terminal.warning(format_args!(
            "{0}: `athermal run` goes by its options alone and does not read {1}; `athermal serve {0}` does",
            path.display(),
            unread.join(", "),
        ));
    }
}
