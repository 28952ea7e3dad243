//! The message of a panic that was caught, and its node where that is known.

use std::any::Any;
use std::fmt;

/// A panic in the code of a node: what it is for whoever catches it.
#[derive(Debug, Clone)]
pub struct NodePanic {
    /// The node: `thermal.Z1`.
    pub node: String,
    /// When it panicked: `at 2 s`, `in its fit`, `before its first tick`.
    pub when: String,
    /// Who can mend it.
    pub author: String,
    /// The message of the panic.
    pub message: String,
}

impl fmt::Display for NodePanic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            node,
            when,
            author,
            message,
        } = self;
        write!(
            f,
            "the node `{node}` panicked {when}: {message}; this is a mistake in its code, for {author}"
        )
    }
}

/// The message of a panic, without the node.
#[must_use]
pub fn panic_message(panic: &(dyn Any + Send)) -> &str {
    if let Some(of_node) = panic.downcast_ref::<NodePanic>() {
        return &of_node.message;
    }
    let owned = panic.downcast_ref::<String>().map(String::as_str);
    let message = owned.or_else(|| panic.downcast_ref::<&str>().copied());
    message.unwrap_or("it has no message")
}

/// What to report of a panic: with its node, where it is one of a node.
#[must_use]
pub fn panic_text(panic: &(dyn Any + Send)) -> String {
    match panic.downcast_ref::<NodePanic>() {
        Some(of_node) => of_node.to_string(),
        None => format!("a panic: {}", panic_message(panic)),
    }
}
