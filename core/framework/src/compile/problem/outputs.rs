//! Mistakes in what comes out of a graph, and what does not.

use crate::diagnostic::problem;
use crate::unit::Unit;

const ANOTHER_NAME: &str = "give one of them another name, or refer to fewer channels";

problem! {
    /// Two channels of the same name.
    A058 DuplicateName { name: String, what: &'static str }
    error: "duplicate channel",
    explanation: "Two channels of a port, or two columns of what comes out, would have the same name.",
    message: format!("there are two {what} named `{name}`"),
    label: "the name is taken",
    help: ANOTHER_NAME,
}

problem! {
    /// Columns of the same names as others of the output, because of one reference; with an output that it could be alone.
    A058 DuplicateColumns { first: String, more: usize, alone: Option<String> }
    message: {
        let more = match more {
            0 => String::new(),
            1 => ", and one more name comes twice".to_owned(),
            more => format!(", and {more} more names come twice"),
        };
        format!("there are two output columns named `{first}`{more}")
    },
    label: "the name is taken",
    help: match alone {
        Some(alone) => format!("give it a line of its own, such as `{alone}`, or refer to fewer channels"),
        None => ANOTHER_NAME.to_owned(),
    },
}

problem! {
    /// A node whose outputs nobody uses; of a file that the graph extends, or of its own.
    A059 UnusedNode { node: String, inherited: bool }
    warning: "unused node",
    explanation: "No output depends on the node. It costs time and probably shows a reference that was forgotten.",
    message: format!("no output depends on the node `{node}`"),
    label: "not used",
    help: match (node.contains('/'), inherited) {
        (true, _) => {
            "refer to it, name it under the module's `outputs`, or leave it out of the module".to_owned()
        }
        (false, true) => format!(
            "refer to it, name it under `[outputs]`, or write `nodes.{node} = false` in the file that inherits it"
        ),
        (false, false) => "refer to it, name it under `[outputs]`, or delete it".to_owned(),
    },
}

problem! {
    /// A signal that nobody uses.
    A060 UnusedSignal { signal: String }
    warning: "unused signal",
    explanation: "No output depends on the signal.",
    message: format!("no output depends on the signal `{signal}`"),
    label: "not used",
    help: "refer to it or remove it",
}

problem! {
    /// An output behind which there is no signal.
    A061 Unreachable { output: String }
    error: "output without a signal",
    explanation: "No measured channel reaches the output, so it would never have a value.",
    message: format!("no signal reaches the output `{output}`"),
    label: "nothing flows in",
    help: "check the inputs on the way to it",
}

problem! {
    /// A graph without outputs.
    A062 NoOutputs {}
    error: "no outputs",
    explanation: "A graph names under `[outputs]` what it is for; without that nothing of it needs to be computed.",
    message: "the graph has no outputs",
    label: "no `[outputs]`",
    help: "name what the graph is for: `[outputs]` and `predicted = \"NODE\"`",
}

problem! {
    /// Columns that are named for another unit than their signal's.
    A069 ColumnUnit { signal: String, column: String, named: Unit, unit: Unit }
    warning: "columns in another unit",
    explanation: "A table's columns are named for another unit than their signal's, which measures the same. Values are read in the unit \
        of the signal.",
    message: format!("`{signal}` is in {unit}, and its column `{column}` is named for {named}"),
    label: "another unit",
    help: format!(
        "write `unit = \"{named}\"`, which converts wherever another one is needed, unless the log is at fault"
    ),
}
