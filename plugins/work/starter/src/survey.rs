//! Decides what is measured of a log's columns: rates, gaps, extremes; not what they mean.

use std::cell::OnceCell;

use athermal_core::document::TableBase;
use athermal_core::unit::Unit;
use athermal_files::{
    CellFault, ChannelColumn, Dataset, Event, FileError, Layout, Row, TimeForm, has_clock,
};

use athermal_analysis::diagnosis::leap::{Finder, Leaps};

use super::NoStarter;
use super::clock::Clock;
use super::column::{Column, Kind};
use super::dropped;
use super::placeholder::nothing;
use athermal_analysis::figures::{count, counted, number};

/// The values of a recording, column by column.
#[derive(Debug)]
pub struct Survey {
    /// For each column the instants in s, from the first row, and the values.
    pub series: Vec<Series>,
    /// From the first row to the last, in s.
    pub duration_s: f64,
    /// Rows.
    pub rows: u64,
    /// Remarks on rows that are not taken, or not alone.
    pub dropped: Vec<String>,
    /// Whether there are rows that only a lenient reader passes over.
    has_broken_rows: bool,
    /// How many rows are out of order.
    out_of_order: u64,
    /// How many segments there are.
    pub segments: u64,
    /// The times of the first row and of the last, where no segment begins between them.
    pub period_ns: Option<(i64, i64)>,
}

/// The values of one column.
#[derive(Debug, Default)]
pub struct Series {
    /// When, in s from the first row of the log.
    pub time_s: Vec<f64>,
    /// What.
    pub values: Vec<f64>,
    /// Whether these are only the changes of what stands in more rows.
    pub changes: bool,
    /// The value that stood for none, and has been taken out.
    pub placeholder: Option<f64>,
    /// How many cells are neither numbers nor empty.
    pub unreadable: u64,
    /// The first of them, for people.
    pub first_unreadable: Option<Unreadable>,
    gaps: OnceCell<Gaps>,
}

/// The times between the values of a series.
#[derive(Debug, Default)]
struct Gaps {
    /// Those within segments in s, that which each hundredth of them does not exceed; nothing where there are none.
    hundredths: Vec<f64>,
    /// Whether there are others.
    has_segments: bool,
}

/// A cell that cannot be read.
#[derive(Debug)]
pub struct Unreadable {
    /// Its text and its line.
    example: String,
    /// Its text.
    found: String,
    /// For a number with another decimal mark than others, their mark and the line of the first.
    mark: Option<(char, Option<u64>)>,
}

impl Unreadable {
    fn of(error: &FileError) -> Option<Self> {
        let FileError::BadCell {
            found,
            place,
            fault,
            ..
        } = error
        else {
            return None;
        };
        let mark = match fault {
            CellFault::OtherMark { mark, since } => Some((*mark, *since)),
            _ => None,
        };
        let found = found.replace(char::is_control, "\u{fffd}");
        Some(Self {
            example: format!("`{found}` in line {}", place.line),
            found,
            mark,
        })
    }
}

/// What programs write where they have no value, in small letters, between bars.
const NO_VALUES: &str = "-|--|---|?|*|na|n/a|n.a.|k.a.|#n/a|#nv|#wert!|#value!|#num!|#div/0!|none|bad|no data|nodata|no value|overrange|i/o timeout|1.#qnan";

impl Unreadable {
    /// Whether it is what stands for no value.
    fn is_none(&self) -> bool {
        let found = self.found.to_lowercase();
        NO_VALUES.split('|').any(|none| none == found)
    }
}

/// So many rows out of order are no slips: the times start again.
const RESTARTED: u64 = 10;
/// How many columns are tried for one of segments.
const CANDIDATES: usize = 40;

/// How far apart segments are laid, in s: no window bridges that.
const APART_S: f64 = 1e9;

/// A series of fewer values says nothing.
const FEWEST_VALUES: usize = 10;
/// A column with one unreadable cell among so many is text, one with fewer a sensor with mistakes in its log.
const TEXT_ONE_IN: u64 = 10;

/// Values so many times as far from nine tenths of all as these are from each other are faults, where the series leaps.
const FAR: f64 = 3.0;

/// Between which values a series lies without its faults.
fn beyond((low, high): (f64, f64)) -> (f64, f64) {
    let far = FAR * (high - low);
    (low - far, high + far)
}

impl Series {
    /// The mean time between two values in s, interruptions not counted.
    #[must_use]
    pub fn interval_s(&self) -> Option<f64> {
        let usual = 3.0 * self.gap(0.5)?;
        let gaps = self.time_s.windows(2).map(|pair| pair[1] - pair[0]);
        let (sum, count) = gaps
            .filter(|gap| *gap <= usual)
            .fold((0.0, 0.0), |(sum, count), gap| (sum + gap, count + 1.0));
        Some(sum / count)
    }

    /// The time between two values in s that the share `share` of them, in hundredths, does not exceed.
    #[must_use]
    pub fn gap(&self, share: f64) -> Option<f64> {
        let hundredths = &self.gaps().hundredths;
        hundredths.get((share * 100.0).round() as usize).copied()
    }

    /// Looked at once: windows of many widths are set against them.
    fn gaps(&self) -> &Gaps {
        self.gaps.get_or_init(|| {
            let all = self.time_s.windows(2).map(|pair| pair[1] - pair[0]);
            let mut gaps: Vec<f64> = all.filter(|gap| *gap < APART_S).collect();
            let has_segments = gaps.len() + 1 < self.time_s.len();
            gaps.sort_unstable_by(f64::total_cmp);
            let last = gaps.len().saturating_sub(1) as f64;
            let place = |hundredth| (f64::from(hundredth) / 100.0 * last).round() as usize;
            let hundredths = (0..=100_u8).filter_map(|of| gaps.get(place(of)).copied());
            Gaps {
                hundredths: hundredths.collect(),
                has_segments,
            }
        })
    }

    /// Takes other values in place of these.
    pub fn replace(&mut self, pairs: impl Iterator<Item = (f64, f64)>) {
        (self.time_s, self.values) = pairs.unzip();
        self.gaps = OnceCell::new();
    }

    /// Whether it only counts rows, the time or the like: whole numbers that rise by the same step in nearly each row, by several where rows
    /// are missing, and may start again; that rise a hundred times before they start again, if ever; or what grows as evenly as the time does.
    fn counts(&self) -> bool {
        let steps = || self.values.windows(2).map(|pair| pair[1] - pair[0]);
        let mut sorted: Vec<f64> = steps().collect();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        let is_most = |such: usize, of_hundred: usize| such * 100 >= sorted.len() * of_hundred;
        if self.values.iter().all(|value| value.fract() == 0.0) {
            let same = steps().filter(|step| *step == usual).count();
            let (least, most) = self.extremes();
            let begins = |value: f64, share: f64| value <= least + share;
            let goes_on = |pair: &&[f64]| {
                let times = (pair[1] - pair[0]) / usual;
                times >= 1.0 && times.fract() == 0.0 || begins(pair[1], 2.0 * usual.abs())
            };
            let falls = steps().filter(|step| step * usual < 0.0).count();
            let regular = self.values.windows(2).filter(goes_on).count();
            let rises = steps().filter(|step| *step > 0.0).count();
            let falling = || self.values.windows(2).filter(|pair| pair[1] < pair[0]);
            let starts_again = falling().all(|pair| begins(pair[1], 0.02 * (most - least)));
            return usual != 0.0
                && is_most(same, 50)
                && is_most(regular, 95)
                && falls * 5 <= sorted.len()
                || starts_again && rises >= 100 * (falling().count() + 1);
        }
        let (Some(first), Some(last)) = (self.time_s.first(), self.time_s.last()) else {
            return false;
        };
        let (from, to) = (self.values[0], self.values[self.values.len() - 1]);
        let rate = (to - from) / (last - first);
        let off = |(time_s, value): (&f64, &f64)| (value - from - rate * (time_s - first)).abs();
        let pairs = self.time_s.iter().zip(&self.values);
        rate != 0.0 && pairs.map(off).fold(0.0, f64::max) <= 1e-5 * (to - from).abs()
    }

    /// The stretches in s between gaps that a window of this width does not bridge.
    #[must_use]
    pub fn stretches(&self, width_s: f64) -> Vec<f64> {
        let longest = (width_s / 2.0).max(2.5 * self.gap(0.5).unwrap_or(0.0));
        if let (Some(most), false) = (self.gap(1.0), self.gaps().has_segments)
            && most <= longest
        {
            return vec![self.time_s[self.time_s.len() - 1] - self.time_s[0]];
        }
        let pieces = self.time_s.chunk_by(|a, b| b - a <= longest);
        pieces
            .map(|piece| piece[piece.len() - 1] - piece[0])
            .collect()
    }

    /// Where it leaps.
    fn leaps(&self, is_temperature: bool) -> Option<Leaps> {
        let mut finder = match is_temperature {
            true => Finder::default(),
            false => Finder::of_position(),
        };
        for (&time_s, &value) in self.time_s.iter().zip(&self.values) {
            finder.push(time_s, value);
        }
        finder.found()
    }

    /// Leaves out all other values; how many these are.
    pub fn keep(&mut self, is_kept: impl Fn(f64) -> bool) -> u64 {
        let before = self.values.len();
        let (times, values) = (
            std::mem::take(&mut self.time_s),
            std::mem::take(&mut self.values),
        );
        let pairs = times.into_iter().zip(values);
        self.replace(pairs.filter(|(_, value)| is_kept(*value)));
        (before - self.values.len()) as u64
    }

    /// The values at instants that rise, each the last one before, as long as it counts; NaN where there is none.
    #[must_use]
    pub fn at(&self, instants: &[f64]) -> Vec<f64> {
        let oldest = 3.0 * self.gap(0.9).unwrap_or(0.0);
        let mut next = 0;
        let value = |&instant: &f64| {
            next += self.time_s[next..].partition_point(|time_s| *time_s <= instant);
            match next.checked_sub(1) {
                Some(last) if instant - self.time_s[last] <= oldest => self.values[last],
                _ => f64::NAN,
            }
        };
        instants.iter().map(value).collect()
    }

    /// The smallest and the largest value.
    #[must_use]
    pub fn extremes(&self) -> (f64, f64) {
        let each = || self.values.iter().copied();
        (
            each().fold(f64::INFINITY, f64::min),
            each().fold(f64::NEG_INFINITY, f64::max),
        )
    }
}

impl Survey {
    /// Reads the files to their end. What cannot be read is passed over.
    ///
    /// # Errors
    /// When a file cannot be read, they are not one recording, or have less than two rows.
    pub fn of(
        data: &Dataset,
        clock: &Clock,
        table: &TableBase,
        columns: &[Column],
    ) -> Result<Self, NoStarter> {
        let channel = |column: &Column| ChannelColumn {
            column: column.name.clone(),
            optional: true,
            is_instant: false,
        };
        let mut recording = data.skim(Layout {
            time: clock.column(),
            channels: columns.iter().map(channel).collect(),
            table: table.clone(),
        })?;
        let mut series: Vec<Series> = columns.iter().map(|_| Series::default()).collect();
        let (mut row, mut first, mut last, mut rows) = (Row::default(), None, 0, 0);
        let (mut segments, mut before_s, mut begins_s) = (1, 0.0, 0.0);
        let mut begins_ns = None;
        loop {
            match recording.next_into(&mut row)? {
                Event::Row => {}
                Event::Segment => {
                    let length_s = first.take().map_or(0.0, |of| (last - of) as f64 / 1e9);
                    (segments, before_s) = (segments + 1, before_s + length_s);
                    begins_s += length_s + 2.0 * APART_S;
                    continue;
                }
                Event::End => break,
            }
            let first = *first.get_or_insert(row.time_ns);
            begins_ns.get_or_insert(row.time_ns);
            last = row.time_ns;
            rows += 1;
            let time_s = begins_s + (row.time_ns - first) as f64 / 1e9;
            for (series, &value) in series.iter_mut().zip(&row.values) {
                if value.is_finite() {
                    series.time_s.push(time_s);
                    series.values.push(value);
                }
            }
        }
        let files = recording.reports();
        let reports = || files.iter().map(|(_, report)| report);
        for report in reports() {
            for (series, bad) in series.iter_mut().zip(&report.bad_cells_of) {
                series.unreadable += bad.count;
                let first = series.first_unreadable.take();
                let read = || bad.first.as_ref().and_then(Unreadable::of);
                series.first_unreadable = first.or_else(read);
            }
        }
        let duration_s = before_s + first.map_or(0.0, |first| (last - first) as f64 / 1e9);
        if rows < 2 || duration_s <= 0.0 {
            let counts =
                reports().flat_map(|of| [&of.refused_rows, &of.repeated_time, &of.refused_time]);
            let first = counts.filter_map(|of| of.first.as_ref()).next();
            let first = first.map_or_else(String::new, |error| format!("; {error}"));
            return Err(NoStarter::of(
                data,
                format!("it has less than two rows with a time{first}"),
            ));
        }
        let dropped = files.iter().flat_map(|(file, report)| {
            let remarks = dropped::remarks(report, clock).into_iter();
            remarks.map(move |remark| (file, remark))
        });
        let dropped = dropped.map(|(file, remark)| match files.len() {
            1 => remark,
            _ => format!("{file}: {remark}"),
        });
        Ok(Self {
            series,
            duration_s,
            rows,
            dropped: dropped.collect(),
            has_broken_rows: reports().any(|report| report.refused_rows.count > 0),
            out_of_order: reports().map(|report| report.refused_time.count).sum(),
            segments,
            period_ns: begins_ns
                .filter(|_| segments == 1)
                .map(|first| (first, last)),
        })
    }

    /// The same in segments by a column that changes just where the times start again, with that column; none where nothing does, or
    /// the times start again nowhere.
    pub fn by_segments(
        &self,
        data: &Dataset,
        clock: &Clock,
        table: &TableBase,
        (names, columns): (&[&String], &[Column]),
    ) -> Option<(Self, TableBase, String)> {
        if self.out_of_order < RESTARTED {
            return None;
        }
        let times = clock.columns.names();
        let names = names.iter().copied();
        let names = names.filter(|name| !name.is_empty() && !times.contains(name));
        // A time that counts from a start begins anew with each: after a reboot, say.
        let counts = !matches!(clock.form, TimeForm::Format(_) | TimeForm::Rfc3339);
        let times = times.iter().filter(|_| counts && times.len() == 1);
        let mut tried = names.take(CANDIDATES).chain(times).filter_map(|name| {
            let mut table = table.clone();
            let files = table.files.iter_mut().map(|(_, table)| table);
            for table in files.chain([&mut table.base]) {
                table.segment = Some(name.clone());
            }
            let of = Self::of(data, clock, &table, columns).ok()?;
            Some((of, table, name.clone()))
        });
        tried
            .find(|(of, ..)| of.out_of_order == 0 && of.segments > 1 && of.segments * 10 <= of.rows)
    }

    /// Whether none of these has a gap that a window of this width does not bridge.
    #[must_use]
    pub fn has_no_gap(&self, series: &[&Series], width_s: f64) -> bool {
        series
            .iter()
            .all(|series| series.stretches(width_s).len() <= 1)
    }

    /// Leaves out the columns that say nothing, and warns of cells that cannot be read in those that stay.
    pub fn judge(&self, columns: &mut [Column], keep: &[String]) {
        for (series, column) in self.series.iter().zip(columns) {
            let (low, high) = series.extremes();
            let values = series.values.len();
            let cells = values as u64 + series.unreadable;
            let example = series
                .first_unreadable
                .as_ref()
                .map_or("", |first| first.example.as_str());
            let first = series.first_unreadable.as_ref();
            let mark = first.and_then(|first| first.mark);
            let has_none = first.is_some_and(Unreadable::is_none);
            if column.name.is_empty() && values > 0 {
                column.leave_out("a graph knows columns by their names; give it one");
            } else if column.name.contains(['{', '}']) {
                column.leave_out(
                    "in a graph, braces in the name of a column stand for something else; rename it".to_owned(),
                );
            } else if series.unreadable * TEXT_ONE_IN >= cells.max(1)
                && !(has_none && values >= FEWEST_VALUES)
            {
                let all = if values == 0 { "" } else { "in part " };
                column.leave_out(match mark {
                    Some((mark, since)) => {
                        let of_others = match since {
                            Some(line) => format!("since line {line} the decimal mark is"),
                            None => "the decimal mark of the others is".to_owned(),
                        };
                        format!(
                            "it has numbers such as {example}, but {of_others} `{mark}`; write all numbers of a file with one mark"
                        )
                    }
                    None if first.is_some_and(|first| has_clock(&first.found)) => {
                        format!("it has other times, such as {example}")
                    }
                    None => format!(
                        "it is {all}text, such as {example}; write numbers, 1 and 0 or true and false for a flag"
                    ),
                });
            } else if values < FEWEST_VALUES {
                column.leave_out(format!(
                    "it has {}, and at least {FEWEST_VALUES} are needed",
                    counted(values as u64, "value")
                ));
            } else if low == high {
                column.leave_out(format!("it is {low} throughout"));
            } else if !column.is_measured() && !keep.contains(&column.name) && series.counts() {
                column.leave_out(format!(
                    "it only rises, and so counts rows, the time or the like, and nothing of the machine; --keep {} takes it all the same",
                    column.name
                ));
            } else if series.unreadable > 0 {
                let (cells, all) = (counted(series.unreadable, "cell"), count(cells));
                let such = if series.unreadable > 1 {
                    ", the first"
                } else {
                    ""
                };
                column.warn(format!(
                    "{cells} of {all} cannot be read{such} {example}; taken as missing"
                ));
            }
        }
    }

    /// Takes what drifts as it would have been without what a correction applied; where that is not known there is no value.
    pub fn take_back(&mut self, columns: &[Column]) {
        for (nth, column) in columns.iter().enumerate() {
            let Some(applied) = column.applied else {
                continue;
            };
            let units = Unit::parse(&columns[applied].unit)
                .ok()
                .zip(Unit::parse(&column.unit).ok());
            let factor = units
                .and_then(|(from, to)| from.factor_to(&to))
                .unwrap_or(1.0);
            let applied = self.series[applied].at(&self.series[nth].time_s);
            let series = &self.series[nth];
            let rows = series.time_s.iter().zip(&series.values).zip(applied);
            let rows: Vec<(f64, f64)> = rows
                .map(|((at, value), applied)| (*at, value - factor * applied))
                .collect();
            self.series[nth].replace(rows.into_iter().filter(|(_, value)| value.is_finite()));
        }
    }

    /// Takes the values out of temperatures that only a failed sensor gives, and warns of leaps in these and in what drifts.
    pub fn leave_out_faults(&mut self, columns: &mut [Column]) {
        for (series, column) in self.series.iter_mut().zip(columns) {
            let is_temperature = column.is_temperature();
            let drifts = column.kind == Kind::Drifting;
            if column.kind == Kind::Unused || !(is_temperature || drifts) {
                continue;
            }
            let Some(leaps) = series.leaps(is_temperature) else {
                continue;
            };
            if let Some((value, n)) = nothing(&series.values) {
                let all = count(series.values.len());
                series.keep(|of| of != value);
                series.placeholder = Some(value);
                column.warn(format!(
                    "it {leaps}: {} in {} of {all} rows, far from all others, is taken for no value",
                    number(value),
                    count(n)
                ));
                continue;
            }
            let (lowest, highest) = beyond(leaps.usual);
            let left_out = series.keep(|of| !is_temperature || (lowest..=highest).contains(&of));
            column.warn(match left_out {
                0 if drifts => {
                    format!("it {leaps}: was it moved, or zeroed anew? Drifts over it are left out")
                }
                0 => format!("it {leaps}: did the sensor fail?"),
                n => format!(
                    "it {leaps}: did the sensor fail? {} far from all others are taken for faults",
                    counted(n, "value")
                ),
            });
        }
    }

    /// Whether there are rows, or cells in a column that is used, that only a lenient reader passes over.
    #[must_use]
    pub fn needs_lenience(&self, columns: &[Column]) -> bool {
        let mut pairs = self.series.iter().zip(columns);
        self.has_broken_rows
            || pairs.any(|(series, column)| column.kind != Kind::Unused && series.unreadable > 0)
    }
}
