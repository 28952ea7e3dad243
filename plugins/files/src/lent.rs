//! Tables in memory that are read by a name, as files are by their paths. Not what is in them.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::typed::TypedFile;

/// Opens a table in memory, as often as it is asked for; the error says why it cannot be read.
pub type OpenTable = Arc<dyn Fn() -> Result<Box<dyn TypedFile>, String> + Send + Sync>;

thread_local! {
    static LENT: RefCell<Vec<(PathBuf, OpenTable)>> = const { RefCell::new(Vec::new()) };
}

/// Takes tables back, also after a panic.
struct Return {
    left: usize,
}

impl Drop for Return {
    fn drop(&mut self) {
        LENT.with_borrow_mut(|lent| lent.truncate(self.left));
    }
}

/// Does some work in which this thread reads tables in memory wherever a file of their name is asked for, also where there is one.
pub fn with_tables<R>(tables: Vec<(PathBuf, OpenTable)>, work: impl FnOnce() -> R) -> R {
    let left = LENT.with_borrow_mut(|lent| {
        let left = lent.len();
        lent.extend(tables);
        left
    });
    let _return = Return { left };
    work()
}

/// The table of a name, where there is one.
fn lent(path: &Path) -> Option<OpenTable> {
    LENT.with_borrow(|lent| {
        let mut newest_first = lent.iter().rev();
        let found = newest_first.find(|(name, _)| name == path);
        found.map(|(_, open)| Arc::clone(open))
    })
}

/// Whether this thread reads a table in memory by that name.
#[must_use]
pub fn is_in_memory(path: &Path) -> bool {
    lent(path).is_some()
}

/// Opens the table of a name, where there is one.
pub(crate) fn open(path: &Path) -> Option<Result<Box<dyn TypedFile>, String>> {
    lent(path).map(|open| open())
}
