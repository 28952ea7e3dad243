//! Mistakes about modules: which there are, what is part of one, and what comes out of it.

use std::sync::Arc;

use super::{nearest_of_many, quoted};
use crate::diagnostic::{Names, problem};

problem! {
    /// `module = …` names a module that is not declared.
    A025 UnknownModule {
        name: String,
        /// The modules in sight.
        known: Arc<Names>,
    }
    error: "unknown module",
    explanation: "`module = \"…\"` names a module that `[modules]` does not have, neither here nor in the file that the module comes \
        from.",
    message: format!("there is no module \"{name}\""),
    label: "not a module",
    help: nearest_of_many(name, known, "the modules are")
        .unwrap_or_else(|| format!("describe it under `[modules.{name}]`")),
}

problem! {
    /// A module refers to what is not part of it.
    A027 OutOfReach {
        name: String,
        module: String,
        /// The nodes and inputs that the module has.
        known: Arc<Names>,
    }
    error: "out of a module's reach",
    explanation: "Inside a module a reference names one of its nodes or begins with one of its inputs, so that it means the same wherever \
        it is used.",
    message: format!("\"{name}\" is not a node of module \"{module}\""),
    label: "out of the module's reach",
    help: match known.nearest(name) {
        Some(near) => format!("did you mean \"{near}\"?"),
        None => format!("name it under the module's `inputs`; there it has {}", quoted(known.iter())),
    },
}

problem! {
    /// An output that a module does not have.
    A028 UnknownOutput {
        /// The instance.
        node: String,
        /// The name; none where the default is meant.
        output: Option<String>,
        module: String,
        known: Arc<Names>,
    }
    error: "unknown output of a module",
    explanation: "A reference to an instance of a module names one of the outputs that the module declares; without one it means the \
        first.",
    message: match output {
        None => format!("module \"{module}\" has no outputs"),
        Some(output) => {
            format!("\"{node}\" has no output \"{output}\": it is an instance of module \"{module}\"")
        }
    },
    label: "no such output",
    help: nearest_of_many(output.as_deref().unwrap_or_default(), known, "its outputs are")
        .unwrap_or_else(|| "name one, e.g. `outputs = { predicted = \"vote\" }`".to_owned()),
}
