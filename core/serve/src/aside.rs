//! Work on a disk that may hang, on a thread of its own: whoever starts it never waits longer than it likes.

use std::thread::{Builder, JoinHandle};
use std::time::{Duration as Wait, Instant as Clock};

/// How long a disk may take where somebody waits for it.
pub(crate) const PATIENCE: Wait = Wait::from_secs(2);

/// What comes of such work, where that takes no longer than a disk may.
pub(crate) fn within<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    let mut aside = Aside::default();
    aside.start(work);
    aside.wait(PATIENCE)
}

/// At most one piece of such work at a time.
#[derive(Debug)]
pub(crate) struct Aside<T>(Option<JoinHandle<T>>);

impl<T> Default for Aside<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: Send + 'static> Aside<T> {
    /// Starts it, unless what was started before is not done, or has not been taken.
    pub(crate) fn start(&mut self, work: impl FnOnce() -> T + Send + 'static) {
        if self.is_free() {
            // Where there is no thread for it, it is not done, as if the disk hung.
            self.0 = Builder::new().name("disk".to_owned()).spawn(work).ok();
        }
    }

    /// Whether another piece can be started: none is on its way, or has not been taken.
    pub(crate) fn is_free(&self) -> bool {
        self.0.is_none()
    }

    /// What came of it, once it is done.
    pub(crate) fn take(&mut self) -> Option<T> {
        let done = self.0.take_if(|work| work.is_finished())?;
        done.join().ok()
    }

    /// What comes of it within so long.
    pub(crate) fn wait(&mut self, patience: Wait) -> Option<T> {
        let began = Clock::now();
        while self.0.as_ref().is_some_and(|work| !work.is_finished()) {
            if began.elapsed() > patience {
                return None;
            }
            std::thread::sleep(Wait::from_micros(200));
        }
        self.take()
    }
}
