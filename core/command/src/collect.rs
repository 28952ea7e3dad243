//! Reports and progress of one thread, for a program that shows them in its own way instead of on a terminal.

use std::cell::RefCell;
use std::sync::Arc;

use crate::message::Message;

/// A report that was collected.
#[derive(Debug, Clone)]
pub struct Collected {
    /// How grave it is: `note`, `warning` or `error`.
    pub level: &'static str,
    /// What is reported.
    pub message: Message,
}

/// Takes progress, from any thread: what is done, how much of it so far, and of how much where that is known.
pub type ProgressListener = Arc<dyn Fn(&str, u64, Option<u64>) + Send + Sync>;

#[derive(Default)]
struct Collection {
    reports: Vec<Collected>,
    progress: Option<ProgressListener>,
}

thread_local! {
    static COLLECTION: RefCell<Option<Collection>> = const { RefCell::new(None) };
}

/// Puts back what was collected into before, also after a panic.
struct Before(Option<Collection>);

impl Drop for Before {
    fn drop(&mut self) {
        COLLECTION.set(self.0.take());
    }
}

/// Does some work whose reports on this thread come back instead of going to standard error.
pub fn collected<R>(
    progress: Option<ProgressListener>,
    work: impl FnOnce() -> R,
) -> (R, Vec<Collected>) {
    let reports = Vec::new();
    let _before = Before(COLLECTION.replace(Some(Collection { reports, progress })));
    let result = work();
    let reports = COLLECTION.take().unwrap_or_default().reports;
    (result, reports)
}

/// Takes a report where reports are collected; whether they are.
pub(crate) fn take(level: &'static str, message: &Message) -> bool {
    COLLECTION.with_borrow_mut(|collection| {
        let Some(collection) = collection else {
            return false;
        };
        let message = message.clone();
        collection.reports.push(Collected { level, message });
        true
    })
}

/// Who takes progress on this thread; nobody where nothing is collected.
pub(crate) fn progress() -> Option<ProgressListener> {
    COLLECTION.with_borrow(|collection| collection.as_ref()?.progress.clone())
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::terminal::{Options, Terminal};

    #[test]
    fn reports_and_progress_of_the_work_come_back() {
        let terminal = Terminal::new(&Options {
            format: "json".to_owned(),
            quiet: false,
        });
        let seen = Arc::new(Mutex::new(Vec::new()));
        let progress: ProgressListener = {
            let seen = Arc::clone(&seen);
            Arc::new(move |what, done, total| {
                let mut seen = seen.lock().unwrap();
                seen.push((what.to_owned(), done, total));
            })
        };
        let (answer, reports) = collected(Some(progress), || {
            terminal.warning("a sensor is stuck");
            let ((), inner) = collected(None, || terminal.note("within"));
            assert_eq!(inner.len(), 1);
            terminal.progress_to("fitting", 7).set(3);
            terminal.note("done");
            7
        });
        assert_eq!(answer, 7);
        let reports = reports
            .iter()
            .map(|of| format!("{}: {}", of.level, of.message));
        let reports: Vec<String> = reports.collect();
        assert_eq!(reports, ["warning: a sensor is stuck", "note: done"]);
        assert_eq!(*seen.lock().unwrap(), [("fitting".to_owned(), 3, Some(7))]);
        assert!(!take("note", &Message::from("outside")));
    }
}
