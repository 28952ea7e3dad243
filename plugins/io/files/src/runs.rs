//! A long table whose names stand one after the other: its stretches that are in order of time, and their lines merged by it. What
//! the lines hold is read elsewhere.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::{Arc, Mutex};

use crate::TimeColumn;
use crate::cell;
use crate::columns::names_in;
use crate::lines::{LONGEST_ROW, is_content};

/// More stretches than these are rows in no order.
const MOST: usize = 10_000;
/// Bytes read ahead of each.
const PIECE: usize = 4096;

/// How a line gives its time.
#[derive(Clone)]
pub(crate) struct Stamp {
    pub time: TimeColumn,
    /// Where the columns of the time stand.
    pub places: Vec<usize>,
    pub separator: u8,
    pub commas: bool,
    /// The line of the names, without its end.
    pub header: Vec<u8>,
}

impl Stamp {
    /// The instant of a line in ns; none where it has none.
    fn of(&self, line: &[u8], text: &mut Vec<u8>) -> Option<i64> {
        if line.contains(&b'"') {
            let cells = names_in(line, self.separator);
            let cell = |column: usize| {
                cells
                    .get(self.places[column])
                    .map_or(&[][..], |cell| cell.as_bytes())
            };
            self.time.columns.join(text, cell);
        } else {
            let cell = |column: usize| {
                let mut cells = line.split(|byte| *byte == self.separator);
                cells.nth(self.places[column]).map_or(&[][..], cell::trim)
            };
            self.time.columns.join(text, cell);
        }
        if self.commas
            && let Some(comma) = cell::comma_of_time(text)
        {
            text[comma] = b'.';
        }
        match self.time.read(text, None) {
            Some(athermal_core::time::Civil::At(at)) => Some(at.as_ns()),
            _ => None,
        }
    }

    /// Whether a line names columns, and other ones.
    fn is_other_header(&self, line: &[u8]) -> bool {
        let names = names_in(line, self.separator);
        let times = self.time.columns.names();
        line.trim_ascii() != self.header.trim_ascii()
            && times.iter().all(|time| names.contains(time))
    }
}

/// A stretch of a file.
struct Run {
    from: u64,
    to: u64,
    /// The number of the line before it.
    number: u64,
}

/// The stretches of a file below its names; none where it has one alone, or where they cannot be merged.
fn runs(path: &Path, names: u64, stamp: &Stamp) -> Option<Vec<Run>> {
    let mut input = BufReader::with_capacity(1 << 16, File::open(path).ok()?);
    let (mut line, mut text) = (Vec::new(), Vec::new());
    let (mut at, mut number, mut last) = (0_u64, 0_u64, i64::MIN);
    let mut runs: Vec<Run> = Vec::new();
    loop {
        line.clear();
        let read = (&mut input)
            .take(LONGEST_ROW as u64 + 1)
            .read_until(b'\n', &mut line)
            .ok()?;
        if read == 0 {
            break;
        }
        if number == 0 && line.starts_with(&[0x1f, 0x8b])
            || line.starts_with(&[0xff, 0xfe])
            || read > LONGEST_ROW
        {
            return None;
        }
        if number >= names {
            let time = is_content(&line)
                .then(|| stamp.of(&line, &mut text))
                .flatten();
            if time.is_none() && is_content(&line) && stamp.is_other_header(&line) {
                return None;
            }
            if runs.is_empty() || time.is_some_and(|time| time < last) {
                let (from, to) = (at, at);
                runs.push(Run { from, to, number });
                if runs.len() > MOST {
                    return None;
                }
            }
            last = time.unwrap_or(last);
        }
        at += read as u64;
        number += 1;
        if let Some(run) = runs.last_mut() {
            run.to = at;
        }
    }
    (runs.len() > 1).then_some(runs)
}

/// Where the next line of a stretch is read.
struct Cursor {
    file: Arc<Mutex<File>>,
    at: u64,
    to: u64,
    number: u64,
    piece: Vec<u8>,
    used: usize,
    line: Vec<u8>,
}

impl Cursor {
    /// Reads its next line; false at its end.
    fn advance(&mut self) -> std::io::Result<bool> {
        self.line.clear();
        loop {
            let rest = &self.piece[self.used..];
            if let Some(end) = rest.iter().position(|byte| *byte == b'\n') {
                self.line.extend(&rest[..=end]);
                self.used += end + 1;
                self.number += 1;
                return Ok(true);
            }
            self.line.extend(rest);
            self.used = 0;
            self.piece.clear();
            let wanted = usize::try_from(self.to - self.at).map_or(PIECE, |rest| rest.min(PIECE));
            if wanted == 0 {
                self.number += u64::from(!self.line.is_empty());
                return Ok(!self.line.is_empty());
            }
            self.piece.resize(wanted, 0);
            let mut file = self.file.lock().map_err(|_| std::io::ErrorKind::Other)?;
            file.seek(SeekFrom::Start(self.at))?;
            file.read_exact(&mut self.piece)?;
            self.at += wanted as u64;
        }
    }
}

/// The lines of all stretches in order of time.
pub(crate) struct Merge {
    stamp: Stamp,
    cursors: Vec<Cursor>,
    /// The time of the line that each has ready, and which it is.
    next: BinaryHeap<Reverse<(i64, usize)>>,
    text: Vec<u8>,
}

impl Merge {
    /// The stretches of a file below the line of its names, where it has several.
    pub fn of(path: &Path, names: u64, stamp: Stamp) -> Option<Self> {
        let runs = runs(path, names, &stamp)?;
        let file = Arc::new(Mutex::new(File::open(path).ok()?));
        let cursor = |run: &Run| Cursor {
            file: Arc::clone(&file),
            at: run.from,
            to: run.to,
            number: run.number,
            piece: Vec::new(),
            used: 0,
            line: Vec::new(),
        };
        let mut merge = Self {
            stamp,
            cursors: runs.iter().map(cursor).collect(),
            next: BinaryHeap::new(),
            text: Vec::new(),
        };
        for which in 0..merge.cursors.len() {
            merge.refill(which, i64::MIN).ok()?;
        }
        Some(merge)
    }

    /// Gets a stretch's next line ready; one without a time goes with the one before it.
    fn refill(&mut self, which: usize, before: i64) -> std::io::Result<()> {
        let cursor = &mut self.cursors[which];
        if cursor.advance()? {
            let time = self.stamp.of(&cursor.line, &mut self.text);
            self.next.push(Reverse((time.unwrap_or(before), which)));
        }
        Ok(())
    }

    /// Puts the next line into `line` and gives its number; none at the end.
    pub fn advance(&mut self, line: &mut Vec<u8>) -> std::io::Result<Option<u64>> {
        let Some(Reverse((time, which))) = self.next.pop() else {
            return Ok(None);
        };
        std::mem::swap(line, &mut self.cursors[which].line);
        let number = self.cursors[which].number;
        self.refill(which, time)?;
        Ok(Some(number))
    }
}
