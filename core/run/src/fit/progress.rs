//! What a fit reports while it goes on.

use std::sync::{Mutex, PoisonError};

/// How far a fit has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FitProgress<'a> {
    /// It goes over the data.
    Ticks {
        /// The ticks stepped so far, over all passes.
        stepped: u64,
        /// Which fit this is, from 1. Nodes that do not feed each other are fitted together.
        fit: u64,
        /// How many there are: those below others that learn from their predictions come once more for each fold.
        of: u64,
    },
    /// An estimator compares orders.
    Order {
        /// Which estimator.
        node: &'a str,
        /// Which order it goes to, from 1.
        nth: usize,
        /// How many there are.
        of: usize,
    },
}

/// Takes progress from any of the threads.
pub(super) struct Listener<'a>(Mutex<&'a mut (dyn FnMut(FitProgress<'_>) + Send)>);

impl<'a> Listener<'a> {
    pub(super) fn new(listener: &'a mut (dyn FnMut(FitProgress<'_>) + Send)) -> Self {
        Self(Mutex::new(listener))
    }

    pub(super) fn report(&self, progress: FitProgress<'_>) {
        let mut listener = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        listener(progress);
    }
}
