//! What changed, and which of it reached whom. Each line of the file is a change, or says up to which one a receiver has them.

use std::collections::{BTreeMap, VecDeque};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_run::live::store::write_whole;
use serde::{Deserialize, Serialize};

use crate::alarm::Became;
use crate::asked::Change;

/// How many changes are kept for receivers that do not take them.
const WAITING: usize = 10_000;
/// How many are kept for whoever looks.
const RECENT: usize = 200;
/// How large the file grows until it is written anew.
const LARGEST: u64 = 4 << 20;

/// After how long a file that cannot be written is tried again.
const AGAIN: Wait = Wait::from_secs(5);

/// A line of the file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(untagged)]
enum Line {
    Change(Change),
    Taken { receiver: String, up_to: u64 },
}

/// All of it.
#[derive(Debug)]
pub(crate) struct Book {
    path: PathBuf,
    file: Option<File>,
    /// When it could not be written, which is tried again after a while.
    tried: Option<Clock>,
    bytes: u64,
    /// The last changes, the oldest first.
    pub(crate) changes: VecDeque<Change>,
    /// The number of the next change.
    next: u64,
    /// Up to which number each receiver has them.
    taken: BTreeMap<String, u64>,
    /// How each alarm is: what became of it last.
    pub(crate) states: BTreeMap<String, Change>,
    /// Why it cannot be written.
    pub(crate) failed: Option<String>,
}

impl Book {
    /// That of a state folder, with what is in it, for these receivers. What a receiver that is gone has not taken is let go.
    pub(crate) fn open(state: &Path, receivers: &[String]) -> Self {
        let mut book = Self {
            path: state.join("alarms.jsonl"),
            file: None,
            tried: None,
            bytes: 0,
            changes: VecDeque::new(),
            next: 1,
            taken: receivers.iter().map(|of| (of.clone(), 0)).collect(),
            states: BTreeMap::new(),
            failed: None,
        };
        let text = fs::read_to_string(&book.path).unwrap_or_default();
        let mut known = BTreeMap::new();
        // The last line may not be whole.
        for line in text
            .lines()
            .filter_map(|line| serde_json::from_str(line).ok())
        {
            match line {
                Line::Change(change) => book.take_in(change),
                Line::Taken { receiver, up_to } => _ = known.insert(receiver, up_to),
            }
        }
        // A new receiver is given what comes from now on.
        for (receiver, up_to) in &mut book.taken {
            *up_to = known.get(receiver).copied().unwrap_or(book.next - 1);
        }
        book.shorten();
        let written = book.rewrite();
        book.note(written);
        book
    }

    fn take_in(&mut self, change: Change) {
        self.next = self.next.max(change.number + 1);
        self.states.insert(change.alarm.clone(), change.clone());
        self.changes.push_back(change);
    }

    /// Lets go of changes that all have and that are not among the last.
    fn shorten(&mut self) {
        let safe = self.taken.values().min().copied().unwrap_or(u64::MAX);
        while self.changes.len() > RECENT
            && (self.changes.len() > WAITING
                || self.changes.front().is_some_and(|of| of.number <= safe))
        {
            self.changes.pop_front();
        }
    }

    /// Writes all of it anew.
    fn rewrite(&mut self) -> io::Result<()> {
        let taken = self.taken.iter().map(|(receiver, up_to)| Line::Taken {
            receiver: receiver.clone(),
            up_to: *up_to,
        });
        // The state of an alarm that changed long ago stands in front.
        let first = self.changes.front().map_or(u64::MAX, |of| of.number);
        let old = self.states.values().filter(|of| of.number < first);
        let changes = old.chain(&self.changes).cloned().map(Line::Change);
        let mut text = String::new();
        for line in changes.chain(taken) {
            text += &serde_json::to_string(&line)?;
            text.push('\n');
        }
        write_whole(&self.path, text.as_bytes())?;
        self.file = Some(File::options().append(true).open(&self.path)?);
        self.bytes = text.len() as u64;
        Ok(())
    }

    fn append(&mut self, line: &Line) -> io::Result<()> {
        let mut text = serde_json::to_string(line)?;
        text.push('\n');
        if self.file.is_none() || self.bytes > LARGEST {
            if self.tried.is_some_and(|of| of.elapsed() < AGAIN) {
                return Err(io::Error::other("it could not be written a moment ago"));
            }
            let written = self.rewrite();
            self.tried = written.is_err().then(Clock::now);
            return written;
        }
        self.bytes += text.len() as u64;
        let Some(file) = &mut self.file else {
            return Ok(());
        };
        let written = file
            .write_all(text.as_bytes())
            .and_then(|()| file.sync_data());
        if written.is_err() {
            // Half of a line would spoil the next one.
            self.file = None;
        }
        written
    }

    fn note(&mut self, written: io::Result<()>) {
        match written {
            // What was said first stands.
            Err(_) if self.failed.is_some() => {}
            written => self.failed = written.err().map(|error| error.to_string()),
        }
    }

    /// Takes a change down.
    pub(crate) fn add(&mut self, mut change: Change) {
        change.number = self.next;
        let line = Line::Change(change.clone());
        self.take_in(change);
        self.shorten();
        let written = self.append(&line);
        self.note(written);
    }

    /// What a receiver has not taken: at most so many of the newest, and how many there are.
    pub(crate) fn waiting(&self, receiver: &str, most: usize) -> (Vec<Change>, u64) {
        let taken = self.taken.get(receiver).copied().unwrap_or_default();
        let count = (self.next - 1).saturating_sub(taken);
        let mut last: Vec<_> = self.changes.iter().rev().take(most).cloned().collect();
        last.retain(|of| of.number > taken);
        last.reverse();
        (last, count)
    }

    /// A receiver has all up to a number.
    pub(crate) fn taken(&mut self, receiver: &str, up_to: u64) {
        if let Some(taken) = self.taken.get_mut(receiver) {
            *taken = up_to;
        }
        let line = Line::Taken {
            receiver: receiver.to_owned(),
            up_to,
        };
        self.shorten();
        let written = self.append(&line);
        self.note(written);
    }

    /// Whether an alarm is raised, acknowledged or not.
    pub(crate) fn is_raised(&self, alarm: &str) -> bool {
        let state = self.states.get(alarm);
        state.is_some_and(|of| of.change != Became::Gone)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(alarm: &str, change: Became) -> Change {
        Change {
            number: 0,
            time_s: 1.5,
            host_s: 2.0,
            alarm: alarm.to_owned(),
            change,
            text: None,
            of: "now.Z".to_owned(),
            value: Some(83.25),
            unit: "nm/min".to_owned(),
            by: None,
        }
    }

    #[test]
    fn what_was_not_taken_waits_over_a_restart_in_order_and_half_a_line_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let receivers = ["journal".to_owned(), "hook".to_owned()];
        let mut book = Book::open(folder.path(), &receivers);
        for became in [
            Became::Raised,
            Became::Acknowledged,
            Became::Gone,
            Became::Raised,
        ] {
            book.add(change("hot", became));
        }
        book.taken("journal", 4);
        book.taken("hook", 2);
        let mut file = File::options().append(true).open(&book.path).unwrap();
        file.write_all(b"{\"number\":5,\"time").unwrap();
        for _ in 0..2 {
            let book = Book::open(folder.path(), &receivers);
            let (waiting, count) = book.waiting("hook", 100);
            let became: Vec<_> = waiting.iter().map(|of| (of.number, of.change)).collect();
            assert_eq!(became, [(3, Became::Gone), (4, Became::Raised)]);
            assert_eq!((count, book.waiting("journal", 100).1), (2, 0));
            assert!(book.is_raised("hot") && !book.is_raised("cold"));
        }
        // Of one that is new nothing waits; one that is gone is forgotten.
        let book = Book::open(folder.path(), &["other".to_owned()]);
        assert_eq!(
            (book.waiting("other", 100).1, book.waiting("hook", 0).1),
            (0, 4)
        );
    }

    #[test]
    fn of_a_storm_the_newest_are_kept_and_all_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let mut book = Book::open(folder.path(), &["hook".to_owned()]);
        // Without a disk, which would take its time.
        book.path = folder.path().join("nowhere/alarms.jsonl");
        book.file = None;
        for nth in 0..12_000 {
            book.add(change(
                "hot",
                if nth % 2 == 0 {
                    Became::Raised
                } else {
                    Became::Gone
                },
            ));
        }
        assert!(book.failed.is_some());
        assert_eq!(book.changes.len(), WAITING);
        let (last, count) = book.waiting("hook", 100);
        assert_eq!((last.len(), last[99].number, count), (100, 12_000, 12_000));
    }
}
