//! Why a source or a sink cannot go on.

use std::fmt;

/// Why a source or a sink cannot go on; its text says what, where and what to do. It is reported, and tried again later.
#[derive(Debug)]
pub struct ConnectorError(Box<str>);

impl ConnectorError {
    /// With the words for whoever reads the log.
    #[must_use]
    pub fn new(words: impl fmt::Display) -> Self {
        Self(words.to_string().into())
    }
}

impl fmt::Display for ConnectorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ConnectorError {}
