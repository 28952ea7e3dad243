//! A running service, asked from other threads.

use std::fmt;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::Duration as Wait;

use super::Service;
use crate::bell::Bell;

/// How many may wait for the control thread.
const WAITING: usize = 64;

pub(super) type Work = Box<dyn FnOnce(&mut Service) + Send>;

/// Asks a running service, from any thread: what is handed over is done by the thread that owns the service, at its next
/// [`pump`](Service::pump). What runs does not notice.
#[derive(Debug, Clone)]
pub struct ServiceHandle(SyncSender<Work>, Bell);

/// Why there is no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoAnswer {
    /// Too many others wait.
    Busy,
    /// It did not come in time. What was asked for may yet be done.
    TooLate,
    /// The service has ended.
    Ended,
}

impl ServiceHandle {
    pub(super) fn new() -> (Self, Receiver<Work>) {
        let (queue, asked) = sync_channel(WAITING);
        (Self(queue, Bell::here()), asked)
    }

    /// Has something done to the service, and waits for what comes of it.
    ///
    /// # Errors
    /// When there is no answer, and why.
    pub fn ask<T: Send + 'static>(
        &self,
        patience: Wait,
        work: impl FnOnce(&mut Service) -> T + Send + 'static,
    ) -> Result<T, NoAnswer> {
        let (give, answer) = sync_channel(1);
        let work = move |service: &mut Service| {
            // Whoever asked may have gone.
            let _ = give.try_send(work(service));
        };
        self.0
            .try_send(Box::new(work))
            .map_err(|error| match error {
                TrySendError::Full(_) => NoAnswer::Busy,
                TrySendError::Disconnected(_) => NoAnswer::Ended,
            })?;
        self.1.ring();
        answer.recv_timeout(patience).map_err(|error| match error {
            RecvTimeoutError::Timeout => NoAnswer::TooLate,
            RecvTimeoutError::Disconnected => NoAnswer::Ended,
        })
    }
}

impl fmt::Display for NoAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Busy => "too many requests wait: try again",
            Self::TooLate => "the service does not answer in time: ask for its status",
            Self::Ended => "the service has ended",
        })
    }
}

impl std::error::Error for NoAnswer {}
