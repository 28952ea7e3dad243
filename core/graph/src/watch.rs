//! Who follows a longer piece of work: what is remarked on the way, and how far it has come. What becomes of that is the host's business:
//! a terminal shows it, a program keeps it.

use std::sync::{Arc, Mutex, PoisonError};

use crate::diagnostic::{Diagnostics, Sources};
use crate::message::Message;

/// Follows a piece of work.
pub trait Watch: Sync {
    /// Takes a remark, which is a `note`, a `warning` or an `error`.
    fn remark(&self, level: &'static str, message: Message);

    /// Begins to follow how far the work comes that is called so: of so many ticks, where that is known.
    fn begin(&self, what: &str, total: Option<u64>) -> Box<dyn Progress>;

    /// Takes what is doubtful or wrong in a file, beside a result that there is nevertheless.
    fn doubts(&self, diagnostics: &Diagnostics, sources: &Sources) {
        if !diagnostics.is_empty() {
            let text = diagnostics.render(sources, false, 100);
            self.remark("warning", Message::from(text.trim_end()));
        }
    }
}

/// How far some work has come.
pub trait Progress: Send {
    /// So many have been done so far.
    fn set(&mut self, done: u64);
    /// From here on the work is called so.
    fn doing(&mut self, what: String);
}

impl dyn Watch + '_ {
    /// Notes something that is worth knowing beside the result.
    pub fn note(&self, message: impl Into<Message>) {
        self.remark("note", message.into());
    }

    /// Warns of what is not as it should be, but did not stop the work.
    pub fn warning(&self, message: impl Into<Message>) {
        self.remark("warning", message.into());
    }

    /// Warns of a fault, and notes what is none.
    pub fn report(&self, (is_fault, message): (bool, Message)) {
        self.remark(if is_fault { "warning" } else { "note" }, message);
    }

    /// Follows how many ticks are stepped.
    pub fn progress(&self, what: &str) -> Box<dyn Progress> {
        self.begin(what, None)
    }

    /// Follows how many of so many are done.
    pub fn progress_to(&self, what: &str, total: u64) -> Box<dyn Progress> {
        self.begin(what, Some(total))
    }
}

/// A remark that was kept.
#[derive(Debug, Clone)]
pub struct Remark {
    /// How grave it is: `note`, `warning` or `error`.
    pub level: &'static str,
    /// What is remarked.
    pub message: Message,
}

/// Takes progress, from any thread: what is done, how much of it so far, and of how much where that is known.
pub type ProgressListener = Arc<dyn Fn(&str, u64, Option<u64>) + Send + Sync>;

/// Keeps remarks, and passes progress on.
#[derive(Default)]
pub struct Kept {
    remarks: Mutex<Vec<Remark>>,
    progress: Option<ProgressListener>,
}

impl Kept {
    /// One that passes progress on to somebody.
    #[must_use]
    pub fn with(progress: Option<ProgressListener>) -> Self {
        Self {
            remarks: Mutex::default(),
            progress,
        }
    }

    /// What was remarked.
    #[must_use]
    pub fn remarks(self) -> Vec<Remark> {
        let remarks = self.remarks.into_inner();
        remarks.unwrap_or_else(PoisonError::into_inner)
    }
}

impl Watch for Kept {
    fn remark(&self, level: &'static str, message: Message) {
        let mut remarks = self.remarks.lock().unwrap_or_else(PoisonError::into_inner);
        remarks.push(Remark { level, message });
    }

    fn begin(&self, what: &str, total: Option<u64>) -> Box<dyn Progress> {
        Box::new(Passed {
            what: what.to_owned(),
            total,
            to: self.progress.clone(),
        })
    }
}

/// Progress that is passed on.
struct Passed {
    what: String,
    total: Option<u64>,
    to: Option<ProgressListener>,
}

impl Progress for Passed {
    fn set(&mut self, done: u64) {
        if let Some(to) = &self.to {
            to(&self.what, done, self.total);
        }
    }

    fn doing(&mut self, what: String) {
        self.what = what;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remarks_are_kept_and_progress_is_passed_on() {
        let seen = Arc::new(Mutex::new(Vec::new()));
        let listener: ProgressListener = {
            let seen = Arc::clone(&seen);
            Arc::new(move |what, done, total| {
                seen.lock().unwrap().push((what.to_owned(), done, total));
            })
        };
        let kept = Kept::with(Some(listener));
        let watch: &dyn Watch = &kept;
        watch.warning("a sensor is stuck");
        let mut progress = watch.progress_to("fitting", 7);
        progress.set(3);
        progress.doing("scoring".to_owned());
        progress.set(4);
        watch.note("done");
        let remarks = kept.remarks();
        let remarks: Vec<_> = remarks
            .iter()
            .map(|of| format!("{}: {}", of.level, of.message))
            .collect();
        assert_eq!(remarks, ["warning: a sensor is stuck", "note: done"]);
        let of = |what: &str, done| (what.to_owned(), done, Some(7));
        assert_eq!(*seen.lock().unwrap(), [of("fitting", 3), of("scoring", 4)]);
    }
}
