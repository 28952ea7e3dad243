//! Mistakes about node types: which there are, and what a type refuses or doubts.

use crate::compile::KindFault;
use crate::diagnostic::problem;
use crate::node::Kind;
use crate::registry::NotFound;

problem! {
    /// A `type` that no linked crate brings.
    A040 UnknownKind { why: NotFound }
    error: "unknown node type",
    explanation: "No crate in this program has a node of this type. `athermal nodes` lists the types that there are.",
    message: why.message(),
    label: "no such type",
    help: why.help(),
}

problem! {
    /// Two crates bring the same kind.
    A041 KindTwice { why: NotFound }
    error: "ambiguous name",
    explanation: "Two crates in this program have a node of the same type, or write what a node knows under the same name. A \
        graph or a file could mean either.",
    message: why.message(),
    label: "which of them?",
    help: why.help(),
}

problem! {
    /// Something that the kind's crate writes has a name that is taken twice.
    A041 WrittenTwice { kind: &'static str, written: NotFound }
    message: format!("`{kind}` cannot be used, since {}", written.message()),
    label: "which of them?",
    help: written.help(),
}

problem! {
    /// A mistake that the kind found.
    A054 Parameter { message: String, help: Option<String> }
    error: "parameters that do not fit",
    explanation: "The node's type refuses a parameter, or how its inputs fit together. `athermal nodes TYPE` lists what it takes.",
    message: message.as_str(),
    label: "here",
    help: help.clone(),
}

problem! {
    /// Something that the kind can use and doubts to be meant.
    A065 Doubt { message: String, help: Option<String> }
    warning: "doubtful use",
    explanation: "The node works as it is written, but not as it is meant to be used. Its documentation describes what it needs.",
    message: message.as_str(),
    label: "here",
    help: help.clone(),
}

problem! {
    /// An estimator with `learn` that cannot learn while it runs.
    A110 NeverLearns { kind: &'static str, help: Option<&'static str> }
    error: "estimator that does not learn",
    explanation: "`learn` lets an estimator go on learning while it runs. Not every kind can, and some only with certain parameters.",
    message: format!("`{kind}`, as it is here, does not learn while it runs"),
    label: "stays as it was fitted",
    help: help.unwrap_or("leave `learn` out, or choose a kind that learns"),
}

problem! {
    /// A mistake in the code of a kind.
    A180 FaultyKind { kind: &'static str, author: String, fault: KindFault }
    error: "mistake of a plugin",
    explanation: "The code of the node's type does what no node may: it panics, or asks for values from the future. The graph is not at \
        fault, and can only do without the type until its author has fixed it; `athermal nodes TYPE` names the crate.",
    message: format!("`{kind}` {}", fault.found),
    label: "a mistake of its kind, not of the graph",
    help: format!("for {author}: {}", fault.remedy),
}

impl FaultyKind {
    pub(in crate::compile) fn new(kind: &Kind, fault: KindFault) -> Self {
        Self {
            kind: kind.name,
            author: kind.author(),
            fault,
        }
    }
}
