//! The thread that syncs: it waits for the disk, so that writing does not.

use std::fs::File;
use std::io;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::thread::{JoinHandle, Thread};

/// What is to be synced: all of a file up to a place, which is all records below a number.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mark {
    pub(super) file: u64,
    pub(super) offset: u64,
    pub(super) event: u64,
    pub(super) happenings: u64,
}

/// What is to be synced, and who waits for it.
type Request = (File, Mark, Thread);

/// The other end of the thread that syncs.
#[derive(Debug)]
pub(super) struct Syncer {
    requests: Option<SyncSender<Request>>,
    results: Receiver<(Mark, io::Result<()>)>,
    thread: Option<JoinHandle<()>>,
    is_busy: bool,
}

impl Syncer {
    pub(super) fn start() -> io::Result<Self> {
        let (requests, todo) = sync_channel::<Request>(1);
        let (done, results) = sync_channel(1);
        let thread = std::thread::Builder::new().name("journal-sync".to_owned());
        let thread = thread.spawn(move || {
            for (file, mark, asks) in todo {
                if done.send((mark, file.sync_data())).is_err() {
                    return;
                }
                asks.unpark();
            }
        })?;
        Ok(Self {
            requests: Some(requests),
            results,
            thread: Some(thread),
            is_busy: false,
        })
    }

    /// Whether one is under way.
    pub(super) fn is_busy(&self) -> bool {
        self.is_busy
    }

    /// Asks for a sync, unless one is under way. This thread is woken by its end.
    pub(super) fn ask(&mut self, file: &File, mark: Mark) -> io::Result<bool> {
        if self.is_busy {
            return Ok(false);
        }
        let second = file.try_clone()?;
        let request = (second, mark, std::thread::current());
        let sent = self.requests.as_ref().map(|of| of.try_send(request));
        self.is_busy = matches!(sent, Some(Ok(())));
        Ok(self.is_busy)
    }

    /// What has become of the sync that was asked for; none while it is under way.
    pub(super) fn result(&mut self) -> Option<(Mark, io::Result<()>)> {
        match self.results.try_recv() {
            Ok(result) => {
                self.is_busy = false;
                Some(result)
            }
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => None,
        }
    }
}

impl Drop for Syncer {
    fn drop(&mut self) {
        self.requests = None;
        // A disk that hangs does not keep the program from ending.
        if let Some(thread) = self.thread.take().filter(|_| !self.is_busy) {
            let _ = thread.join();
        }
    }
}
