//! Mistakes in references: nodes, signals, ports and channels that are not there.

use std::sync::Arc;

use super::{nearest_of_many, nearest_or_all};
use crate::diagnostic::{Names, names, problem};

problem! {
    /// A reference to a node or signal that is not there.
    A042 UnknownNode { node: String, known: Arc<Names> }
    error: "unknown node or signal",
    explanation: "A reference begins with the name of a node or signal of the graph.",
    message: format!("there is no node or signal `{node}`"),
    label: "not found",
    help: match node.split_once('[') {
        Some((owner, member)) if known.contains(owner) => {
            let member = member.trim_end_matches(']');
            format!("a channel is written `{owner}.{member}`, a port `{owner}:{member}`")
        }
        _ => nearest_of_many(node, known, "the graph has"),
    },
}

problem! {
    /// A reference to an inherited node that the file removes.
    A042 RemovedNode { node: String }
    message: format!("`{node}` is referred to, and `nodes.{node} = false` removes it"),
    label: "removed",
    help: "remove or change what refers to it as well, as by `outputs.NAME = false` or `nodes.NAME = false`",
}

problem! {
    /// A reference to a port that the node does not have.
    A043 UnknownPort { node: String, port: String, known: Vec<&'static str> }
    error: "unknown port",
    explanation: "What follows the `:` of a reference is one of the node's output ports. `athermal nodes TYPE` lists them.",
    message: format!("`{node}` has no output port `{port}`"),
    label: "no such port",
    help: if known.is_empty() {
        format!("`{node}` has channels and no ports: `{node}.CHANNEL`")
    } else {
        nearest_or_all(port, known, "its ports are")
    },
}

problem! {
    /// A reference that ends, or goes on with a channel, where its port should stand.
    A043 EmptyPort { node: String, channel: Option<String>, known: Vec<&'static str> }
    message: format!("no output port of `{node}` stands behind the colon"),
    label: "no port",
    help: {
        let channel = channel.as_ref().filter(|channel| !channel.is_empty());
        let written = match channel {
            Some(channel) => format!("write `{node}.{channel}`"),
            None => format!("write `{node}`"),
        };
        match known.is_empty() {
            true => written,
            false => format!("{written}, or name a port; its ports are {}", names(known)),
        }
    },
}

problem! {
    /// A reference that matches no channel.
    A044 UnknownChannel { node: String, channel: String, known: Arc<Names> }
    error: "unknown channel",
    explanation: "A reference that matches nothing is a mistake, since an empty input would silently have no effect.",
    message: format!("`{node}` has no channel that matches `{channel}`"),
    label: "matches nothing",
    help: match channel.split_once(':') {
        Some((channel, port)) => format!("a port stands behind the node: `{node}:{port}.{channel}`"),
        None => nearest_of_many(channel, known, "its channels are"),
    },
}

problem! {
    /// A loop without a delay.
    A051 Cycle { path: Vec<String> }
    error: "nodes that wait for each other",
    explanation: "A node runs after those that it reads, so they cannot form a loop. Feedback goes through a `delay`, which gives what \
        was known at an earlier tick.",
    message: format!("these nodes wait for each other: {}", path.join(" → ")),
    label: "part of a loop",
    help: "let the feedback go through a `delay` node",
}
