//! From the merged tree to declarations: which sections there are and in which order they are read; each section has a file of its own.

mod deployment;
mod each;
mod modules;
mod names;
mod nodes;
mod outputs;
mod placeholder;
mod reading;
mod sets;
mod signals;
mod table;
mod time_base;

use super::graph_file::GraphFile;
use super::problem;
use super::read::Document;
use super::tree::{Data, Table};
use crate::diagnostic::Diagnostics;
pub use deployment::Section;
pub use names::is_name;
pub use placeholder::{fill as fill_placeholders, names as placeholders};
use reading::text;
pub use reading::{is_misspelt, known_keys};
pub use table::{Arrangement, DecimalMark, Encoding, Separator, TableBase, TableFormat};
pub use time_base::UNITS as TIME_UNITS;

/// Those that a graph has without a machine.
const SECTIONS: [&str; 12] = [
    "schema",
    "name",
    "description",
    "extends",
    "sets",
    "time",
    "table",
    "signals",
    "modules",
    "nodes",
    "outputs",
    "tests",
];

/// Sections that say which names there are.
const NAMING: [&str; 4] = ["sets", "signals", "modules", "nodes"];

/// Checks names, expands sets and `each`, and gives what the file declares. All mistakes are reported; `None` where they leave open
/// which names there are.
pub fn declare(document: Document, diagnostics: &mut Diagnostics) -> Option<GraphFile> {
    let Document { tree, removed, .. } = document;
    let Data::Table(root) = &tree.data else {
        let expected = "a table".to_owned();
        diagnostics.report(
            tree.place,
            problem::WrongType {
                key: None,
                expected,
                found: tree.found(),
                hint: None,
            },
        );
        return None;
    };
    let sections: Vec<_> = SECTIONS.into_iter().chain(deployment::sections()).collect();
    known_keys(root, &sections, "a graph file", diagnostics);
    let name = text_of(root, "name", diagnostics);
    let description = text_of(root, "description", diagnostics);
    // What stands in a section that is none is no mistake of those who refer to it.
    let strange = root.iter().filter(|(key, _)| !sections.contains(key));
    let below = strange.filter_map(|(_, section)| section.value.as_table());
    let mut broken: Vec<String> = below.flat_map(Table::keys).map(str::to_owned).collect();
    let sets = sets::declare(root.get("sets"), &broken, diagnostics);
    let shared = names::check(root, &mut broken, diagnostics);
    let time = time_base::declare(root.get("time"), diagnostics);
    let table = table::declare(root.get("table"), diagnostics);
    let sample = time.sample();
    let signals = root.get("signals");
    let mut signals = signals::declare(signals, &sets, sample, &mut broken, diagnostics);
    let expanded = modules::expand(root, &sets, &mut broken, diagnostics);
    let mut nodes = nodes::declare(&expanded, &sets, sample, &mut broken, diagnostics);
    signals.retain(|signal| !shared.contains(&signal.name));
    nodes.retain(|node| !shared.contains(&node.name));
    broken.extend(shared);
    let outputs = outputs::declare(expanded.outputs.as_ref(), diagnostics);
    let mut tests = expanded.tests;
    if let Some(tests) = &mut tests {
        nodes::convert_samples_but(tests, "name", sample, diagnostics);
    }
    if let Some(tests) = &tests
        && tests.as_list().is_none()
    {
        let expected = "a list of tables, each under `[[tests]]`".to_owned();
        diagnostics.report(
            tests.place,
            problem::WrongType {
                key: Some("tests".to_owned()),
                expected,
                found: tests.found(),
                hint: None,
            },
        );
    }
    let deployment = deployment::declare(root, diagnostics);
    let mut naming = NAMING.iter().filter_map(|section| root.get(section));
    let whole = naming.all(|section| section.as_table().is_some());
    if expanded.cut || !whole {
        return None;
    }
    Some(GraphFile {
        name,
        description,
        sets: sets.members,
        time,
        table,
        signals,
        nodes,
        broken,
        removed,
        outputs,
        tests,
        deployment,
        tree,
    })
}

fn text_of(root: &Table, key: &str, diagnostics: &mut Diagnostics) -> Option<String> {
    text(root.get(key)?, key, diagnostics).map(str::to_owned)
}

#[cfg(test)]
mod tests;
