//! That a source or a sink is to end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Whether a source or a sink is to end. It looks here at least ten times a second.
#[derive(Debug, Clone, Default)]
pub struct Stop {
    asked: Arc<AtomicBool>,
    /// Of one run of a source, after which it may run again.
    run: Option<Arc<AtomicBool>>,
}

impl Stop {
    /// Whether it is to end.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        let is_asked = |of: &Arc<AtomicBool>| of.load(Ordering::Acquire);
        is_asked(&self.asked) || self.run.as_ref().is_some_and(is_asked)
    }

    /// Asks for it.
    pub fn ask(&self) {
        self.asked.store(true, Ordering::Release);
    }

    /// One that another asks for as well.
    pub(crate) fn or(&self, run: &Self) -> Self {
        Self {
            asked: Arc::clone(&self.asked),
            run: Some(Arc::clone(&run.asked)),
        }
    }

    /// It is no longer asked for.
    pub(crate) fn withdraw(&self) {
        self.asked.store(false, Ordering::Release);
    }

    /// Waits for so long, but no longer than until the end is asked for: false then.
    #[must_use]
    pub fn wait(&self, duration: Duration) -> bool {
        let until = Instant::now() + duration;
        loop {
            if self.is_asked() {
                return false;
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return true;
            }
            std::thread::sleep(left.min(Duration::from_millis(20)));
        }
    }
}
