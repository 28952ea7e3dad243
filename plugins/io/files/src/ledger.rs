//! What was left out of a recording and why: an error when reading strictly, a count when reading leniently.

use athermal_core::document::DecimalMark;
use athermal_core::time::Instant;
use athermal_core::unit::Unit;

use crate::cell::decimal_mark;
use crate::error::excerpt;
use crate::{Again, FileError, Place};

/// What a reader met on its way; complete once the reader has come to the end.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// Rows given.
    pub rows: u64,
    /// Rows left out because their time was before the one before ([`FileError::TimeNotAfter`]), or far after it and after the next
    /// one too, or without a next one, or of the first row of a file after the next alone ([`FileError::TimeLeaps`]).
    pub refused_time: Count,
    /// Rows left out because their time was that of the row before ([`FileError::TimeAgain`]).
    pub repeated_time: Count,
    /// Rows put together with the row before, which had their time.
    pub joined: u64,
    /// Cells taken as absent because they could not be read; only when reading leniently.
    pub bad_cells: Count,
    /// The same for each channel of the layout; empty where there was none.
    pub bad_cells_of: Vec<Count>,
    /// Rows left out because of their time cell, number of cells or syntax; only when reading leniently.
    pub refused_rows: Count,
    /// Rows that ended before their last columns, which are taken as missing ([`FileError::CellsLacking`]).
    pub short_rows: Count,
    /// Rows with a text behind the last column that has a name ([`FileError::CellBeyond`]).
    pub notes: Count,
    /// Rows within the recording that name its columns again as before ([`FileError::HeaderAgain`]).
    pub headers: Count,
    /// Those that name them in other places, unless each was reported at once.
    pub headers_moved: Count,
    /// The columns of channels under whose names stands a unit, with that.
    pub units: Vec<(String, Unit)>,
    /// The first time that is a date without a zone, and was taken for UTC.
    pub without_zone: Option<Place>,
    /// The last line, when it has no end and was left out: it was cut off in the middle, or may have been.
    pub truncated: Option<Place>,
    /// The first instant and the last of rows that were read and lie outside of the stretch that is taken ([`Options::stretch`](crate::Options::stretch)), in ns.
    pub outside: Option<(i64, i64)>,
    /// The first instant and the last, in ns; none without rows, and of a file that was read by itself.
    pub period: Option<(i64, i64)>,
    /// Files read before in the same recording, with how many rows are dated within the period of each.
    pub overlaps: Vec<(String, u64)>,
}

/// How often something was met, and the first time.
#[derive(Debug, Clone, Default)]
pub struct Count {
    /// How often.
    pub count: u64,
    /// What it was the first time, with its place.
    pub first: Option<FileError>,
}

impl Count {
    fn add(&mut self, error: impl FnOnce() -> FileError, on_first: &mut Option<OnFirst>) {
        self.count += 1;
        if self.first.is_none() {
            let first = self.first.insert(error());
            on_first.iter_mut().for_each(|report| report(first));
        }
    }

    /// The same of the newest of so many rows, one after the other: nothing comes of the data while it goes on. That is reported at
    /// once of the first, the tenth, the hundredth and so on.
    fn add_again(
        &mut self,
        error: impl FnOnce() -> FileError,
        rows: u64,
        on_first: &mut Option<OnFirst>,
    ) {
        match on_first {
            Some(report) if stays_behind(rows) => {
                self.count += 1;
                let newest = Box::new(error());
                report(&FileError::StillRefused { newest, rows });
            }
            _ => self.add(error, on_first),
        }
    }
}

/// A decimal mark, with the line since which numbers have it; no line where `[table]` declares it.
type Mark = Option<(u8, Option<u64>)>;

fn other_mark(known: &mut Mark, number: &[u8], line: impl FnOnce() -> u64) -> Mark {
    let mark = decimal_mark(number)?;
    let first = *known.get_or_insert_with(|| (mark, Some(line())));
    (first.0 != mark).then_some(first)
}

/// What is called at once with what is met for the first time.
pub(crate) type OnFirst = Box<dyn FnMut(&FileError) + Send>;

/// Whether it is the tenth, the hundredth and so on.
fn stays_behind(rows: u64) -> bool {
    rows >= 10 && 10_u64.pow(rows.ilog10()) == rows
}

/// How the time of a row follows the last one that was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Follows {
    Next,
    /// So far after it that either there is a gap or the time is wrong.
    Leaping,
    /// At the same time.
    Again,
    /// Before it.
    Behind,
}

/// After how long, and after how many times the step before, a row leaps.
const LEAP_NS: i64 = 300_000_000_000;
const LEAP_STEPS: i64 = 30;

/// The account that a reader keeps.
pub(crate) struct Ledger {
    pub report: Report,
    pub on_first: Option<OnFirst>,
    /// Whether rows of one time are put together.
    pub joins: bool,
    /// Whether what is read goes on later.
    pub goes_on: bool,
    lenient: bool,
    /// Rows that name the columns again and are left out.
    unusable_headers: Count,
    /// The last instant known before the first row, if anything was read before this.
    before_ns: Option<i64>,
    last_ns: Option<i64>,
    /// How long after the one before it that was.
    step_ns: i64,
    /// How many rows one after the other were not after it.
    behind: u64,
    /// How many rows since then could not be read.
    unreadable: u64,
    /// The time cell of the row at that instant; before the first row, what was read before says of it.
    last_time: Vec<u8>,
    /// The decimal mark of the first time that has one, with its line.
    time_mark: Mark,
    /// The same of values.
    value_mark: Mark,
}

impl Ledger {
    pub fn new(lenient: bool, decimal: Option<DecimalMark>) -> Self {
        Self {
            report: Report::default(),
            on_first: None,
            joins: false,
            goes_on: false,
            lenient,
            unusable_headers: Count::default(),
            before_ns: None,
            last_ns: None,
            step_ns: 0,
            behind: 0,
            unreadable: 0,
            last_time: Vec::new(),
            time_mark: None,
            value_mark: match decimal {
                Some(DecimalMark::Comma) => Some((b',', None)),
                _ => None,
            },
        }
    }

    /// Goes on after an instant, with its text for messages.
    pub fn begin_after(&mut self, before: Instant, text: &str) {
        self.before_ns = Some(before.as_ns());
        self.last_time = text.as_bytes().to_vec();
    }

    /// The instant of the last row taken, and how long after the one before it that was, in ns. Before the first row of what is still
    /// being written it is what was known before: a file may as well be read from its beginning again.
    pub fn last(&self) -> Option<(Instant, i64)> {
        let before_ns = self.before_ns.filter(|_| !self.joins);
        let last_ns = self.last_ns.or(before_ns);
        last_ns.map(|last_ns| (Instant::from_ns(last_ns), self.step_ns))
    }

    /// How a row at this instant would follow the last one taken.
    #[inline]
    pub fn follows(&self, time_ns: i64) -> Follows {
        match self.last_ns {
            None => self.follows_before(time_ns),
            Some(last_ns) if time_ns < last_ns => Follows::Behind,
            Some(last_ns) if time_ns == last_ns => Follows::Again,
            Some(last_ns) => {
                let leap = LEAP_NS.max(self.step_ns.saturating_mul(LEAP_STEPS));
                if time_ns.saturating_sub(last_ns) > leap {
                    Follows::Leaping
                } else {
                    Follows::Next
                }
            }
        }
    }

    /// How the first row would follow what was read before. One that is not after that stands in a log that is read again.
    fn follows_before(&self, time_ns: i64) -> Follows {
        match self.before_ns {
            Some(before_ns) if time_ns.saturating_sub(before_ns) > LEAP_NS => Follows::Leaping,
            _ => Follows::Next,
        }
    }

    /// Whether a last row that leaps is left out: two rows do not say how far apart rows are. That of what goes on is read again, save
    /// where it is the only one.
    pub fn knows_leaps(&self) -> bool {
        self.goes_on && self.last_ns.is_some() || self.step_ns > 0
    }

    /// Whether a row that follows so is left out.
    #[inline]
    pub fn refuses(&self, follows: Follows) -> bool {
        match follows {
            Follows::Next | Follows::Leaping => false,
            Follows::Again => !self.joins,
            Follows::Behind => true,
        }
    }

    /// Takes a row that is after the last one, or begins a segment, by its time cell.
    #[inline]
    pub fn take(&mut self, time_ns: i64, cell: &[u8], begins_segment: bool) {
        let last_ns = self.last_ns.or(self.before_ns).filter(|_| !begins_segment);
        let last_ns = last_ns.unwrap_or(time_ns);
        self.step_ns = time_ns.saturating_sub(last_ns).max(0);
        self.last_ns = Some(time_ns);
        (self.behind, self.unreadable) = (0, 0);
        self.last_time.clear();
        self.last_time.extend_from_slice(cell);
        self.report.rows += 1;
    }

    /// Leaves out a row that is not put together with the last one, whose time it has.
    #[cold]
    pub fn refuse_again(&mut self, cell: &[u8], place: impl FnOnce() -> Place, why: Again) {
        let error = || FileError::TimeAgain {
            place: place(),
            time: excerpt(cell),
            why,
        };
        self.report.repeated_time.add(error, &mut self.on_first);
    }

    /// Leaves out a row that is not after the last one.
    #[cold]
    pub fn refuse(&mut self, follows: Follows, cell: &[u8], place: impl FnOnce() -> Place) {
        self.behind += 1;
        if follows == Follows::Again && (self.on_first.is_none() || !stays_behind(self.behind)) {
            return self.refuse_again(cell, place, Again::Live);
        }
        let error = || FileError::TimeNotAfter {
            place: place(),
            time: excerpt(cell),
            previous: excerpt(&self.last_time),
        };
        let refused = &mut self.report.refused_time;
        refused.add_again(error, self.behind, &mut self.on_first);
    }

    /// Leaves out a row that leaps, since the next one, by its time cell, does not leap as far, or none follows.
    #[cold]
    pub fn refuse_leap(&mut self, cell: &[u8], place: Place, next: Option<&[u8]>) {
        let error = || FileError::TimeLeaps {
            place,
            time: excerpt(cell),
            previous: Some(excerpt(&self.last_time)),
            next: next.map(excerpt),
        };
        self.report.refused_time.add(error, &mut self.on_first);
    }

    /// What is wrong with a row of a long layout that is before the last one taken.
    pub fn out_of_order(&self, cell: &[u8], place: Place) -> FileError {
        FileError::LongOutOfOrder {
            place,
            time: excerpt(cell),
            previous: excerpt(&self.last_time),
        }
    }

    /// The decimal mark that times have, and since which line, where this one has another. That of values may be another
    /// still: a logger writes its own clock with a point, whatever the spreadsheet beside it does.
    pub fn other_time_mark(&mut self, time: &[u8], line: impl FnOnce() -> u64) -> Mark {
        other_mark(&mut self.time_mark, time, line)
    }

    /// The same of values: all that a file has are written with one mark.
    pub fn other_value_mark(&mut self, value: &[u8], line: impl FnOnce() -> u64) -> Mark {
        other_mark(&mut self.value_mark, value, line)
    }

    /// A cell of a channel of the layout that cannot be read.
    #[cold]
    pub fn bad_cell(
        &mut self,
        channel: usize,
        error: impl Fn() -> FileError,
    ) -> Result<(), FileError> {
        if !self.lenient {
            return Err(error());
        }
        let report = &mut self.report;
        let channels = report.bad_cells_of.len().max(channel + 1);
        report.bad_cells_of.resize_with(channels, Count::default);
        report.bad_cells_of[channel].add(&error, &mut self.on_first);
        report.bad_cells.add(error, &mut None);
        Ok(())
    }

    /// Something that is an error at the end only, where the data ever end: it is reported now.
    pub fn report_early(&mut self, error: impl FnOnce() -> FileError) {
        if let Some(report) = &mut self.on_first {
            report(&error());
        }
    }

    /// Whether what cannot be read is left out.
    pub fn is_lenient(&self) -> bool {
        self.lenient
    }

    /// A row that names the columns again. Each that moves them is reported.
    pub fn header(&mut self, again: FileError) {
        let report = &mut self.report;
        match (&again, &mut self.on_first) {
            (FileError::HeaderAgain { moved: true, .. }, Some(report)) => report(&again),
            (FileError::HeaderAgain { moved: true, .. }, None) => {
                report.headers_moved.add(|| again, &mut None);
            }
            (_, on_first) => report.headers.add(|| again, on_first),
        }
    }

    /// A row that names the columns again, and so that they cannot be taken by it.
    #[cold]
    pub fn refuse_header(&mut self, error: FileError) -> Result<(), FileError> {
        if self.is_lenient() {
            self.unusable_headers
                .add(|| error.clone(), &mut self.on_first);
            self.report.refused_rows.add(|| error, &mut None);
            return Ok(());
        }
        Err(error)
    }

    /// A row that is taken without its last cells.
    pub fn short_row(&mut self, error: impl FnOnce() -> FileError) {
        self.report.short_rows.add(error, &mut self.on_first);
    }

    /// A text that is passed over, behind a row that is taken.
    pub fn note(&mut self, error: impl FnOnce() -> FileError) {
        self.report.notes.add(error, &mut self.on_first);
    }

    /// A row that cannot be used.
    #[cold]
    pub fn refuse_row(&mut self, error: impl FnOnce() -> FileError) -> Result<(), FileError> {
        if !self.lenient {
            return Err(error());
        }
        self.unreadable += 1;
        let refused = &mut self.report.refused_rows;
        refused.add_again(error, self.unreadable, &mut self.on_first);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use crate::{Layout, Options, Reader, Row, TimeForm};

    #[test]
    fn a_clock_that_was_set_back_is_reported_again_while_nothing_comes_of_the_rows() {
        let rows = |from: u32, to: u32| (from..to).map(|t| format!("{t},1\n"));
        let text: String = std::iter::once("t,a\n0,1\n0,1\n4990,1\n5000,1\n".to_owned())
            .chain(rows(1, 151))
            .chain(rows(5001, 5003))
            .collect();
        let layout = Layout::new("t", TimeForm::SECONDS, ["a"]);
        let text = std::io::Cursor::new(text.into_bytes());
        let mut reader = Reader::from_read("pipe", text, layout, Options::default()).unwrap();
        let reported = Arc::new(Mutex::new(Vec::new()));
        reader.report_first({
            let reported = Arc::clone(&reported);
            move |error| reported.lock().unwrap().push(error.to_string())
        });
        let mut row = Row::default();
        while reader.next_into(&mut row).unwrap() {}
        let behind = |line: u32, rows: u32| {
            format!(
                "pipe:{line}: the time `{rows}` is not after `5000`; the row was left out; {rows} rows were left out since the last one \
                 that was taken: was the clock set back?"
            )
        };
        assert_eq!(
            *reported.lock().unwrap(),
            [
                "pipe:3: the time `0` is that of the row before; the row was left out: where rows are taken as they come, what belongs to \
                 one time must stand in one"
                    .to_owned(),
                "pipe:6: the time `1` is not after `5000`; the row was left out".to_owned(),
                behind(15, 10),
                behind(105, 100),
            ]
        );
        assert_eq!(reader.report().refused_time.count, 150);
        assert_eq!(reader.report().repeated_time.count, 1);
        assert_eq!(reader.report().rows, 5);
    }

    #[test]
    fn rows_that_cannot_be_read_are_reported_again_while_nothing_comes_of_them() {
        let rows = |count: u32, from: u32| -> String {
            let broken = (0..count).map(|nth| format!("{},x,1\n", from + nth));
            broken.chain([format!("{},1\n", from + count)]).collect()
        };
        let text = format!("t,a\n0,1\n{}{}", rows(150, 1), rows(12, 1000));
        let layout = Layout::new("t", TimeForm::SECONDS, ["a"]);
        let options = Options {
            lenient: true,
            ..Options::default()
        };
        let text = std::io::Cursor::new(text.into_bytes());
        let mut reader = Reader::from_read("pipe", text, layout, options).unwrap();
        let reported = Arc::new(Mutex::new(Vec::new()));
        reader.report_first({
            let reported = Arc::clone(&reported);
            move |error| reported.lock().unwrap().push(error.to_string())
        });
        let mut row = Row::default();
        while reader.next_into(&mut row).unwrap() {}
        let first = "pipe:3: 3 cells where the header has 2; correct the row, or read leniently (`--lenient`) to leave it out";
        let stays = |line: u32, rows: u32| {
            format!(
                "pipe:{line}: 3 cells where the header has 2; correct the row; {rows} rows were left out since the last one that was \
                 taken"
            )
        };
        assert_eq!(
            *reported.lock().unwrap(),
            [
                first.to_owned(),
                stays(12, 10),
                stays(102, 100),
                stays(163, 10)
            ]
        );
        assert_eq!(reader.report().refused_rows.count, 162);
        assert_eq!(reader.report().rows, 3);
    }
}
