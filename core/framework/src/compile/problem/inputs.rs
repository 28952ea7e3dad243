//! Mistakes in what a node is given at its inputs.

use crate::diagnostic::{names, problem};

problem! {
    /// An input that the kind does not have.
    A045 UnknownInput {
        kind: &'static str,
        input: String,
        meant: Option<&'static str>,
        known: Vec<&'static str>,
    }
    error: "unknown input",
    explanation: "A node has the inputs that its type declares, and no others.",
    message: format!("`{kind}` has no input `{input}`"),
    label: "no such input",
    help: match meant {
        Some(meant) => format!("did you mean `{meant}`?"),
        None => format!("its inputs are {}", names(known)),
    },
}

problem! {
    /// An input that the kind needs and the node does not give.
    A046 MissingInput { kind: &'static str, input: &'static str, summary: &'static str }
    error: "missing input",
    explanation: "A node needs every input of its type that is not optional.",
    message: format!("`{kind}` needs the input `{input}`"),
    label: "an input is missing",
    help: format!("add `inputs.{input} = \"…\"`: {summary}"),
}

problem! {
    /// An input with another number of channels than it takes.
    A047 ChannelCount { input: &'static str, found: Vec<String>, expected: &'static str }
    error: "wrong number of channels",
    explanation: "An input takes a single channel, or as many as another, and the reference stands for more or fewer.",
    message: format!("the input `{input}` takes {expected} and is given {}", found.len()),
    label: "the wrong number of channels",
    help: format!("the reference stands for {}", names(found)),
}

problem! {
    /// A held input whose age nothing bounds; with the signal that could define how long its samples count.
    A053 NoMaxAge { channel: String, input: String, signal: Option<String> }
    error: "no maximum age",
    explanation: "A held value counts until it is too old, and nothing defines when that is: neither the signal, nor the input, nor a \
        window.",
    message: format!("nothing defines how long a value of `{channel}` counts"),
    label: "held without a maximum age",
    help: {
        let here = format!("`inputs.{input} = {{ from = \"…\", max_age = \"1min\" }}`");
        match signal {
            Some(signal) => format!("set `max_age` on the signal `{signal}`, or {here}"),
            // What closes a loop has no signal behind it when it is read.
            None => format!("set it where it is read: {here}"),
        }
    },
}

problem! {
    /// A regressor or a vote that counts twice.
    A068 Repeated { channel: String, input: &'static str }
    error: "a channel that counts twice",
    explanation: "Each regressor and each vote counts once. The coefficients of two equal regressors cannot be separated, and a voter \
        that stands twice would have twice the weight.",
    message: format!("`{channel}` stands twice in `{input}`"),
    label: "for the second time",
    help: "refer to each channel once",
}
