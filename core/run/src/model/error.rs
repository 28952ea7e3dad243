//! Decides what can go wrong with a model and how it is said.

use std::fmt;
use std::path::PathBuf;

use crate::diagnostic::{Diagnostics, Sources, listed};
use crate::document::unreadable;
use crate::engine::EngineError;
use crate::node::Mistake;

/// Why a model or graph cannot be used.
#[derive(Debug)]
pub enum ModelError {
    /// The file cannot be read.
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is no model.
    NotAModel {
        /// The file.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// What was fitted cannot be used.
    Fits {
        /// The file.
        path: PathBuf,
        /// The nodes of which it cannot, and why.
        refused: Vec<(String, Vec<Mistake>)>,
    },
    /// The file was written by a later version.
    TooNew {
        /// The file.
        path: PathBuf,
        /// The version of its format.
        version: u64,
    },
    /// The graph has mistakes.
    Graph {
        /// The mistakes.
        diagnostics: Box<Diagnostics>,
        /// The texts that they point into.
        sources: Box<Sources>,
    },
    /// Something in the graph needs a fit and has none.
    NotFitted {
        /// The file.
        path: PathBuf,
        /// The nodes without a fit.
        nodes: Vec<String>,
    },
    /// What was fitted does not belong to the graph.
    Engine(EngineError),
}

impl fmt::Display for ModelError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unreadable { path, source } => {
                let path = path.display();
                write!(f, "cannot read {path}: {}", unreadable(source))?;
                if source.kind() == std::io::ErrorKind::NotFound {
                    write!(f, "; `athermal fit GRAPH --data FILE -o {path}` writes one")?;
                }
                Ok(())
            }
            Self::NotAModel { path, source } => {
                write!(
                    f,
                    "{} is no model: {source}; a model is what `athermal fit GRAPH --data FILE -o MODEL` writes",
                    path.display()
                )
            }
            Self::Fits { path, refused } => {
                const MOST: usize = 6;
                let path = path.display();
                write!(
                    f,
                    "{path}: what was fitted cannot be used as it stands there"
                )?;
                for (node, mistakes) in &refused[..refused.len().min(MOST)] {
                    let texts = mistakes.iter().map(|mistake| match &mistake.help {
                        Some(help) => format!("{} ({help})", mistake.message),
                        None => mistake.message.clone(),
                    });
                    write!(f, "\n  `{node}`: {}", texts.collect::<Vec<_>>().join("; "))?;
                }
                let more = refused.len().saturating_sub(MOST);
                if more > 0 {
                    write!(f, "\n  and {more} more")?;
                }
                write!(f, "\ntake the file as it was written, or fit again")
            }
            Self::TooNew { path, version } => write!(
                f,
                "{} has model format {version} and this program reads format {}: use a newer athermal or fit again",
                path.display(),
                super::file::FORMAT
            ),
            Self::Graph {
                diagnostics,
                sources,
            } => write!(f, "{}", diagnostics.render(sources, false, 100)),
            Self::NotFitted { path, nodes } => {
                write!(
                    f,
                    "{} is a graph of which some nodes need a fit ({}): run `athermal fit {} --data FILE -o MODEL` and use MODEL",
                    path.display(),
                    listed(nodes, 6),
                    path.display()
                )
            }
            Self::Engine(error) => write!(f, "{error}"),
        }
    }
}

impl std::error::Error for ModelError {}

impl From<EngineError> for ModelError {
    fn from(error: EngineError) -> Self {
        Self::Engine(error)
    }
}
