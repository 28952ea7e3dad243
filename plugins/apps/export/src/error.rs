//! Why something is not exported, by node, and the way that there is.

use std::fmt;
use std::path::PathBuf;

use athermal_core::compile::RateError;
use athermal_core::engine::EngineError;
use thiserror::Error;

/// Why a graph is not exported.
#[derive(Debug, Error)]
pub enum ExportError {
    /// Nodes that have no counterpart on a controller.
    #[error("{}", listed(.0))]
    Nodes(Vec<Refusal>),
    /// Samples do not come as it was said.
    #[error(transparent)]
    Rate(#[from] RateError),
    /// A C compiler refuses what was written.
    #[error("`{compiler}` refuses the sources: {said}")]
    Compiler {
        /// The compiler.
        compiler: String,
        /// What it says.
        said: String,
    },
    /// More state than a runtime finds its way in, whose places have 32 bits.
    #[error(
        "its state would take {bytes} bytes, more than there are places for: give the time between two samples with `--rate`"
    )]
    TooLarge {
        /// How many, as far as there are numbers for it.
        bytes: usize,
    },
    /// The engine that works out the ticks of the self test.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A file could not be written.
    #[error("{path}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// A node that is not exported.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// The node; of several instances that are refused alike their common name.
    pub node: String,
    /// How many instances of it.
    pub instances: usize,
    /// What cannot be exported.
    pub why: String,
    /// What to do.
    pub way: String,
}

impl Refusal {
    /// One more instance of a node among those that are refused: what is the same for several is one refusal.
    pub(crate) fn count(
        all: &mut Vec<Self>,
        name: &str,
        instance: String,
        why: String,
        way: String,
    ) {
        let is_of_node = |node: &str| {
            node.strip_prefix(name)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        let known = all
            .iter_mut()
            .find(|known| is_of_node(&known.node) && known.why == why && known.way == way);
        match known {
            Some(known) => {
                name.clone_into(&mut known.node);
                known.instances += 1;
            }
            None => all.push(Self {
                node: instance,
                instances: 1,
                why,
                way,
            }),
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`", self.node)?;
        if self.instances > 1 {
            write!(f, " ({} instances)", self.instances)?;
        }
        write!(f, ": {}; {}", self.why, self.way)
    }
}

fn listed(refusals: &[Refusal]) -> String {
    let lines: Vec<String> = refusals.iter().map(|of| format!("\n  {of}")).collect();
    format!(
        "not everything in this graph can be exported:{}",
        lines.concat()
    )
}
