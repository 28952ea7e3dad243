//! Mistakes that show only when `each` and modules are expanded.

use crate::diagnostic::problem;

const SMALLER: &str =
    "use fewer members, repeat less of what a module is given, or split the graph into several";

problem! {
    /// `each` would make too many instances.
    A016 TooManyInstances {
        node: String,
        /// Instances of the whole graph with this node, as far as they can be counted.
        instances: usize,
        limit: usize,
    }
    error: "too many instances",
    explanation: "`each` would expand the graph beyond what fits into memory.",
    message: format!("with node \"{node}\" the graph has {instances} instances, more than {limit}"),
    label: "",
    help: SMALLER,
}

problem! {
    /// `each` would make too large a graph.
    A016 TooLargeExpanded {
        node: String,
        /// The greatest number of values in all instances together.
        limit: usize,
    }
    message: format!("with node \"{node}\" the expanded graph has more than {limit} values"),
    label: "",
    help: SMALLER,
}

problem! {
    /// A module that is part of itself, or modules nested too deeply.
    A026 ModuleLoop {
        /// The modules, from the outermost to the one that is too much.
        path: Vec<String>,
        /// The greatest depth.
        limit: usize,
    }
    error: "endless modules",
    explanation: "A module cannot be part of itself, and modules nest at most 16 deep.",
    message: match path.split_last() {
        Some((last, before)) if before.contains(last) => {
            format!("a module is part of itself: {}", path.join(" → "))
        }
        _ => format!("modules are nested more than {limit} deep"),
    },
    label: "comes back here",
    help: "take one of the modules apart",
}
