//! Tables in memory that are read by a name, as files are by their paths. Not what is in them.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::typed::TypedFile;

/// Opens a table in memory, as often as it is asked for; the error says why it cannot be read.
pub type OpenTable = Arc<dyn Fn() -> Result<Box<dyn TypedFile>, String> + Send + Sync>;

/// Tables in memory by name: they are read wherever a file of that name is asked for, also where there is one.
#[derive(Clone, Default)]
pub struct Tables(Arc<[(PathBuf, OpenTable)]>);

impl Tables {
    /// Whether there is a table of that name.
    #[must_use]
    pub fn has(&self, path: &Path) -> bool {
        self.0.iter().any(|(name, _)| name == path)
    }

    /// Opens the table of a name, where there is one.
    pub(crate) fn open(&self, path: &Path) -> Option<Result<Box<dyn TypedFile>, String>> {
        let found = self.0.iter().find(|(name, _)| name == path);
        found.map(|(_, open)| open())
    }
}

impl FromIterator<(PathBuf, OpenTable)> for Tables {
    fn from_iter<I: IntoIterator<Item = (PathBuf, OpenTable)>>(all: I) -> Self {
        Self(all.into_iter().collect())
    }
}

impl fmt::Debug for Tables {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set()
            .entries(self.0.iter().map(|of| &of.0))
            .finish()
    }
}
