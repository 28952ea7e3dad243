//! Mistakes in what a node is given at its inputs.

use crate::diagnostic::{code, names, problem};

code!(
    A045,
    Error,
    "unknown input",
    "A node has the inputs that its type declares, and no others."
);

problem! {
    /// An input that the kind does not have.
    A045 UnknownInput {
        kind: &'static str,
        input: String,
        meant: Option<&'static str>,
        known: Vec<&'static str>,
    }
    message: format!("`{kind}` has no input `{input}`"),
    label: "no such input",
    help: match meant {
        Some(meant) => format!("did you mean `{meant}`?"),
        None => format!("its inputs are {}", names(known)),
    },
}

code!(
    A046,
    Error,
    "missing input",
    "A node needs every input of its type that is not optional."
);

problem! {
    /// An input that the kind needs and the node does not give.
    A046 MissingInput { kind: &'static str, input: &'static str, summary: &'static str }
    message: format!("`{kind}` needs the input `{input}`"),
    label: "an input is missing",
    help: format!("add `inputs.{input} = \"…\"`: {summary}"),
}

code!(
    A047,
    Error,
    "wrong number of channels",
    "An input takes a single channel, or as many as another, and the reference stands for more or fewer."
);

problem! {
    /// An input with another number of channels than it takes.
    A047 ChannelCount { input: &'static str, found: Vec<String>, expected: &'static str }
    message: format!("the input `{input}` takes {expected} and is given {}", found.len()),
    label: "the wrong number of channels",
    help: format!("the reference stands for {}", names(found)),
}

code!(
    A053,
    Error,
    "no maximum age",
    "A held value counts until it is too old, and nothing defines when that is: neither the signal, nor the input, nor a window."
);

problem! {
    /// A held input whose age nothing bounds; with the signal that could define how long its samples count.
    A053 NoMaxAge { channel: String, input: String, signal: Option<String> }
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

code!(
    A068,
    Error,
    "a channel that counts twice",
    "Each regressor and each vote counts once. The coefficients of two equal regressors cannot be separated, and a voter that stands \
     twice would have twice the weight."
);

problem! {
    /// A regressor or a vote that counts twice.
    A068 Repeated { channel: String, input: &'static str }
    message: format!("`{channel}` stands twice in `{input}`"),
    label: "for the second time",
    help: "refer to each channel once",
}
