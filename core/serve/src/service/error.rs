//! Why a service does not start.

use std::{fmt, io};

use crate::checkpoint::CheckpointError;
use crate::connector::ConnectorError;
use crate::engine::{EngineError, RestoreError};
use crate::folder::FolderError;
use crate::journal::JournalError;
use crate::recovery::RecoveryError;

/// Why a service does not start; its text says what, where and what to do.
#[derive(Debug)]
pub enum ServiceError {
    /// The state folder cannot be used.
    Folder(FolderError),
    /// What the state folder holds cannot be used.
    Recovery(RecoveryError),
    /// The journal cannot be written.
    Journal(JournalError),
    /// The last checkpoint cannot be written.
    Checkpoint(CheckpointError),
    /// A source cannot be what the machine file asks for.
    Source {
        /// Its name.
        source: String,
        /// Why.
        error: ConnectorError,
    },
    /// A sink cannot be what the machine file asks for, or not be brought to where the journal is.
    Sink {
        /// Its name.
        sink: String,
        /// Why.
        error: ConnectorError,
    },
    /// How far a sink is cannot be kept.
    Position {
        /// Its name.
        sink: String,
        /// Why.
        error: io::Error,
    },
    /// What was fitted does not belong to the graph.
    Unfit(EngineError),
    /// The engine cannot be copied.
    NoTwin(RestoreError),
    /// What is to run beside the service cannot start.
    Companion(ConnectorError),
    /// A thread cannot be started.
    Thread(io::Error),
}

impl fmt::Display for ServiceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folder(error) => error.fmt(f),
            Self::Recovery(error) => error.fmt(f),
            Self::Journal(error) => error.fmt(f),
            Self::Checkpoint(error) => error.fmt(f),
            Self::Source { source, error } => write!(f, "source `{source}`: {error}"),
            Self::Sink { sink, error } => write!(f, "sink `{sink}`: {error}"),
            Self::Position { sink, error } => {
                write!(f, "sink `{sink}`: how far it is cannot be kept: {error}")
            }
            Self::Unfit(error) => error.fmt(f),
            Self::NoTwin(error) => error.fmt(f),
            Self::Companion(error) => error.fmt(f),
            Self::Thread(error) => write!(f, "cannot start a thread: {error}"),
        }
    }
}

impl std::error::Error for ServiceError {}

from! {
    ServiceError: FolderError => Folder, RecoveryError => Recovery, JournalError => Journal, CheckpointError => Checkpoint,
    EngineError => Unfit, RestoreError => NoTwin,
}
