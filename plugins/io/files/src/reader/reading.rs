//! What becomes of rows, whatever their format: which are taken, their instants and values. Not how bytes are cut into cells.

use athermal_core::time::{Civil, Instant};

use super::Row;
use super::commas::Commas;
use crate::cell;
use crate::cells::Cells;
use crate::error::excerpt;
use crate::joined::{self, Joined, Lookahead};
use crate::ledger::{Follows, Ledger};
use crate::long::Long;
use crate::machines::Machines;
use crate::{Again, CellFault, FileError, Layout, Place, TimeColumn};

/// What becomes of rows, whatever their format.
pub(super) struct Reading {
    pub(super) layout: Layout,
    pub(super) ledger: Ledger,
    pub(super) commas: Commas,
    /// The text of the time of the row that was read last.
    pub(super) time: Vec<u8>,
    /// The text of an instant beside it.
    pub(super) text: String,
    /// Which cell says the segment of a row, after those of the channels.
    pub(super) segment_cell: Option<usize>,
    /// Whether a time that goes back begins a segment.
    pub(super) restarts: bool,
    /// The segment of the row that was read last.
    pub(super) segment: Vec<u8>,
    /// Where rows are of several machines.
    pub(super) machines: Option<Machines>,
    /// Where a row has one value.
    pub(super) long: Option<Long>,
    /// What was read to find out whether the row before it is to be taken.
    pub(super) ahead: Option<Stamped>,
    /// Where rows of one time are put together.
    pub(super) joins: bool,
    pub(super) lookahead: Lookahead,
    /// The first instant that is taken in ns, and the first behind; none where all are.
    pub(super) taken: Option<(i64, i64)>,
}

/// A row with the cell that its time is from.
pub(super) struct Stamped {
    row: Row,
    cell: Vec<u8>,
    place: Place,
}

impl Reading {
    /// Reads the next row with all those of its time that can be put together with it.
    pub(super) fn next_joined<C: Cells>(
        &mut self,
        rows: &mut C,
        row: &mut Row,
    ) -> Result<bool, FileError> {
        if !self.joins {
            return self.next(rows, row);
        }
        let mut lookahead = std::mem::take(&mut self.lookahead);
        let joined = self.join_next(rows, &mut lookahead, row);
        self.lookahead = lookahead;
        joined
    }

    fn join_next<C: Cells>(
        &mut self,
        rows: &mut C,
        lookahead: &mut Lookahead,
        row: &mut Row,
    ) -> Result<bool, FileError> {
        if let Some(given) = lookahead.give(row) {
            if !matches!(given, Ok(true)) {
                return given;
            }
        } else if !self.next(rows, row)? {
            return Ok(false);
        }
        loop {
            // Where the next row stands, if that was read before.
            let stands = match &self.ahead {
                Some(read) if read.row.time_ns == row.time_ns => Some(read.place.clone()),
                _ => None,
            };
            let next = &mut lookahead.row;
            let read = self.next(rows, next);
            if !matches!(read, Ok(true)) || next.time_ns != row.time_ns || next.begins_segment {
                lookahead.read = Some(read);
                return Ok(true);
            }
            let why = match joined::join(&mut row.values, &next.values) {
                Joined::More => {
                    self.ledger.report.joined += 1;
                    continue;
                }
                Joined::Nothing => Again::Nothing,
                Joined::Contradicts(channel) => {
                    Again::Other(self.layout.channels[channel].column.clone())
                }
            };
            let place = || stands.unwrap_or_else(|| rows.place());
            let time = next.time_text.as_bytes();
            self.ledger.refuse_again(time, place, why);
        }
    }

    /// Goes to the machine whose rows are read next; false where there is none.
    pub(super) fn next_machine(&mut self) -> bool {
        let machines = self.machines.as_mut();
        let is_one = machines.is_some_and(|of| of.next(&self.ledger));
        if is_one {
            // The end of the rows before is not that of these.
            self.lookahead = Lookahead::default();
            self.segment.clear();
        }
        is_one
    }

    fn next<C: Cells>(&mut self, rows: &mut C, row: &mut Row) -> Result<bool, FileError> {
        if let Some(ahead) = self.ahead.take() {
            let follows = self.follows(&ahead.row);
            if !self.ledger.refuses(follows) {
                return self.next_doubted(rows, ahead, row);
            }
            self.ledger.refuse(follows, &ahead.cell, || ahead.place);
        }
        match self.read(rows, row)? {
            None => return Ok(false),
            Some(Follows::Leaping) => {
                let doubted = self.stamped(row, rows);
                return self.next_doubted(rows, doubted, row);
            }
            Some(Follows::Again) => {}
            Some(_) => {
                self.ledger
                    .take(row.time_ns, &self.time, row.begins_segment);
            }
        }
        Ok(true)
    }

    /// The row that was read last.
    fn stamped<C: Cells>(&self, row: &Row, rows: &C) -> Stamped {
        Stamped {
            row: row.clone(),
            cell: self.time.clone(),
            place: rows.place(),
        }
    }

    /// How a row follows the last one that was taken; the first of a segment follows none.
    fn follows(&self, row: &Row) -> Follows {
        match row.begins_segment {
            true => Follows::Next,
            false => self.ledger.follows(row.time_ns),
        }
    }

    /// Gives a row of which the next says whether it is taken, or else that one; false where none follows that says it.
    #[cold]
    fn next_doubted<C: Cells>(
        &mut self,
        rows: &mut C,
        mut doubted: Stamped,
        row: &mut Row,
    ) -> Result<bool, FileError> {
        while self.follows(&doubted.row) == Follows::Leaping {
            let next = match self.read(rows, row) {
                Ok(Some(_)) => self.stamped(row, rows),
                Ok(None) if !self.ledger.knows_leaps() => break,
                end => {
                    self.ledger.refuse_leap(&doubted.cell, doubted.place, None);
                    return end.map(|_| false);
                }
            };
            if next.row.time_ns >= doubted.row.time_ns || next.row.begins_segment {
                self.ahead = Some(next);
                break;
            }
            let cell = Some(&*next.cell);
            self.ledger.refuse_leap(&doubted.cell, doubted.place, cell);
            doubted = next;
        }
        if self.follows(&doubted.row) != Follows::Again {
            let row = &doubted.row;
            self.ledger
                .take(row.time_ns, &doubted.cell, row.begins_segment);
        }
        *row = doubted.row;
        Ok(true)
    }

    /// Reads the next row that is after the last one taken, or where rows are put together at its time, and how it follows that; none
    /// at the end.
    fn read<C: Cells>(
        &mut self,
        rows: &mut C,
        row: &mut Row,
    ) -> Result<Option<Follows>, FileError> {
        loop {
            let ledger = match &mut self.machines {
                Some(machines) => machines.ledger(&mut self.ledger),
                None => &mut self.ledger,
            };
            if !rows.advance(ledger)? {
                break;
            }
            if let Some(machines) = &mut self.machines
                && !machines.takes(rows.channel(machines.cell), &mut self.ledger, || {
                    rows.place()
                })?
            {
                continue;
            }
            if let Some(long) = &mut self.long
                && !long.takes(rows.channel(0))
            {
                continue;
            }
            let Some(time_ns) = self.read_time(rows, &mut row.time_text)? else {
                continue;
            };
            if let Some((from, to)) = self.taken
                && !(from..to).contains(&time_ns)
            {
                let outside = &mut self.ledger.report.outside;
                let (first, last) = outside.unwrap_or((time_ns, time_ns));
                *outside = Some((first.min(time_ns), last.max(time_ns)));
                continue;
            }
            row.time_ns = time_ns;
            row.begins_segment = self.segment_cell.is_some_and(|at| {
                let segment = cell::trim(rows.channel(at));
                let changes = !segment.is_empty() && *segment != *self.segment;
                let is_first = self.segment.is_empty();
                if changes {
                    self.segment = segment.to_vec();
                }
                changes && !is_first
            });
            row.begins_segment |= self.machines.as_mut().is_some_and(Machines::begins);
            row.begins_segment |= self.restarts && self.ledger.follows(time_ns) == Follows::Behind;
            let follows = self.follows(row);
            if self.ledger.refuses(follows) {
                if self.long.is_some() && follows == Follows::Behind {
                    return Err(self.ledger.out_of_order(&self.time, rows.place()));
                }
                self.ledger.refuse(follows, &self.time, || rows.place());
                continue;
            }
            self.read_values(rows, &mut row.values)?;
            return Ok(Some(follows));
        }
        match &self.long {
            Some(long) if self.ledger.on_first.is_none() => long.check(&self.layout, rows.place()),
            _ => Ok(()),
        }?;
        Ok(None)
    }

    /// The instant of the current row, and its text; `None` when the row is left out for want of one.
    fn read_time<C: Cells>(
        &mut self,
        rows: &mut C,
        text: &mut String,
    ) -> Result<Option<i64>, FileError> {
        text.clear();
        if let Some((ns, is_utc, of_file)) = rows.instant() {
            text.push_str(of_file);
            return self.take_instant(rows, ns, is_utc);
        }
        let (time, ledger) = (&self.layout.time, &mut self.ledger);
        time.columns
            .join(&mut self.time, |column| cell::trim(rows.time(column)));
        let cell = self.time.as_slice();
        let read = read_instant(time, self.commas, cell, text, ledger.last());
        let Some(Civil::At(at)) = read else {
            if read.is_none() && rows.take_header(ledger)? {
                return Ok(None);
            }
            let fault = no_instant(time, read);
            return self.refuse_time(rows, fault);
        };
        if let Some(zoned) = time.form.is_zoned(text.as_bytes()) {
            let report = &mut ledger.report;
            if report.without_zone.is_none() && !zoned && time.zone.is_none() {
                report.without_zone = Some(rows.place());
            }
        } else if self.commas.times
            && let Some(mark) = ledger.other_time_mark(cell, || rows.place().line)
        {
            return self.refuse_time(rows, other_mark(mark));
        }
        Ok(Some(at.as_ns()))
    }

    /// The same of a row that has an instant, by UTC or by the clock of the zone.
    fn take_instant<C: Cells>(
        &mut self,
        rows: &C,
        ns: i64,
        is_utc: bool,
    ) -> Result<Option<i64>, FileError> {
        self.time.clear();
        self.time.extend_from_slice(rows.time(0));
        let (time, ledger) = (&self.layout.time, &mut self.ledger);
        let at = match &time.zone {
            Some(zone) if !is_utc => zone.instant(Instant::from_ns(ns), ledger.last()),
            _ => Civil::At(Instant::from_ns(ns)),
        };
        if !is_utc && time.zone.is_none() {
            let report = &mut ledger.report;
            report.without_zone.get_or_insert_with(|| rows.place());
        }
        if let Civil::At(at) = at {
            return Ok(Some(at.as_ns()));
        }
        let fault = no_instant(time, Some(at));
        self.refuse_time(rows, fault)
    }

    /// Leaves the current row out for its time, where that is how it is read.
    #[cold]
    fn refuse_time<C: Cells>(
        &mut self,
        rows: &C,
        fault: CellFault,
    ) -> Result<Option<i64>, FileError> {
        let (cell, column) = (&self.time, self.layout.time.columns.to_string());
        let error = || bad_cell(rows.place(), &column, cell, fault);
        self.ledger.refuse_row(error)?;
        Ok(None)
    }

    fn read_values<C: Cells>(&mut self, rows: &C, values: &mut Vec<f64>) -> Result<(), FileError> {
        values.clear();
        if let Some((numbers, no_numbers)) = rows.numbers() {
            values.extend_from_slice(numbers);
            for (index, found) in no_numbers {
                self.refuse_cell(rows, *index, found.as_bytes(), CellFault::NoNumber)?;
            }
            return Ok(());
        }
        let channels = self.layout.channels.len();
        if self.long.is_none() {
            for index in 0..channels {
                let value = self.read_value(rows, index, rows.channel(index))?;
                values.push(value);
            }
            return Ok(());
        }
        values.resize(channels, f64::NAN);
        let of_row = |long: &Long| long.channels().to_vec();
        for index in self.long.as_ref().map_or(Vec::new(), of_row) {
            values[index] = self.read_value(rows, index, rows.channel(1))?;
        }
        Ok(())
    }

    #[inline]
    fn read_value<C: Cells>(
        &mut self,
        rows: &C,
        index: usize,
        cell: &[u8],
    ) -> Result<f64, FileError> {
        if self.layout.channels[index].is_instant {
            return self.read_applies_at(rows, index, cell::trim(cell));
        }
        let fault = match cell::value(cell, self.commas.values) {
            Some(_)
                if self.commas.values
                    && let Some(mark) =
                        self.ledger.other_value_mark(cell, || rows.place().line) =>
            {
                other_mark(mark)
            }
            Some(value) => return Ok(value),
            None => CellFault::NoNumber,
        };
        self.refuse_cell(rows, index, cell::trim(cell), fault)
    }

    /// The instant in s that a cell beside the time says, which is written as the time is.
    fn read_applies_at<C: Cells>(
        &mut self,
        rows: &C,
        index: usize,
        cell: &[u8],
    ) -> Result<f64, FileError> {
        if cell::value(cell, false).is_some_and(f64::is_nan) {
            return Ok(f64::NAN);
        }
        let (time, text) = (&self.layout.time, &mut self.text);
        text.clear();
        let fault = match read_instant(time, self.commas, cell, text, None) {
            Some(Civil::At(_))
                if self.commas.times
                    && time.form.is_zoned(text.as_bytes()).is_none()
                    && let Some(mark) = self.ledger.other_time_mark(cell, || rows.place().line) =>
            {
                other_mark(mark)
            }
            Some(Civil::At(at)) => return Ok((at - Instant::from_ns(0)).secs()),
            read => CellFault::NoInstant(Box::new(no_instant(time, read))),
        };
        self.refuse_cell(rows, index, cell, fault)
    }

    /// Takes the cell of a channel as absent, where that is how it is read.
    #[cold]
    fn refuse_cell<C: Cells>(
        &mut self,
        rows: &C,
        index: usize,
        cell: &[u8],
        fault: CellFault,
    ) -> Result<f64, FileError> {
        let column = &self.layout.channels[index].column;
        let error = || bad_cell(rows.place(), column, cell, fault.clone());
        self.ledger.bad_cell(index, error)?;
        Ok(f64::NAN)
    }
}

/// What a cell of a time stands for; `text` becomes the cell as it is read, with a point for a decimal comma.
fn read_instant(
    time: &TimeColumn,
    commas: Commas,
    cell: &[u8],
    text: &mut String,
    last: Option<(Instant, i64)>,
) -> Option<Civil> {
    text.push_str(std::str::from_utf8(cell).ok()?);
    if commas.times
        && let Some(comma) = cell::comma_of_time(cell)
    {
        text.replace_range(comma..=comma, ".");
    }
    time.read(text.as_bytes(), last)
}

/// A cell that is not taken.
fn bad_cell(place: Place, column: &str, cell: &[u8], fault: CellFault) -> FileError {
    FileError::BadCell {
        place,
        column: column.to_owned(),
        found: excerpt(cell),
        fault,
    }
}

/// What is wrong with a time that is no instant, read as this.
fn no_instant(time: &TimeColumn, read: Option<Civil>) -> CellFault {
    match (read, &time.zone) {
        (Some(Civil::Skipped { offset_s }), Some(zone)) => CellFault::TimeSkipped {
            zone: zone.to_string(),
            offset_s,
        },
        (Some(_), _) => CellFault::TimeBeyond,
        (None, _) => CellFault::NoTime {
            expected: time.form.expected(),
        },
    }
}

/// What is wrong with a number that has another decimal mark than those since that line.
fn other_mark((mark, since): (u8, Option<u64>)) -> CellFault {
    CellFault::OtherMark {
        mark: char::from(mark),
        since,
    }
}
