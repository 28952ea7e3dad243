//! That a source or a sink is to end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::bell::{Bell, Bells};

/// Whether a source or a sink is to end. It looks here at least ten times a second, or is [woken](Self::wakes).
#[derive(Debug, Clone, Default)]
pub struct Stop {
    asked: Arc<Flag>,
    /// Of one run of a source, after which it may run again.
    run: Option<Arc<Flag>>,
}

#[derive(Debug, Default)]
struct Flag {
    is_up: AtomicBool,
    bells: Bells,
}

impl Stop {
    /// Whether it is to end.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.flags().any(|of| of.is_up.load(Ordering::Acquire))
    }

    /// Asks for it.
    pub fn ask(&self) {
        self.asked.is_up.store(true, Ordering::Release);
        self.asked.bells.ring();
    }

    /// From now on it rings where it is to end.
    pub fn wakes(&self, bell: &Bell) {
        self.flags().for_each(|of| of.bells.add(bell));
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
        self.asked.is_up.store(false, Ordering::Release);
    }

    /// Waits for so long, but no longer than until the end is asked for: false then.
    #[must_use]
    pub fn wait(&self, duration: Duration) -> bool {
        let until = Instant::now() + duration;
        self.wakes(&Bell::here());
        loop {
            if self.is_asked() {
                return false;
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return true;
            }
            std::thread::park_timeout(left);
        }
    }

    fn flags(&self) -> impl Iterator<Item = &Flag> {
        std::iter::once(&*self.asked).chain(self.run.as_deref())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_waits_is_woken_by_either_end() {
        for nth in 0..2 {
            let (all, run) = (Stop::default(), Stop::default());
            let either = all.or(&run);
            let waits = std::thread::spawn(move || either.wait(Duration::from_secs(60)));
            std::thread::sleep(Duration::from_millis(20));
            let began = Instant::now();
            [all, run][nth].ask();
            assert!(!waits.join().unwrap());
            assert!(began.elapsed() < Duration::from_secs(5));
        }
    }
}
