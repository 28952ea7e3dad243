//! Work on a disk that may hang, on a thread of its own: whoever starts it never waits longer than it likes.

use std::thread::{Builder, JoinHandle};
use std::time::{Duration as Wait, Instant as Clock};

/// At most one piece of such work at a time.
#[derive(Debug)]
pub(crate) struct Aside<T>(Option<JoinHandle<T>>);

impl<T> Default for Aside<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: Send + 'static> Aside<T> {
    /// Starts it, unless what was started before is not done, or has not been taken. False then.
    pub(crate) fn start(&mut self, work: impl FnOnce() -> T + Send + 'static) -> bool {
        if self.0.is_none() {
            // Where there is no thread for it, it is not done, as if the disk hung.
            self.0 = Builder::new().name("disk".to_owned()).spawn(work).ok();
            return self.0.is_some();
        }
        false
    }

    /// Whether it is on its way.
    #[cfg(test)]
    pub(crate) fn is_busy(&self) -> bool {
        self.0.as_ref().is_some_and(|work| !work.is_finished())
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
